"""The numbers of a proposal, each with its reason in a sentence and the bound that it respects."""

from __future__ import annotations

import numpy as np

from backdrive.control.compensators import Dither
from backdrive.control.estimators.friction import between_counts
from backdrive.tuning import members as members_
from backdrive.tuning import rules
from backdrive.tuning.facts import Facts
from backdrive.tuning.goals import Goal, Numbers, admittance, filter_gains
from backdrive.tuning.members import Member
from backdrive.tuning.scenes import Stroke
from backdrive.tuning.search import inverse
from backdrive.tuning.tuning import NAMES, Number

FAST_DECAY, SWITCH_RATE = 500.0, 10.0  # Iwatani 2017, (3.28), R_W as a rate [1/s]
DITHER_FREQUENCY = 15.0  # Sec. 3.5.1 [Hz]


def dither_frequency(facts: Facts, z: Numbers) -> float:
    """Return a frequency of dither: 15 Hz, or lower if the motor's resonance or the sampling rate requires it [Hz]."""
    motor = facts.motor_share * facts.inertia_interval[1]
    K = facts.stiffness_interval[0] - z["share"] * z["stiffness"] * facts.stiffness
    resonance = float(np.sqrt(max(K, 1e-3 * facts.stiffness) / motor)) / (2.0 * np.pi)
    return min(DITHER_FREQUENCY, 0.25 * resonance, 0.05 / facts.interval)


def dither_bound(facts: Facts, member: Member, z: Numbers, sine: Dither) -> float:
    """Return the allowed oscillation of the motor under dither: twice its linear response with the load stuck, plus 1 count
    [rad or m].

    Args:
        facts: of the joint.
        member: a joint within its uncertainty.
        z: share, stiffness by K_c, decay.
        sine: the dither.
    """
    motor = member.motor_share * member.inertia
    gain = z["share"] * z["stiffness"] * facts.stiffness
    sway = rules.dither_sway(
        sine.share * facts.coulomb,
        sine.frequency,
        motor,
        2.0 * member.damping * float(np.sqrt(member.transmission * motor)),
        member.stiffness,
        gain,
        z["decay"],
        member.delay + 0.5 * facts.interval,
    )
    return 2.0 * sway + facts.count


def presliding_radius(facts: Facts, member: Member, z: Numbers) -> float:
    """Return the spectral radius of a joint's presliding with a compensator: `rules.spectral_radius`.

    Args:
        facts: of the joint.
        member: a joint within its uncertainty.
        z: share, stiffness by K_c, decay.
    """
    M = member.motor_share * member.inertia
    L = member.inertia - M
    springs = [
        (K, 2.0 * member.damping * float(np.sqrt(K * mass)))
        for K, mass in ((member.transmission, M), (member.bristle, L))
    ]
    gain = z["share"] * z["stiffness"] * facts.stiffness
    return rules.spectral_radius(M, L, springs[0], springs[1], gain, z["decay"], member.delay, facts.interval)


def origin(z: Numbers, searched: Numbers | None, name: str, aim: str) -> str:
    """Return a sentence on how a number was found.

    Args:
        z: the chosen numbers.
        searched: result of the search; None for the fixed rule.
        name: of the number.
        aim: of the search.
    """
    if searched is None:
        return (
            "From the fixed rule (R = 0.8, K = 0.72 K_c, alpha = 20 1/s). It passes the same test as the result of the "
            "search and has a better score."
        )
    found = f"By search for {aim} that passes the test."
    if z[name] == searched[name]:
        return found
    kind = f"from {searched[name]:.3g} to {z[name]:.3g}" if name in ("share", "decay") else ""
    kind = kind or f"by a factor of {z[name] / searched[name]:.3g}"
    return f"{found[:-1]}, then moved {kind} until every drawn joint and the ends of all intervals pass it."


#: The numbers of a search in words.
IN_WORDS = {
    "share": "The share of friction R",
    "stiffness": "The compensator's stiffness K relative to the joint's, K/K_c,",
    "decay": "The decay alpha_N [1/s]",
    "gain": "The filter gain G",
    "second_gain": "The second filter gain G",
    "mass": "The virtual inertia m relative to the joint's",
    "viscosity": "The virtual viscosity b relative to m [1/s]",
}
AT_EDGE = 0.01  # share of a range within which a number counts as lying at its end [-]


def edges(goal: Goal, z: Numbers) -> list[str]:
    """Return a sentence for each number that lies at an end of its range.

    Args:
        goal: with the ranges.
        z: the chosen numbers.
    """
    sentences = []
    u = inverse(goal.ranges, {name: z[name] for name in goal.ranges})
    for (name, (low, high)), x in zip(goal.ranges.items(), u, strict=True):
        if AT_EDGE < x < 1.0 - AT_EDGE:
            continue
        end = "lower" if x <= AT_EDGE else "upper"
        sentences.append(
            f"{IN_WORDS[name]} lies at the {end} end of its range, {low:.3g} to {high:.3g}, with {z[name]:.3g}. Values beyond "
            f"were not tried: the range and not the score determines this number."
        )
    return sentences


def numbers_of(
    facts: Facts, z: Numbers, sine: Dither | None, stroke: Stroke, goal: str, searched: Numbers | None = None
) -> dict[str, Number]:
    """Return all parameters of a goal, each with its reason and its bound.

    Args:
        facts: of the joint.
        z: result of the search.
        sine: the dither, or None.
        stroke: of the hand.
        goal: by name.
        searched: result of the search; None for the fixed rule.
    """
    rad = facts.unit == "rad"
    force, spring = ("N.m", "N.m/rad") if rad else ("N", "N/m")
    mass, viscosity = ("kg.m^2", "N.m.s/rad") if rad else ("kg", "N.s/m")
    T, F, K_low = facts.interval, facts.coulomb, facts.stiffness_interval[0]
    z = {"share": 1.0, **z}  # an estimate alone has none
    K, alpha, R = z["stiffness"] * facts.stiffness, z["decay"], z["share"]
    motor = facts.motor_share * facts.inertia
    damping = 2.0 * facts.damping[0] * float(np.sqrt(K_low * motor))
    held = rules.routh(motor, damping, K_low, R * K, alpha) > 0.0
    radius = max(presliding_radius(facts, m, z) for m in members_.corners(facts))
    fast = max(alpha, min(FAST_DECAY, 0.5 / T))
    V_W = between_counts(max(3.0 * facts.count / T, rules.threshold_speed(F, K, fast)), facts.count, T)
    gains = {**filter_gains(stroke), **z}
    led = {
        "mass": max(
            0.5, 2.0 * T * admittance(facts, {"mass": 1.0, "viscosity": 1.0}).derivative / facts.inertia
        )
    }
    led |= {"viscosity": 15.0, **z}
    control = admittance(facts, led)
    least = T * control.derivative
    peak = 5.77 * stroke.length / stroke.duration**2
    aims = {
        "backdrive": "the best feel of the joint",
        "track": "the least error of a soft position controller",
        "estimate": "the least error of the external force",
        "admit": "the least mean peak force of the hand",
    }
    largest_R = rules.largest_share(1.0 - facts.friction[0])
    cycle = rules.limit_cycle(F * facts.friction[0], K_low, R / facts.friction[0])
    stuck = rules.sticking_dither(R, K, K_low)
    creep = rules.creep_speed(F, K, alpha, R)
    quantum = rules.quantum(K, facts.count, alpha, T)
    dithering = 0.0 if sine is None else sine.share
    frequency = dither_frequency(facts, z) if sine is None else sine.frequency
    loops = goal in ("backdrive", "track")

    def why(name: str) -> str:
        first = goal == "admit" and name in ("stiffness", "decay")  # the estimator is searched for before
        return origin(z, searched, name, aims["estimate" if first else goal])

    found = {
        "share": Number(
            symbol="R",
            value=R,
            unit="-",
            reason=why("share")
            if loops
            else "The estimator subtracts R times the law: subtracting more than the real friction would drive the joint.",
            bound=f"R F stays below the least friction, R <= {largest_R:.2f}"
            + (f"; no limit cycle above r_c/(1 - R) = {cycle:.3g} {facts.unit}." if loops else "."),
            limit=largest_R,
        ),
        "stiffness": Number(
            symbol="K",
            value=K,
            unit=spring,
            reason=f"{why('stiffness')} It is {K / facts.stiffness:.2f} of K_c.",
            bound=f"It slides after the joint, F/K >= F_c/K_c, and one count changes the torque by {quantum:.2g} {force} of "
            f"{F:.3g}: K <= {facts.stiffest:.3g}.",
            limit=facts.stiffest,
        ),
        "decay_rate": Number(
            symbol="alpha_N",
            value=alpha,
            unit="1/s",
            reason=f"{why('decay')} The torque is gone {3000.0 / alpha:.0f} ms after a stop, and all of F is given above "
            f"{rules.threshold_speed(F, K, alpha):.2g} {facts.unit}/s.",
            bound=f"Presliding, linear, sampled and delayed, has a spectral radius of {radius:.4f} at the ends of all intervals, "
            + ("below 1: stable" if radius < 1.0 else "not below 1: only the simulated check supports it")
            + f" (Routh's test without sampling and delay says {'stable' if held else 'unstable'}). Without an external force, "
            f"the decay can cause a creep of at most {creep:.2g} {facts.unit}/s."
            if loops
            else "Its torque is not applied to the motor, so it cannot make presliding unstable.",
        ),
        "fast_decay": Number(
            symbol="alpha_H",
            value=fast,
            unit="1/s",
            reason="For algFC2: in motion the torque follows a stop at once.",
            bound=f"T alpha_H <= 0.5, else the contact lets go within two ticks; below {rules.threshold_speed(F, K, fast):.2g} "
            f"{facts.unit}/s it gives less than F.",
            limit=0.5 / T,
        ),
        "switch_rate": Number(
            symbol="r_W",
            value=SWITCH_RATE,
            unit="1/s",
            reason=f"The rate of (3.28): from alpha_N to alpha_H in 0.1 s; R_W = {SWITCH_RATE * T:g} a tick.",
            bound="Slower than one dither period, so that dither does not switch it.",
        ),
        "threshold": Number(
            symbol="V_W",
            value=V_W,
            unit=f"{facts.unit}/s",
            reason="Half a count above the larger of 3 counts a tick and alpha_H F/K, from where algFC2 still gives all of F.",
            bound="3 counts a tick or more: below it the velocity is the encoder's noise.",
            limit=3.0 * facts.count / T,
        ),
        "dither_share": Number(
            symbol="R_d",
            value=dithering,
            unit="-",
            reason=f"It reduces the break-away torque of {F:.3g} {force} by about that share."
            if dithering
            else "None: not requested, not safe, or no compensation in the loop.",
            bound=f"The load stays stuck: R_d < 1 - R K/K_c = {stuck:.2f} at the lower end of K_c; "
            + (
                f"no cycle above r_c/(1 - R - R_d), R + R_d = {R + dithering:.2f} < {largest_R:.2f}."
                if R + dithering < largest_R
                else "R + R_d exceeds the least friction, so only the simulated check supports it."
            ),
            limit=stuck,
        ),
        "dither_frequency": Number(
            symbol="Omega_d/(2 pi)",
            value=frequency,
            unit="Hz",
            reason="15 Hz as in the thesis, above the frequencies of a hand; lower if a resonance is near.",
            bound="At most a quarter of the stuck motor's resonance on the lower end of K_c less R K, and 20 samples a period.",
        ),
        "filter_gain": Number(
            symbol="G",
            value=gains["gain"],
            unit=f"{facts.unit}/s^2",
            reason=why("gain") if "gain" in z else "35 times the stroke's largest acceleration.",
            bound=f"H G stays above that acceleration, {peak:.3g}: the filter can follow.",
            limit=peak,
        ),
        "second_filter_gain": Number(
            symbol="G of the velocity",
            value=gains["second_gain"],
            unit=f"{facts.unit}/s^3",
            reason=why("second_gain") if "second_gain" in z else "Twice the stroke's largest jerk.",
            bound="H G stays above that jerk.",
            limit=60.0 * stroke.length / stroke.duration**3,
        ),
        "filter_ratio": Number(
            symbol="H",
            value=2.0,
            unit="-",
            reason="The thesis' value: no overshoot of a step for any H > 1.",
            bound="H > 1.",
            limit=1.0,
        ),
        "admittance_inertia": Number(
            symbol="m",
            value=control.inertia,
            unit=mass,
            reason=why("mass")
            if "mass" in z
            else "Half the joint's own inertia, or the bound if that is larger.",
            bound=f"m >= T K_d = {least:.3g} {mass}, below which the loop, which uses the torque of the previous tick, would ring.",
            limit=least,
        ),
        "admittance_viscosity": Number(
            symbol="b",
            value=control.viscosity,
            unit=viscosity,
            reason=why("viscosity") if "mass" in z else "15/s of m, the thesis' ratio.",
            bound="b > 0: the virtual mass slows down. The check shows that the joint comes to rest.",
            limit=0.0,
        ),
        "position_gain": Number(
            symbol="K_p",
            value=control.proportional,
            unit=spring,
            reason="From K_d, for a damping ratio of 0.7.",
        ),
        "velocity_gain": Number(
            symbol="K_d",
            value=control.derivative,
            unit=viscosity,
            reason="The largest gain that is stable for the motor side alone with sampling and delay.",
            bound="K_d (T + T_d) <= 0.4 M.",
            limit=0.4 * facts.motor_share * facts.inertia_interval[0] / (T + facts.delay),
        ),
    }
    return {name: found[name] for name in NAMES[goal]}
