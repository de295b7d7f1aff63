/* Sixteen parameter sets of one law side by side, as written by hand: a structure of arrays, blocks of 64 ticks, and the exponential
 * function `decay` of `backdrive.elementary`, so that the torques can be compared bit for bit.
 */
#pragma GCC optimize("no-trapping-math") /* or comparisons keep gcc from working on several lanes at once; no bit changes */
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { WIDTH = 16, BLOCK = 64, MOST = 16 };

#define E4 0.04166666666661246
#define E5 0.008333333333391636
#define E6 0.0013888888923720985
#define E7 0.00019841269643900577
#define E8 2.4801512218295423e-05
#define E9 2.7557517548373976e-06
#define E10 2.762388064715861e-07
#define E11 2.5009202143917747e-08

static inline int64_t bits_of(double x) { int64_t i; memcpy(&i, &x, 8); return i; }
static inline double double_of(int64_t i) { double x; memcpy(&x, &i, 8); return x; }

/* e^x for x <= 0; 0 below -709. */
static inline double decay(double x) {
    const double magic = 6755399441055744.0, y = x < -709.0 ? -709.0 : x;
    const double wide = y * 0x1.71547652b82fep+0 + magic, count = wide - magic;
    const double h = y - count * 0x1.62e42fefa4p-1, w = count * -0x1.8432a1b0e2634p-43, r = h - w, q = r * r;
    const double even = 0.5 + q * (E4 + q * (E6 + q * (E8 + q * E10)));
    const double odd = 1.0 / 6.0 + q * (E5 + q * (E7 + q * (E9 + q * E11)));
    const double value = 1.0 + (h + (q * (even + r * odd) - w));
    return value * double_of((int64_t)(((uint64_t)bits_of(wide) << 52) + 0x3ff0000000000000));
}

/* Numbers of a law, a row each; those behind MOST are what does not change from tick to tick. */
typedef double numbers[MOST + 3][WIDTH];

/* Run `sets` rows of `columns` numbers along one motion. */
#define SIDE_BY_SIDE(law)                                                                                      \
    void law##_side_by_side(const double *rows, long columns, const double *dp, double dt, long n, long sets,  \
                            double *out) {                                                                      \
        for (long first = 0; first < sets; first += WIDTH) {                                                   \
            const long count = sets - first < WIDTH ? sets - first : WIDTH;                                    \
            numbers p = {{0}};                                                                                 \
            double z[WIDTH] = {0}, torque[BLOCK][WIDTH];                                                       \
            for (int j = 0; j < WIDTH; j++) {                                                                  \
                for (long i = 0; i < columns; i++)                                                             \
                    p[i][j] = rows[(first + (j < count ? j : count - 1)) * columns + i];                       \
                law##_begin(p, dt, j);                                                                         \
            }                                                                                                  \
            for (long start = 0; start < n; start += BLOCK) {                                                  \
                const long size = n - start < BLOCK ? n - start : BLOCK;                                       \
                for (long k = 0; k < size; k++) {                                                              \
                    const double d = dp[start + k], v = d / dt;                                                \
                    _Pragma("GCC ivdep") for (int j = 0; j < WIDTH; j++)                                       \
                        torque[k][j] = law(p, z, d, v, j);                                                  \
                }                                                                                              \
                for (long j = 0; j < count; j++)                                                               \
                    for (long k = 0; k < size; k++) out[(first + j) * n + start + k] = torque[k][j];           \
            }                                                                                                  \
        }                                                                                                      \
    }

/* p: F_c, F_s, v_s, sigma_2 */
static inline void stribeck_begin(numbers p, double dt, int j) {
    (void)dt;
    p[MOST][j] = 1.0 / p[2][j];
}

static inline double stribeck(numbers p, double *z, double d, double v, int j) {
    (void)z;
    const double sign = (d > 0.0) - (d < 0.0), r = v * p[MOST][j];
    return sign * (p[0][j] + (p[1][j] - p[0][j]) * decay(-r * r)) + p[3][j] * v;
}
SIDE_BY_SIDE(stribeck)

/* p: F_c, F_s, v_s, sigma_2, sigma_0, sigma_1, v_d */
static inline void lugre_begin(numbers p, double dt, int j) {
    p[MOST][j] = 1.0 / p[2][j], p[MOST + 1][j] = 1.0 / p[6][j], p[MOST + 2][j] = 1.0 / (p[4][j] * dt);
}

static inline double lugre(numbers p, double *z, double d, double v, int j) {
    const double r = v * p[MOST][j], bound = p[0][j] + (p[1][j] - p[0][j]) * decay(-r * r);
    const double s = copysign(bound, d), reach = p[4][j] * d, before = z[j];
    const double after = (before + reach) * (s / (s + reach)); /* `before` where d is 0, for bounds are above 0 */
    const double q = v * p[MOST + 1][j];
    z[j] = after;
    return (after + p[5][j] * decay(-q * q) * (after - before) * p[MOST + 2][j]) + p[3][j] * v;
}
SIDE_BY_SIDE(lugre)
