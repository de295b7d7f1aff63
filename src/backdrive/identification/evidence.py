"""The evidence for one joint in a report: thinned samples, the curve with its band, and a verdict in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from backdrive.identification.bands import bands_of, long_run_of
from backdrive.identification.delay import in_step
from backdrive.identification.dynamics import rest_and_total
from backdrive.identification.quality import grade
from backdrive.identification.residual import Part, residual_of
from backdrive.identification.result import Curve, JointEvidence, Samples
from backdrive.identification.signals import Signals
from backdrive.laws import Polyline
from backdrive.model import JointFriction

MOST = 4000  # largest number of samples for pictures
SURE = 5.0  # least significance of a constant beside friction that is mentioned [standard error]
ALIKE = 0.02  # largest difference of directions that is not told, relative to friction at top speed [-]
SEEN = 0.05  # least speed of a direction that is stated, relative to the other's [-]


def sentences(*table: tuple[Any, str]) -> tuple[str, ...]:
    """Return the sentences whose conditions are true."""
    return tuple(sentence for applies, sentence in table if applies)


def parts_of(friction: JointFriction, stretches: Iterable[Signals], fitted: bool) -> list[Part]:
    """Return stretches, `in_step`, with measured friction and predicted torque, as arguments of `evidence`."""
    torques = [(s, *rest_and_total(friction, s)) for s in stretches]
    return [(in_step(s, friction.delay), s.torque - rest, total, fitted) for s, rest, total in torques]


def evidence(
    friction: JointFriction,
    parts: Sequence[Part],
    standard_error: Callable[[np.ndarray], np.ndarray],
    presliding: np.ndarray | None = None,
    settled: Sequence[np.ndarray] = (),
) -> JointEvidence:
    """Collect a joint's evidence.

    Args:
        friction: the result.
        parts: signals, measured friction, predicted torque [N.m or N] and whether they were fitted, from `parts_of`.
        standard_error: of the curve at velocities.
        presliding: displacement and torque of a ramp, (n, 2).
        settled: where friction no longer builds up, a mask for each of the first parts, (n,) each.
    """
    stride = max(1, -(-sum(part[0].time.size for part in parts) // MOST))
    columns = []
    for s, measured, predicted, fitted in parts:
        position = np.full(s.time.size, np.nan) if s.position is None else s.position
        series = s.time, position, s.velocity, s.torque, measured, predicted, np.full(s.time.size, fitted)
        columns.append([x[::stride] for x in series])
    names, rate = [f.name for f in fields(Samples)], friction.law.rate
    samples = Samples(
        **{name: np.concatenate(each) for name, each in zip(names, zip(*columns, strict=True), strict=True)}
    )
    return JointEvidence(
        joint=friction.joint.name,
        samples=samples,
        curve=curve(friction, standard_error),
        verdict=verdict(friction),
        presliding=presliding,
        bands=bands_of(parts),
        long_run=long_run_of(parts),
        residual=residual_of(parts, settled, knots=rate.velocity if isinstance(rate, Polyline) else ()),
    )


def curve(
    friction: JointFriction, standard_error: Callable[[np.ndarray], np.ndarray], points: int = 121
) -> Curve:
    """Return the friction curve over the validity range, without zero velocity, at which it jumps.

    The points include the slowest speed of sliding, below which the standard error jumps.
    """
    low, high = friction.validity.velocity
    top = max(abs(low), abs(high))
    one = top * np.linspace(0.0, 1.0, points) ** 2
    one[0] = 1e-6 * top
    one = np.union1d(one, [speed for speed in friction.validity.speeds if one[0] < speed <= top])
    velocity = np.concatenate([-one[::-1][one[::-1] <= -low], one[one <= high]])
    return Curve(
        velocity=velocity, torque=friction.law.torque(velocity), standard_error=standard_error(velocity)
    )


def verdict(friction: JointFriction) -> str:
    """Return the result in one or two sentences."""
    slowest, top = friction.speeds
    ways = {way: speeds[1] for way, speeds in friction.speeds_by_way.items() if speeds[1] > SEEN * top}
    return f"{amount_of(friction, slowest, ways)} {describe_fit(friction)}"


def amount_of(friction: JointFriction, slowest: float, tops: Mapping[float, float]) -> str:
    """Return a sentence on how large friction is at two speeds, by direction where the directions differ.

    Args:
        friction: the result.
        slowest: the first speed [rad/s or m/s].
        tops: direction, 1 and -1 or one of them -> the second speed in it [rad/s or m/s].
    """
    unit, speed = friction.joint.torque_unit, f"{friction.joint.unit}/s"
    signs, fastest = np.array([*tops, *tops.values()]).reshape(2, -1)
    slow, fast = (signs * friction.law.torque(v * signs) for v in (slowest, fastest))
    least = ALIKE * float(np.abs(fast).max())

    def words_of(torque: np.ndarray, known: bool = False) -> str:
        if torque.size == 1 or np.ptp(torque) <= least:
            return f"{torque[0]:.3g} {unit}"
        if known:  # which direction comes first
            return f"{torque[0]:.3g} and {torque[1]:.3g} {unit}"
        return f"{torque[0]:.3g} {unit} along +q and {torque[1]:.3g} {unit} along -q"

    first, at = words_of(slow), " and ".join(dict.fromkeys(f"{v:.3g}" for v in fastest.tolist()))
    second = words_of(fast, known=" and " in first)
    between = "," if " and " in first + second else " and"
    return f"Friction is {first} at {slowest:.3g} {speed}{between} {second} at {at} {speed}."


def constant_beside(friction: JointFriction, share: float) -> str:
    """Return a sentence on the constant torque beside a curve that is the same in both directions; empty if it is small.

    Half of what friction differs by between the directions is part of such a constant.

    Args:
        friction: the result.
        share: of the friction at the top speed, from which on the constant is mentioned [-].
    """
    offset, top = friction.dynamics.get("offset"), friction.speeds[1]
    if offset is None:
        return ""
    level = float(np.mean(np.abs(friction.law.torque(np.array([top, -top])))))
    if not abs(offset.value) > share * level or abs(offset.value) <= SURE * offset.standard_error:
        return ""
    return (
        f"A constant {offset.value:.3g} {friction.joint.torque_unit} was separated from friction: gravity, an offset of the "
        "torque signal or unequal directions."
    )


def describe_fit(friction: JointFriction) -> str:
    """Return a sentence with the part of the torque that the model explains, and the grade."""
    quality = friction.held_out or friction.fitted
    residual = quality.residual if quality else float("nan")
    of = "the drive's " if friction.method.endswith("drive's input") else ""
    what = f"{of}torque that was held out" if friction.held_out else f"{of or 'the '}torque it was fitted to"
    return f"The model explains all but {residual:.1f} % of {what}: {grade(friction).word}."


def without_errors(friction: JointFriction) -> JointFriction:
    """Return a result without standard errors, except that of the delay."""
    dynamics = {
        name: e if name == "time_slip" else replace(e, standard_error=math.nan)
        for name, e in friction.dynamics.items()
    }
    return replace(friction, standard_errors={}, covariance=None, dynamics=dynamics)
