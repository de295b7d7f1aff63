/* Sixteen parameter sets of one law side by side, as written by hand: a structure of arrays, blocks of 64 ticks, and the exponential
 * function of `backdrive.elementary`, whose table is handed over, so that the torques can be compared bit for bit.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { WIDTH = 16, BLOCK = 64, MOST = 16 };

static inline int64_t bits_of(double x) { int64_t i; memcpy(&i, &x, 8); return i; }
static inline double double_of(int64_t i) { double x; memcpy(&x, &i, 8); return x; }

/* What the function is made of: 128 / log 2, log 2 / 128 in two parts, and a table of 128 powers. */
struct exponential { double scale, high, low; const int64_t *powers; };

/* e^x for x <= 0; 0 below -708. */
static inline double decay(struct exponential c, double x) {
    const double magic = 6755399441055744.0, inside = x >= -708.0 ? x : 0.0;
    const int64_t magic_bits = 0x4338000000000000;
    const double wide = inside * c.scale + magic, count = wide - magic;
    const int64_t k = bits_of(wide) - magic_bits, entry = c.powers[k & 127];
    const double lack = (double_of((entry >> 52) + magic_bits) - magic) * 0x1p-64;
    const double r = ((inside - count * c.high) - count * c.low) + 0.0, square = r * r;
    const double t =
        lack + r + square * (0.5 + r * (1.0 / 6.0)) + square * square * (1.0 / 24.0 + r * (1.0 / 120.0));
    const double S = double_of((entry & 0xfffffffffffff) + (int64_t)((uint64_t)((k >> 7) + 1023) << 52));
    const double value = S + S * t;
    return x >= -708.0 ? value : 0.0;
}

/* Numbers of a law, a row each; those behind MOST are what does not change from tick to tick. */
typedef double numbers[MOST + 3][WIDTH];

/* Run `sets` rows of `columns` numbers along one motion. */
#define SIDE_BY_SIDE(law)                                                                                      \
    void law##_side_by_side(const double *rows, long columns, const double *dp, double dt, long n, long sets,  \
                            const struct exponential *given, double *out) {                                    \
        const struct exponential c = *given;                                                                   \
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
                        torque[k][j] = law(c, p, z, d, v, j);                                                  \
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

static inline double stribeck(struct exponential c, numbers p, double *z, double d, double v, int j) {
    (void)z;
    const double r = fabs(v) * p[MOST][j], s = p[0][j] + (p[1][j] - p[0][j]) * decay(c, -r * r);
    return (d > 0.0 ? s : d < 0.0 ? -s : 0.0) + p[3][j] * v;
}
SIDE_BY_SIDE(stribeck)

/* p: F_c, F_s, v_s, sigma_2, sigma_0, sigma_1, v_d */
static inline void lugre_begin(numbers p, double dt, int j) {
    p[MOST][j] = 1.0 / p[2][j], p[MOST + 1][j] = 1.0 / p[6][j], p[MOST + 2][j] = 1.0 / (p[4][j] * dt);
}

static inline double lugre(struct exponential c, numbers p, double *z, double d, double v, int j) {
    const double r = fabs(v) * p[MOST][j], bound = p[0][j] + (p[1][j] - p[0][j]) * decay(c, -r * r);
    const double s = copysign(bound, d), reach = p[4][j] * d, before = z[j];
    const double after = (before + reach) * (s / (s + reach)); /* `before` where d is 0, for bounds are above 0 */
    const double q = v * p[MOST + 1][j];
    z[j] = after;
    return (after + p[5][j] * decay(c, -q * q) * (after - before) * p[MOST + 2][j]) + p[3][j] * v;
}
SIDE_BY_SIDE(lugre)
