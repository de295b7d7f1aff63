/* Friction loops as written by hand for one law each: parameters in locals, state in registers, one pass over the ticks.
 *
 * The rows, states and units are those of backdrive.laws; the arithmetic and its order are too, so that the torques can be
 * compared bit for bit. A loop serves one parameter set on one motion; `OVER_SETS` makes it serve many, on one thread or
 * on all of them.
 */
#ifndef LOOPS_H
#define LOOPS_H

#include <math.h>

#define LANE                                                                                                   \
    const double *restrict p, double *restrict x, const double *restrict dp, const double *restrict load,      \
        double dt, long n, double *restrict out

/* Serve `sets` parameter sets, P columns and S states a set, set i on motion `motion[i]` of n ticks. */
#define OVER_SETS(name)                                                                                        \
    void name##_sets(const double *rows, long P, double *states, long S, const long *motion,                   \
                     const double *dp, const double *load, double dt, long n, long sets, int threads,          \
                     double *out) {                                                                            \
        _Pragma("omp parallel for schedule(dynamic, 8) num_threads(threads) if (threads > 1)")                 \
        for (long i = 0; i < sets; i++)                                                                        \
            name(rows + i * P, states + i * S, dp + motion[i] * n, load + 2 * motion[i] * n, dt, n,            \
                 out + i * n);                                                                                 \
    }

#endif
