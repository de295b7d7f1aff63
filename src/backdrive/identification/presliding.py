"""Identification of a joint's break-away friction and presliding stiffness from torque ramps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.evidence import MOST, curve, sentences
from backdrive.identification.ramp import Presliding, presliding
from backdrive.identification.result import JointEvidence, Samples
from backdrive.identification.terms import estimates
from backdrive.laws import CoulombViscous, Law
from backdrive.logs.log import Joint, Log
from backdrive.model import JointFriction, Validity

TRIED = 0.2  # least torque of a ramped direction, relative to the other direction [-]
BREAKS = "begins to slip (breaks away)"
NAMED = 0.03  # least torque at rest that the verdict mentions, relative to the break-away torque [-]


def identify_ramp(logs: Sequence[Log], joint: str) -> tuple[JointFriction, JointEvidence]:
    """Identify one joint's break-away friction and presliding stiffness from torque ramps.

    The law is Coulomb friction equal to the break-away torques. The stiffness is the term `presliding_stiffness` of the dynamics,
    or `presliding_stiffness_bound` if the encoder does not resolve the displacement.

    Args:
        logs: torque ramps of the same joint.
        joint: name.

    Raises:
        InvalidInput: no log, or one without torque or position.
        NotIdentifiable: the torque does not ramp while the joint sticks.
    """
    if not logs:
        raise InvalidInput("There is no log to identify from.", remedy="Pass at least one.")
    about = logs[0].select(joint).on_joint_side().joints[0]
    found = presliding(logs, joint)
    (up, up_error, up_seen), (down, down_error, down_seen) = _break_away(found, 1), _break_away(found, -1)
    seen = {"coulomb_positive": up_seen, "coulomb_negative": down_seen}
    untried = _missing_direction(found)
    if untried:  # use the friction of the ramped direction for both
        up, down = max(up, down), max(up, down)
    law = CoulombViscous(coulomb_positive=max(up, 0.0), coulomb_negative=max(down, 0.0))
    missing = [name for name in seen if not seen[name] and name != untried]
    friction = JointFriction(
        joint=about,
        law=Law(rate=law),
        standard_errors={
            "coulomb_positive": up_error,
            "coulomb_negative": down_error,
            "viscous_positive": float("nan"),
            "viscous_negative": float("nan"),
        },
        at_bound=tuple(missing),
        dynamics=estimates(_dynamics(found), about.unit),
        validity=Validity(
            velocity=(-found.slip_speed, found.slip_speed), load=(found.largest[1], found.largest[0])
        ),
        method="ramp",
        warnings=_warnings(found, about, missing, (up, up_error), (down, down_error), untried),
    )
    return friction, JointEvidence(
        joint=about.name,
        samples=_samples(logs, joint, friction, found),
        curve=curve(friction, lambda v: np.where(v > 0, up_error, down_error)),
        verdict=_verdict(friction, found, missing, untried),
        presliding=_loop(logs, joint),
    )


def _break_away(found: Presliding, direction: int) -> tuple[float, float, bool]:
    """Return the friction to overcome in a direction, its standard error, and whether the joint broke away."""
    side = 0 if direction > 0 else 1
    slipped = found.break_away[side]
    if slipped is None:
        return direction * (found.largest[side] - found.rest), float("nan"), False
    return direction * (slipped[0] - found.rest), slipped[1], True


def _missing_direction(found: Presliding) -> str:
    """Return the parameter of the direction in which the torque was not ramped; empty if both were ramped."""
    up, down = (abs(torque - found.rest) for torque in found.largest)
    if down < TRIED * up and found.break_away[1] is None:
        return "coulomb_negative"
    return "coulomb_positive" if up < TRIED * down and found.break_away[0] is None else ""


def _dynamics(found: Presliding) -> dict[str, tuple[float, float]]:
    values = {"offset": (found.rest, np.nan)}
    if found.stiffness is None:
        values["presliding_stiffness_bound"] = found.bound, np.nan
    else:
        values["presliding_stiffness"] = found.stiffness
    if found.tangent is not None:
        values["presliding_stiffness_tangent"] = found.tangent
    if np.isfinite(found.width):
        values["hysteresis_width"] = found.width, found.count / np.sqrt(6.0)
        values["hysteresis_area"] = found.area, np.nan
    return values


def _warnings(
    found: Presliding,
    joint: Joint,
    missing: Sequence[str],
    up: tuple[float, float],
    down: tuple[float, float],
    untried: str = "",
) -> tuple[str, ...]:
    unit, name = joint.torque_unit, f"Joint '{joint.name}'"
    peaks = {"coulomb_positive": ("+q", found.largest[0]), "coulomb_negative": ("-q", found.largest[1])}
    apart, least = up[0] - down[0], max(min(up[0], down[0]), 1e-300)
    ways = {name: way for name, (way, _) in peaks.items()}
    return sentences(
        (
            untried,
            f"{name}: the torque was not ramped along {ways.get(untried)}; break-away there was taken to be that of the other "
            "direction.",
        ),
        (
            not found.is_resolved,
            f"{name}: before break-away it moves by {found.displacement / found.count:.0f} counts of {found.count:.3g} "
            f"{joint.unit}, which is below the encoder's resolution: only a lower bound of the stiffness is known.",
        ),
        *(
            (
                side in missing,
                f"{name} did not break away along {way} up to {peak:.3g} {unit}: the value given is a lower bound "
                f"of its friction.",
            )
            for side, (way, peak) in peaks.items()
        ),
        (
            not missing and not untried and abs(apart) > max(4.0 * np.hypot(up[1], down[1]), NAMED * least),
            f"{name}: the break-away torques differ by {abs(apart):.3g} {unit}; a ramp cannot separate unequal "
            f"friction from a constant torque (gravity, offset of the torque signal).",
        ),
        (
            abs(found.rest) > NAMED * least,
            f"{name}: the torque of {found.rest:.3g} {unit} before the ramp was taken for gravity or offset; if "
            f"friction carried a part of it, the break-away torques of the two directions are shifted by that part.",
        ),
    )


def _verdict(friction: JointFriction, found: Presliding, missing: Sequence[str], untried: str = "") -> str:
    law, unit = friction.law.rate, friction.joint.torque_unit
    assert isinstance(law, CoulombViscous)
    per = f"{unit}/{friction.joint.unit}"
    sides = {"coulomb_positive": "+q", "coulomb_negative": "-q"}
    words = [
        f"{'more than ' if name in missing else ''}{getattr(law, name):.3g} {unit} along {side}"
        for name, side in sides.items()
        if name != untried
    ]
    if found.stiffness is None:
        return (
            f"It {BREAKS} at {' and '.join(words)}. The displacement before that is below the encoder's resolution; "
            f"the presliding stiffness is at least {found.bound:.3g} {per}."
        )
    value, error = found.stiffness
    said = (
        f"It {BREAKS} at {' and '.join(words)}. Before that it yields with {value:.4g} +- {error:.2g} {per}"
    )
    if found.tangent is not None:
        said += f" ({found.tangent[0]:.4g} at the beginning of a branch)"
    if found.width > found.count:
        said += f", with a hysteresis {found.width:.3g} {friction.joint.unit} wide"
    return said + "."


def _samples(logs: Sequence[Log], joint: str, friction: JointFriction, found: Presliding) -> Samples:
    """Return the measured samples; the law's torque is undefined where the joint sticks."""
    columns = []
    for log in logs:
        single = log.select(joint).on_joint_side()
        position, torque = single.need("position")[:, 0], single.driving_torque[:, 0]
        velocity = np.gradient(position, single.period)
        slides = np.abs(velocity) > found.slip_speed
        predicted = np.where(slides, friction.law.torque(velocity) + found.rest, np.nan)
        columns.append(np.stack([single.time, position, velocity, torque, torque - found.rest, predicted]))
    joined = np.concatenate(columns, axis=1)
    time, position, velocity, torque, of_friction, predicted = joined[
        :, :: max(1, -(-joined.shape[1] // MOST))
    ]
    return Samples(
        time=time,
        position=position,
        velocity=velocity,
        torque=torque,
        friction=of_friction,
        predicted=predicted,
        fitted=np.ones(time.size, dtype=bool),
    )


def _loop(logs: Sequence[Log], joint: str) -> np.ndarray:
    """Return displacement since the first sample and torque, thinned, (n, 2)."""
    parts = []
    for log in logs:
        single = log.select(joint).on_joint_side()
        position, torque = single.need("position")[:, 0], single.driving_torque[:, 0]
        parts.append(np.stack([position - position[0], torque], axis=1))
    joined = np.concatenate(parts)
    return joined[:: max(1, -(-len(joined) // MOST))]
