/* First-order filters of many columns at once, and means of their rows. See first_order.py. */

#include <stddef.h>

/* y [rows / together, columns]: means of so many rows of x [rows, columns] behind the filter; z [columns]: its state. */
void acqd_first_order(ptrdiff_t rows, ptrdiff_t columns, ptrdiff_t together, double b0, double b1, double a1,
                      const double *restrict x, double *restrict z, double *restrict y)
{
    for (ptrdiff_t row = 0; row + together <= rows; row += together, y += columns) {
        for (ptrdiff_t k = 0; k < columns; k++)
            y[k] = 0.0;
        for (ptrdiff_t n = 0; n < together; n++, x += columns)
            for (ptrdiff_t k = 0; k < columns; k++) {
                const double out = z[k] + b0 * x[k];
                z[k] = b1 * x[k] - a1 * out;
                y[k] += out;
            }
        if (together > 1)
            for (ptrdiff_t k = 0; k < columns; k++)
                y[k] /= (double)together;
    }
}
