"""What a report shows of one joint: thinned samples, the curve with its band, and a verdict in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from backdrive.identification.bands import bands_of, long_run_of
from backdrive.identification.grade import grade
from backdrive.identification.result import Curve, JointEvidence, Samples
from backdrive.identification.signals import Signals
from backdrive.model import JointFriction

MOST = 4000  # samples kept for pictures


def evidence(
    friction: JointFriction,
    parts: Sequence[tuple[Signals, np.ndarray, np.ndarray, bool]],
    standard_error: Callable[[np.ndarray], np.ndarray],
    presliding: np.ndarray | None = None,
) -> JointEvidence:
    """Collect a joint's evidence.

    Args:
        friction: the result.
        parts: signals, measured friction, predicted torque [N.m or N] and whether the fit saw them.
        standard_error: of the curve at velocities.
        presliding: displacement and torque of a ramp, (n, 2).
    """
    total = sum(s.time.size for s, *_ in parts)
    stride = max(1, -(-total // MOST))
    take = slice(None, None, stride)

    def join(pick) -> np.ndarray:
        return np.concatenate([pick(*part)[take] for part in parts])

    def position(s, *_):
        return np.full(s.time.size, np.nan) if s.position is None else s.position

    samples = Samples(
        time=join(lambda s, f, p, seen: s.time),
        position=join(position),
        velocity=join(lambda s, f, p, seen: s.velocity),
        torque=join(lambda s, f, p, seen: s.torque),
        friction=join(lambda s, f, p, seen: f),
        predicted=join(lambda s, f, p, seen: p),
        fitted=join(lambda s, f, p, seen: np.full(s.time.size, seen)),
    )
    return JointEvidence(
        joint=friction.joint.name,
        samples=samples,
        curve=curve(friction, standard_error),
        verdict=verdict(friction),
        presliding=presliding,
        bands=bands_of(parts),
        long_run=long_run_of(parts),
    )


def curve(
    friction: JointFriction, standard_error: Callable[[np.ndarray], np.ndarray], points: int = 121
) -> Curve:
    """Return the friction curve over the validity range; zero velocity is left out, where it jumps."""
    low, high = friction.validity.velocity
    top = max(abs(low), abs(high))
    one = top * np.linspace(0.0, 1.0, points) ** 2
    one[0] = 1e-6 * top
    velocity = np.concatenate([-one[::-1][one[::-1] <= -low], one[one <= high]])
    return Curve(
        velocity=velocity, torque=friction.law.torque(velocity), standard_error=standard_error(velocity)
    )


def verdict(friction: JointFriction) -> str:
    """Say the result in a sentence or two."""
    unit = friction.joint.torque_unit
    speed = f"{friction.joint.unit}/s"
    low, high = friction.validity.velocity
    top = max(abs(low), abs(high))
    ways = [sign for sign in (1.0, -1.0) if sign * (high if sign > 0 else low) > 0.05 * top]
    slowest = 0.02 * top
    slow, fast = (np.abs(friction.law.torque(speed * np.array(ways))) for speed in (slowest, top))
    if slow.size == 2 and max(np.ptp(slow), np.ptp(fast)) > 0.02 * fast.max():
        amount = (
            f"Friction is {slow[0]:.3g} {unit} forwards and {slow[1]:.3g} {unit} backwards at {slowest:.2g} {speed}, "
            f"{fast[0]:.3g} and {fast[1]:.3g} {unit} at {top:.3g} {speed}."
        )
    else:
        amount = f"Friction is {slow[0]:.3g} {unit} at {slowest:.2g} {speed} and {fast[0]:.3g} {unit} at {top:.3g} {speed}."
    return f"{amount} {explained(friction)}"


def explained(friction: JointFriction) -> str:
    """Say in a sentence how much of the torque the model explains, and the grade."""
    quality = friction.held_out or friction.fitted
    residual = quality.residual if quality else float("nan")
    seen = "torque it had not seen" if friction.held_out else "the torque it was fitted to"
    return f"The model explains all but {residual:.1f} % of {seen}: {grade(friction).word}."
