"""Sentences on parameters that a motion does not determine: the reason, and a motion that would determine them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from backdrive.laws.direction import plain as without_direction

#: Parameter -> (what the motion lacks, motion that would determine the parameter).
REASONS: dict[str, tuple[str, str]] = {
    "stiffness": (
        "the motion has no reversal that is slow enough, and sampled finely enough, to show presliding",
        "reverse slowly within the presliding distance, with many encoder counts in it",
    ),
    "share": (
        "the motion does not stop at different depths of presliding",
        "add small loops of shrinking amplitude",
    ),
    "damping": (
        "the motion holds no reversal slow enough to see the bristle's damping (sigma_1)",
        "add fast small vibration within the presliding distance",
    ),
    "damping_time": (
        "the motion holds no fast presliding, where the springs' damping would show",
        "add fast small vibration within the presliding distance",
    ),
    "fading": (
        "the joint never reverses at speeds around v_d",
        "reverse at several speeds",
    ),
    "elastic": (
        "no load below break-away was held or repeated, so that elastic and sliding deflection look alike",
        "add small loops below break-away",
    ),
    "decay_rate": ("the joint never rests under load", "add dwells after a motion"),
    "distance": ("no reversal shows how friction turns round", "reverse slowly"),
    "ratio": ("the peak at break-away is not resolved", "reverse slowly, sampled finely"),
    "overshoot": ("no reversal shows a peak at break-away", "reverse slowly, sampled finely"),
    "excess": ("the joint never breaks away slowly", "break away slowly from rest, again and again"),
    "attraction": (
        "the speed never varies quickly enough in sliding for friction to lag",
        "vary the speed at 1 to 20 Hz without reversing",
    ),
    "lag": (
        "the speed never varies quickly enough in sliding for friction to lag",
        "vary the speed at 1 to 20 Hz without reversing",
    ),
    "sharpness": ("presliding is not resolved where sliding sets in", "break away slowly, sampled finely"),
    "margin": ("presliding is not resolved where sliding sets in", "break away slowly, sampled finely"),
    "reversal": ("the first moments after a reversal are not resolved", "reverse slowly, sampled finely"),
    "threshold": ("the joint is never slower than the dead zone", "add very slow motion"),
    "breakaway": ("no motion is slow enough to see break-away", "add very slow motion"),
    "stribeck": ("no motion is slow enough to see break-away", "add very slow motion"),
    "stribeck_velocity": (
        "no motion passes the Stribeck velocity slowly enough, or friction falls too little there",
        "add motion between a hundredth and a tenth of the top speed",
    ),
    "exponent": ("too few speeds tell the curve's bend", "sweep the speed"),
    "viscous": ("the speeds are too small or too alike for a slope", "add fast motion"),
    "growth": ("the speeds are too small or too alike for a slope", "add fast motion"),
    "rise": ("no motion is slow enough to see friction rise from rest", "add very slow motion"),
    "fall": ("no motion is slow enough to see the Stribeck fall", "add slow motion"),
    "steepness": ("no motion is slow enough to see friction rise from rest", "add very slow motion"),
    "load": ("the load hardly varies", "record under several loads, lifting and lowering"),
    "quadratic": ("the load hardly varies", "record under several loads, lifting and lowering"),
    "driving": ("no slow motion lifts a load", "lift a load slowly, from rest"),
    "driven": ("no slow motion lowers a load", "lower a load slowly, from rest"),
    "positive": ("no speed near this knot was driven along +q", "sweep the speed"),
    "negative": ("no speed near this knot was driven along -q", "sweep the speed"),
    "temperature": ("the temperature hardly varies", "record cold and warm"),
    "thinning": ("the temperature hardly varies", "record cold and warm"),
    "inertia": ("the joint hardly accelerates", "add fast motion"),
    "gravity": ("the positions hardly differ", "move through a wide range"),
    "offset": (
        "a constant torque looks like gravity or like friction in one direction in it",
        "move in both directions, through a wide range",
    ),
    "coulomb": (
        "gravity, a constant torque and the friction of the two directions look alike in it",
        "move slowly in both directions through the same positions",
    ),
    "drive.delay": (
        "the drive's input has no change quick enough to show a delay",
        "add steps and reversals",
    ),
    "drive.gain": (
        "the drive's torque cannot be separated from inertia and friction",
        "give the inertia, or hold a known load",
    ),
    "drive.torque_constant": (
        "the drive's torque cannot be separated from inertia and friction",
        "give the inertia, or hold a known load",
    ),
    "drive.resistance": (
        "speed and load hardly vary apart from each other",
        "move fast under several loads",
    ),
    "drive.supply_resistance": ("the drive hardly draws current", "add fast starts under load"),
    "drive.saturation": ("the drive hardly draws current", "add fast starts under load"),
    "drive.proportional_factor": ("the controller's error hardly acts", "add steps of its input"),
    "delay": ("the torque has no change quick enough to show a delay", "add reversals"),
}


def alike(ties: Mapping[str, str]) -> str:
    """Return a sentence on parameters that were taken to equal others."""
    pairs = " and ".join(f"'{a}' is taken to equal '{b}'" for a, b in ties.items())
    return f"{pairs}: no motion can separate a difference between the directions from a constant torque, which is in 'offset'."


def why(name: str) -> tuple[str, str]:
    """Return what the motion lacks to determine a parameter, and a motion that would determine it."""
    plain = without_direction(name.partition("[")[0])
    if plain not in REASONS and plain.startswith("drive."):
        plain = plain[6:]
    if plain in REASONS:
        return REASONS[plain]
    for part in ("temperature", "load", "quadratic", "gravity", "viscous", "coulomb", "offset"):
        if part in plain and part in REASONS:
            return REASONS[part]
    return (
        "too little in it depends on this number",
        "record a richer motion, for example of `backdrive plan`",
    )


def unseen(
    names: Sequence[str], relative: np.ndarray, correlation: np.ndarray, weak: float
) -> tuple[dict[str, str], list[str]]:
    """Return a sentence for each parameter that is not identifiable from this motion, by name and as a list.

    Args:
        names: of the parameters.
        relative: standard error divided by the value, (P,); infinite or NaN if unknown.
        correlation: between the estimates, (P, P).
        weak: relative standard error above which a parameter counts as not identifiable [-].
    """
    found = {}
    for i, name in enumerate(names):
        if relative[i] <= weak:
            continue
        lacks, shows = why(name)
        others = np.abs(np.where(np.isfinite(correlation[i]), correlation[i], 0.0))
        others[i] = 0.0
        partner = int(np.argmax(others))
        size = f"its error is {100 * relative[i]:.0f} %" if np.isfinite(relative[i]) else "it has no error"
        twin = (
            f"; it is correlated with '{names[partner]}' (correlation {correlation[i, partner]:+.2f})"
            if others[partner] > 0.9
            else ""
        )
        found[name] = (
            f"'{name}' is not identifiable from this motion ({size}{twin}): {lacks}. To see it, {shows}."
        )
    return found, list(found.values())
