/* The likeliest path of a load that is on or off, without short states, and what it explains. See paths.py. */

#include <stddef.h>

/* Viterbi path [rows] of 0 and 1: `stay` log-likelihood ratio of a row that is on, `rise` and `fall` of a switching
   in front of it. `back` [rows]: scratch, bit 0: off came from on, bit 1: on came from off. */
static void likeliest(ptrdiff_t rows, const double *stay, const double *rise, const double *fall, unsigned char *back,
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

/* Path [rows] of a load of a size, from `white` [5, rows] (see `White`); `scratch` [4, rows]. `sums`: the penalised
   log-likelihood ratio against always off, and product and square of which the least-squares size is the ratio. */
void acqd_path(ptrdiff_t rows, ptrdiff_t dwell, const double *white, double size, double price, double *scratch,
               unsigned char *path, double *sums)
{
    const double *product = white, *square = white + rows, *step = white + 2 * rows, *cost = white + 3 * rows,
                 *cross = white + 4 * rows, half = size * size / 2;
    double *stay = scratch, *rise = scratch + rows, *fall = scratch + 2 * rows;
    for (ptrdiff_t k = 0; k < rows; k++) {
        stay[k] = size * product[k] - half * square[k];
        rise[k] = size * step[k] - half * cost[k] - 2 * half * cross[k] - price;
        fall[k] = -size * step[k] - half * cost[k] - price;
    }
    likeliest(rows, stay, rise, fall, (unsigned char *)(scratch + 3 * rows), path);
    acqd_lasting(rows, dwell, path);
    double gain = 0.0, projected = 0.0, energy = 0.0;
    for (ptrdiff_t k = 0; k < rows; k++) {
        const int switched = k > 0 && path[k] != path[k - 1];
        if (path[k]) {
            gain += stay[k];
            projected += product[k];
            energy += square[k];
        }
        if (!switched)
            continue;
        gain += path[k] ? rise[k] : fall[k];
        projected += path[k] ? step[k] : -step[k];
        energy += cost[k] + (path[k] ? 2 * cross[k] : 0.0);
    }
    sums[0] = gain;
    sums[1] = projected;
    sums[2] = energy;
}
