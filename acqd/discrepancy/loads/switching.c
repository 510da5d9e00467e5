/* The likeliest path of a load that is on or off, and the path without short states. See switching.py. */

#include <stddef.h>

/* Viterbi path [rows] of 0 and 1: `stay` log-likelihood ratio of a row that is on, `rise` and `fall` of a switching
   in front of it. `back` [rows]: scratch, bit 0: off came from on, bit 1: on came from off. */
void acqd_path(ptrdiff_t rows, const double *stay, const double *rise, const double *fall, unsigned char *back,
               unsigned char *path)
{
    double off = 0.0, on = stay[0] - 1.0;
    for (ptrdiff_t k = 1; k < rows; k++) {
        const double switched_off = on + fall[k], switched_on = off + rise[k];
        back[k] = (unsigned char)((switched_off > off) | (switched_on > on) << 1);
        off = switched_off > off ? switched_off : off;
        on = (switched_on > on ? switched_on : on) + stay[k];
    }
    unsigned char state = on > off;
    for (ptrdiff_t k = rows - 1; k >= 0; k--) {
        path[k] = state;
        if (k > 0)
            state ^= (back[k] >> state) & 1;
    }
}

/* Flips states shorter than `dwell` rows, the shortest first; states at the ends may be cut, and stay. */
void acqd_lasting(ptrdiff_t rows, ptrdiff_t dwell, unsigned char *path)
{
    for (;;) {
        ptrdiff_t shortest = dwell, from = 0, last = -1;
        for (ptrdiff_t k = 1; k < rows; k++) {
            if (path[k] == path[k - 1])
                continue;
            if (last >= 0 && k - last < shortest) {
                shortest = k - last;
                from = last;
            }
            last = k;
        }
        if (shortest == dwell)
            return;
        for (ptrdiff_t k = from; k < from + shortest; k++)
            path[k] ^= 1;
    }
}
