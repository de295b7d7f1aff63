#include "loops.h"

static void coulomb_viscous(LANE) {
    const double F_p = p[1], F_n = p[2], sigma_p = p[3], sigma_n = p[4];
    for (long k = 0; k < n; k++) {
        const double d = dp[k], v = d / dt;
        const double viscous = v < 0.0 ? sigma_n * v : sigma_p * v;
        const double f = d > 0.0 ? F_p : d < 0.0 ? -F_n : 0.0 * d;
        out[k] = f + viscous;
    }
}
OVER_SETS(coulomb_viscous)

static inline double gauss(double v, double F_c, double F_s, double v_s) {
    const double r = fabs(v) * (1.0 / v_s);
    return F_c + (F_s - F_c) * exp(-r * r);
}

static void stribeck_gauss(LANE) {
    const double F_c = p[1], F_s = p[2], v_s = p[3], sigma_2 = p[5];
    for (long k = 0; k < n; k++) {
        const double d = dp[k], v = d / dt, s = gauss(v, F_c, F_s, v_s);
        const double f = d > 0.0 ? s : d < 0.0 ? -s : 0.0 * d;
        out[k] = f + sigma_2 * v;
    }
}
OVER_SETS(stribeck_gauss)

static void lugre(LANE) {
    const double F_c = p[1], F_s = p[2], v_s = p[3], sigma_2 = p[5];
    const double sigma_0 = p[6], sigma_1 = p[7], v_d = p[8];
    double z = x[0]; /* sigma_0 times the deflection */
    for (long k = 0; k < n; k++) {
        const double d = dp[k], v = d / dt;
        const double s = copysign(gauss(v, F_c, F_s, v_s), d), reach = sigma_0 * d;
        double after;
        if (d == 0.0)
            after = z;
        else if (s == 0.0)
            after = 0.0;
        else if (fabs(reach) > 1e16 * fabs(s))
            after = s;
        else
            after = (z + reach) * (s / (s + reach));
        double f = after;
        if (sigma_1 != 0.0) {
            double damping = sigma_1;
            if (v_d > 0.0) {
                const double r = v * (1.0 / v_d);
                damping = sigma_1 * exp(-r * r);
            }
            f = after + damping * (after - z) * (1.0 / (sigma_0 * dt));
        }
        z = after;
        out[k] = f + sigma_2 * v;
    }
    x[0] = z;
}
OVER_SETS(lugre)

static inline double clipped(double f, double lo, double hi) { f = f > hi ? hi : f; return f < lo ? lo : f; }

/* Slider's motion within that of the joint. */
static inline double between(double slid, double d) {
    return slid * d < 0.0 ? 0.0 : fabs(slid) > fabs(d) ? d : slid;
}

static void hayward_armstrong(LANE) {
    const double F_c = p[1], F_s = p[2], v_s = p[3], sigma_2 = p[5], K = p[6];
    double z = x[0]; /* torque of the spring */
    for (long k = 0; k < n; k++) {
        const double d = dp[k], s = gauss(d / dt, F_c, F_s, v_s);
        const double trial = z + K * d, after = clipped(trial, -s, s);
        const double slid = after == trial ? 0.0 : between(d - (after - z) / K, d);
        z = after;
        out[k] = after + sigma_2 * (slid / dt);
    }
    x[0] = z;
}
OVER_SETS(hayward_armstrong)

static void decaying(LANE) {
    const double F_c = p[1], F_s = p[2], v_s = p[3], sigma_2 = p[5], K = p[6], alpha = p[7];
    double z = x[0]; /* torque of the spring */
    for (long k = 0; k < n; k++) {
        const double d = dp[k], s = gauss(d / dt, F_c, F_s, v_s);
        const double trial = (z + K * d) / (1.0 + alpha * dt), after = clipped(trial, -s, s);
        const double slid = after == trial ? alpha * dt * trial / K : between(d - (after - z) / K, d);
        z = after;
        out[k] = after + sigma_2 * (slid / dt);
    }
    x[0] = z;
}
OVER_SETS(decaying)

static void maxwell_slip(LANE) {
    const double F_c = p[1], F_s = p[2], v_s = p[3], sigma_2 = p[5];
    const int N = (int)p[6];
    const double *restrict stiffness = p + 7, *restrict share = p + 7 + N;
    for (long k = 0; k < n; k++) {
        const double d = dp[k], v = d / dt, s = gauss(v, F_c, F_s, v_s);
        double total = 0.0;
        for (int i = 0; i < N; i++) {
            const double w = share[i];
            x[i] = clipped(x[i] + stiffness[i] * d, w * -s, w * s);
            total += x[i];
        }
        out[k] = total + sigma_2 * v;
    }
}
OVER_SETS(maxwell_slip)

static void gms(LANE) {
    const double F_c = p[1], F_s = p[2], v_s = p[3], sigma_2 = p[5];
    const int N = (int)p[6];
    const double *restrict stiffness = p + 7, *restrict share = p + 7 + N;
    const double C = p[7 + 2 * N];
    double *restrict regime = x + N; /* +1, -1: slipping that way, 0: sticking */
    for (long k = 0; k < n; k++) {
        const double d = dp[k], v = d / dt;
        const double s = copysign(gauss(v, F_c, F_s, v_s), d), way = d > 0.0 ? 1.0 : -1.0;
        double total = 0.0;
        for (int i = 0; i < N; i++) {
            const double bound = share[i] * s;
            double f = x[i];
            if (d == 0.0) {
                total += f;
                continue;
            }
            if (regime[i] == way) {
                f = s == 0.0 ? 0.0 : (f + dt * way * C * share[i]) / (1.0 + dt * C / fabs(s));
            } else {
                f += stiffness[i] * d;
                regime[i] = 0.0;
                if ((f - bound) * way >= 0.0) {
                    f = bound;
                    regime[i] = way;
                }
            }
            x[i] = f;
            total += f;
        }
        out[k] = total + sigma_2 * v;
    }
}
OVER_SETS(gms)

/* Line sections by direction with slopes made beforehand. p: N, V[N], intercept, F[N], slope[N - 1] along +q, the same along -q. */
static inline double line(const double *restrict V, const double *restrict F, const double *restrict slope, int N,
                          double speed) {
    int i = 0;
    while (i < N - 2 && speed >= V[i + 1]) i++;
    return F[i] + slope[i] * (speed - V[i]);
}

struct sections { int N; const double *V, *forward, *backward; };

static inline struct sections sections_of(const double *p) {
    const int N = (int)p[0];
    return (struct sections){N, p + 1, p + 1 + N, p + 1 + 3 * N};
}

/* What friction has beyond the intercepts: Phi(v). */
static inline double beyond(struct sections c, double v) {
    const int N = c.N;
    if (v > 0.0) return line(c.V, c.forward + 1, c.forward + 1 + N, N, v) - c.forward[0];
    if (v < 0.0) return c.backward[0] - line(c.V, c.backward + 1, c.backward + 1 + N, N, -v);
    return 0.0 * v;
}

static void polyline(LANE) {
    const struct sections c = sections_of(p);
    for (long k = 0; k < n; k++) {
        const double d = dp[k], v = d / dt;
        const double f = d > 0.0 ? c.forward[0] : d < 0.0 ? -c.backward[0] : 0.0 * d;
        out[k] = f + beyond(c, v);
    }
}
OVER_SETS(polyline)

static void decaying_polyline(LANE) {
    const double K = p[0], alpha = p[1];
    const struct sections c = sections_of(p + 2);
    const double hi = c.forward[0], lo = -c.backward[0], left = 1.0 / (1.0 + alpha * dt), by_K = 1.0 / K;
    double z = x[0]; /* torque of the spring */
    for (long k = 0; k < n; k++) {
        const double d = dp[k], trial = (z + K * d) * left, after = clipped(trial, lo, hi);
        const double slid = after == trial ? alpha * dt * by_K * trial : between(d - (after - z) * by_K, d);
        z = after;
        out[k] = after + beyond(c, slid / dt);
    }
    x[0] = z;
}
OVER_SETS(decaying_polyline)

/* algFC2 tick by tick from encoder readings: the decay rate goes up in motion. c: R, K, alpha_N, alpha_H, r_W, V_W, line sections. */
void alg_fc2(const double *c, const double *q, double dt, long n, double *restrict out) {
    const double R = c[0], K = c[1], slow = c[2], fast = c[3], rate = c[4], threshold = c[5], by_K = 1.0 / K;
    const struct sections lines = sections_of(c + 6);
    const double hi = lines.forward[0], lo = -lines.backward[0];
    double z = 0.0, w = 0.0, before = q[0];
    for (long k = 0; k < n; k++) {
        const double d = q[k] - before;
        const double up = w + rate * dt, down = w - rate * dt;
        w = fabs(d) > threshold * dt ? (up < 1.0 ? up : 1.0) : down > 0.0 ? down : 0.0;
        const double alpha = (1.0 - w) * slow + w * fast;
        const double trial = (z + K * d) / (1.0 + alpha * dt), after = clipped(trial, lo, hi);
        const double slid = after == trial ? alpha * dt * by_K * trial : between(d - (after - z) * by_K, d);
        z = after, before = q[k];
        out[k] = R * (after + beyond(lines, slid / dt));
    }
}

static void m6(LANE) {
    const double F_c = p[1], F_st = p[2], v_s = p[3], alpha = p[4], K_v = p[5];
    const double K_m = p[6], K_e = p[7], S_m = p[8], S_e = p[9], Q_e = p[10], Q_m = p[11];
    for (long k = 0; k < n; k++) {
        const double d = dp[k], v = d / dt, tau_m = load[2 * k], tau_e = load[2 * k + 1];
        const double e = exp(-pow(fabs(v) / v_s, alpha));
        double F = F_c + e * F_st + (fabs(K_m * tau_m - K_e * tau_e) + e * fabs(S_m * tau_m - S_e * tau_e));
        if (tau_m * tau_e < 0.0) {
            if (fabs(tau_e) < fabs(tau_m))
                F += e * Q_e * tau_e * tau_e;
            else if (fabs(tau_e) > fabs(tau_m))
                F += e * Q_m * tau_m * tau_m;
        }
        const double f = d > 0.0 ? F : d < 0.0 ? -F : 0.0 * d;
        out[k] = f + K_v * v;
    }
}
OVER_SETS(m6)

#define STEPS 60
#define CLOSE 1e-14

/* LuGre's numbers: F_c, F_s, v_s, sigma_2, sigma_0, sigma_1, v_d. */
struct bristle { double F_c, F_s, by_v_s, sigma_2, sigma_0, sigma_1, by_v_d, rate, h; };

/* Torque of a step at velocity v from the bristle torque z; `after` is where that gets to. */
static inline double bristle_torque(struct bristle c, double z, double v, double *after) {
    const double r = fabs(v) * c.by_v_s, s = copysign(c.F_c + (c.F_s - c.F_c) * exp(-r * r), v);
    const double reach = c.sigma_0 * (v * c.h), q = v * c.by_v_d;
    *after = (z + reach) * (s / (s + reach));
    return (*after + c.sigma_1 * exp(-q * q) * (*after - z) * c.rate) + c.sigma_2 * v;
}

/* Velocity at the end of an implicit step of a mass: bracketed, then regula falsi with halving (Illinois). */
static double bristle_solve(struct bristle c, double z, double v_free, double dt_over_m) {
    double after;
    const double at_rest = v_free - dt_over_m * bristle_torque(c, z, 0.0, &after);
    if (at_rest == 0.0) return 0.0;
    const double toward = at_rest > 0.0 ? 1.0 : -1.0, close = CLOSE * (fabs(v_free) + fabs(at_rest));
#define EXCESS(speed)                                                                                          \
    (toward * (toward * (speed) + dt_over_m * bristle_torque(c, z, toward * (speed), &after) - v_free))
    double a = 0.0, excess_a = -fabs(at_rest), b = fabs(at_rest), grown = 1.0, excess_b = EXCESS(b);
    int side = 0;
    for (int i = 0; i < STEPS && excess_b < 0.0; i++) {
        const double next = b - 2.0 * grown * excess_b;
        a = b, excess_a = excess_b, b = next, grown *= 2.0;
        excess_b = EXCESS(b);
    }
    if (excess_b == 0.0) return toward * b;
    for (int i = 0; i < STEPS; i++) {
        const double speed = b - excess_b * (b - a) / (excess_b - excess_a);
        if (!(a < speed && speed < b)) break;
        const double excess = EXCESS(speed);
        if (fabs(excess) <= close) return toward * speed;
        if (excess > 0.0) {
            b = speed, excess_b = excess;
            if (side > 0) excess_a *= 0.5;
            side = 1;
        } else {
            a = speed, excess_a = excess;
            if (side < 0) excess_b *= 0.5;
            side = -1;
        }
    }
    return toward * (b - excess_b * (b - a) / (excess_b - excess_a));
}

/* A mass under LuGre friction that a PD position loop takes along the reference r; position, velocity, torque. */
void forward_lugre(const double *p, double M, double K_p, double K_d, const double *r, double h, long n,
                   double *restrict out) {
    const struct bristle c = {p[0], p[1], 1.0 / p[2], p[3], p[4], p[5], 1.0 / p[6], 1.0 / (p[4] * h), h};
    double q = 0.0, w = 0.0, z = 0.0, before = r[0], q_before = 0.0;
    for (long k = 0; k < n; k++) {
        const double v = (q - q_before) / h, dr = (r[k] - before) / h;
        const double u = K_p * (r[k] - q) + K_d * (dr - v);
        out[3 * k] = q, out[3 * k + 1] = w, out[3 * k + 2] = u;
        q_before = q, before = r[k];
        const double middle = q + 0.5 * h * w;
        w = bristle_solve(c, z, w + h / M * u, h / M);
        bristle_torque(c, z, w, &z);
        q = middle + 0.5 * h * w;
    }
}
