"""Theoretical rules for the parameters of a compensator with a decaying contact.

F: Coulomb torque of the joint [N.m or N]. K_c: stiffness of its transmission [N.m/rad or N/m]. M: inertia on the motor's side.
D: damping of the transmission. R, K, alpha: share, stiffness and decay rate of the compensator. The assumptions and limits of
each formula are in docs/theory/stability.md.
"""

from __future__ import annotations

import numpy as np


def presliding(motor: float, damping: float, transmission: float, gain: float, decay: float) -> np.ndarray:
    """Return the characteristic polynomial of motor, transmission and compensator while the load is stuck, (4,).

        M s^3 + (D + M alpha) s^2 + (K_c + D alpha - R K) s + K_c alpha

    Args:
        motor: M [kg.m^2 or kg].
        damping: D [N.m.s/rad or N.s/m].
        transmission: K_c [N.m/rad or N/m].
        gain: R K of the compensator [N.m/rad or N/m].
        decay: alpha [1/s].
    """
    return np.array(
        [motor, damping + motor * decay, transmission + damping * decay - gain, transmission * decay]
    )


def routh(motor: float, damping: float, transmission: float, gain: float, decay: float) -> float:
    """Return D (K_c - R K + D alpha + M alpha^2) - M alpha R K: positive where `presliding` is stable (Routh, alpha > 0).

    The arguments are those of `presliding`.
    """
    return (
        damping * (transmission - gain + damping * decay + motor * decay**2) - motor * decay * gain
    )  # (D + M alpha)(K_c + D alpha - R K) - M K_c alpha, multiplied out


def limit_cycle(coulomb: float, transmission: float, ratio: float) -> float:
    """Return r_c/(1 - ratio), r_c = F/K_c, which no limit cycle exceeds [rad or m]; infinite for a ratio of 1 or more.

    Over a cycle of half-amplitude a the compensator gives at most 4 ratio F a, and friction takes 4 F (a - r_c).

    Args:
        coulomb: F of the joint [N.m or N].
        transmission: K_c [N.m/rad or N/m].
        ratio: ratio of compensating torque to F: R times the identified friction divided by the real one [-].
    """
    return coulomb / transmission / (1.0 - ratio) if ratio < 1.0 else np.inf


def largest_stiffness(lowest: float, friction_error: float) -> float:
    """Return the largest K with which the compensator does not slide before the joint: F/K >= F_c/K_c [N.m/rad or N/m].

    Args:
        lowest: lower end of K_c's interval [N.m/rad or N/m].
        friction_error: largest relative excess of friction over its identified value [-].
    """
    return lowest / (1.0 + friction_error)


def largest_share(friction_error: float) -> float:
    """Return the R below which the compensation stays below the least friction: R F < (1 - error) F [-]."""
    return 1.0 - friction_error


def threshold_speed(coulomb: float, stiffness: float, decay: float) -> float:
    """Return alpha F/K, below which a decaying contact gives K v/alpha instead of F [rad/s or m/s]."""
    return decay * coulomb / stiffness


def creep_speed(coulomb: float, stiffness: float, decay: float, ratio: float) -> float:
    """Return the largest mean sliding speed that the decay of the contact can sustain [rad/s or m/s].

        v = 2 alpha R F^2/(K (F_c - R F)),    F = F_c

    The compensator then gives 2 alpha R F^2/K where sliding takes (F_c - R F) v. Infinite for a ratio of 1 or more.

    Args:
        coulomb: F of joint and compensator [N.m or N].
        stiffness: K of the compensator, with F/K no less than the joint's own stretch [N.m/rad or N/m].
        decay: alpha [1/s].
        ratio: R [-].
    """
    return 2.0 * decay * ratio * coulomb / (stiffness * (1.0 - ratio)) if ratio < 1.0 else np.inf


def quantum(stiffness: float, count: float, decay: float, period: float) -> float:
    """Return the change of the compensator's torque by one encoder count: K delta/(1 + T alpha) [N.m or N]."""
    return stiffness * count / (1.0 + period * decay)


def sticking_dither(share: float, stiffness: float, transmission: float) -> float:
    """Return the largest R_d with which the load stays stuck under dither: 1 - R K/K_c [-].

    Below the resonance, dither moves the motor by R_d F/(K_c - R K). The transmission passes on K_c times that, and the load
    stays stuck if this torque is below F.

    Args:
        share: R [-].
        stiffness: K of the compensator [N.m/rad or N/m].
        transmission: K_c [N.m/rad or N/m].
    """
    return max(1.0 - share * stiffness / transmission, 0.0)


def dither_sway(
    torque: float,
    frequency: float,
    motor: float,
    damping: float,
    transmission: float,
    gain: float,
    decay: float,
    delay: float = 0.0,
) -> float:
    """Return the motor's amplitude under a dither while the load is stuck [rad or m].

    Args:
        torque: R_d F [N.m or N].
        frequency: of the dither [Hz].
        motor: M [kg.m^2 or kg].
        damping: D [N.m.s/rad or N.s/m].
        transmission: K_c [N.m/rad or N/m].
        gain: R K [N.m/rad or N/m].
        decay: alpha [1/s].
        delay: of the compensator's torque [s].
    """
    s = 2j * np.pi * frequency
    spring = gain * s / (s + decay) * np.exp(-s * delay)
    return float(torque / abs(transmission + damping * s + motor * s * s - spring))


def stopping_time(ratio: float, pushed: float, force: float = 2.0) -> float:
    """Return the longest time that a joint takes to stop after a push from rest [s].

    A push of `force` F for the time t_p leaves the speed (force - 1 + ratio) F t_p/I, which (1 - ratio) F takes off.

    Args:
        ratio: compensating torque by friction [-]; below 1.
        pushed: t_p [s].
        force: of the push by F [-].
    """
    return pushed * (force - 1.0 + ratio) / (1.0 - ratio) if ratio < 1.0 else np.inf


def spectral_radius(
    motor: float,
    load: float,
    transmission: tuple[float, float],
    contact: tuple[float, float],
    gain: float,
    decay: float,
    delay: float,
    period: float,
) -> float:
    """Return the spectral radius of motor, load and compensator in presliding, sampled exactly: below 1 is stable [-].

    The load is held by the friction's contact, which is stuck. The torque R f_k acts from t_k + delay until the next one acts,
    with f_k = (f_{k-1} + K (p_k - p_{k-1}))/(1 + T alpha). Quantisation is neglected.

    Args:
        motor: M [kg.m^2 or kg].
        load: L [kg.m^2 or kg].
        transmission: stiffness [N.m/rad or N/m] and damping [N.m.s/rad or N.s/m].
        contact: the same of the friction's contact.
        gain: R K [N.m/rad or N/m].
        decay: alpha [1/s].
        delay: T_d, of the command to the torque [s].
        period: T [s].
    """
    from scipy.linalg import expm

    (K_t, D_t), (K_b, D_b) = transmission, contact
    A = np.zeros((5, 5))  # p, w, q, v and the torque, which is held
    A[0, 1] = A[2, 3] = 1.0
    A[1, :5] = np.array([-K_t, -D_t, K_t, D_t, 1.0]) / motor
    A[3, :4] = np.array([K_t, D_t, -K_t - K_b, -D_t - D_b]) / load
    whole = int(delay // period)
    late = delay - whole * period
    first, second = expm(A * late), expm(A * (period - late))
    plant = second[:4, :4] @ first[:4, :4]
    old, new = second[:4, :4] @ first[:4, 4], second[:4, 4]
    n = 6 + whole + 1  # p, w, q, v, p before, f, torques on their way
    step = np.zeros((n, n))
    step[5, 5] = 1.0
    step[5, 0], step[5, 4] = gain, -gain
    step[5] /= 1.0 + period * decay  # f_k, times R
    step[4, 0] = 1.0
    step[:4, :4] = plant
    queue = [step[5].copy()]  # R f_k, R f_{k-1}, ... as rows over the state
    queue += [np.eye(n)[6 + i] for i in range(whole + 1)]
    step[:4] += np.outer(new, queue[whole]) + np.outer(old, queue[whole + 1])
    step[6] = queue[0]
    for i in range(whole):
        step[7 + i] = np.eye(n)[6 + i]
    return float(np.abs(np.linalg.eigvals(step)).max())
