"""Plausibility rules on the numbers of a law: break-away against Coulomb friction, and numbers smaller than their errors."""

from __future__ import annotations

import math

import numpy as np

from backdrive.identification.remark import EARLY, SHARE, SURE, Case, Remark
from backdrive.laws.direction import ByDirection

SLIGHT = 0.01  # least difference of break-away and Coulomb friction with a remark if it is significant, relative to the latter [-]
LEVELS = ("coulomb", "coulomb_positive", "coulomb_negative", "breakaway")


def break_away(case: Case) -> Remark | None:
    """Remark on break-away below Coulomb friction: far below is impossible, slightly below means that it was not measured."""
    rate = case.friction.law.rate
    ways = (rate.forward, rate.backward) if isinstance(rate, ByDirection) else (rate,)
    levels = [(getattr(way, "breakaway", math.nan), getattr(way, "coulomb", math.nan)) for way in ways]
    rest, slide = min(levels, key=lambda pair: pair[0] / pair[1] if pair[1] > 0.0 else math.inf)
    errors = [case.friction.standard_errors.get(name, math.nan) for name in ("breakaway", "coulomb")]
    sure = slide - rest > SURE * math.hypot(*errors)
    if not rest < slide * (1.0 - (SLIGHT if sure else SHARE)):
        return None
    sentence = f"Break-away friction ({rest:.4g} {case.unit}) lies below Coulomb friction ({slide:.4g} {case.unit}): "
    if rest < EARLY * slide:
        return Remark(
            severity="care",
            sentence=sentence
            + "this is physically impossible. The law was fitted to the zero crossing, or the motion does not show "
            "its peak: choose another law (--law coulomb-viscous), or add slow motion.",
        )
    return Remark(severity="note", sentence=sentence + "slow motion did not show it.")


def vague_level(case: Case) -> Remark | None:
    """Remark on a level of friction that is no larger than its standard error."""
    law, errors = case.friction.law.rate.values(), case.friction.standard_errors
    vague = [
        f"{name} {law[name]:.3g} ± {errors[name]:.2g} {case.unit}"
        for name in LEVELS
        if name in law and abs(law[name]) < errors.get(name, 0.0) and errors[name] > SHARE * _size(case)
    ]
    if not vague:
        return None
    return Remark(
        severity="care",
        sentence=f"The motion does not determine {', '.join(vague)}: the value is no larger than its error. The curve may be right "
        "at the speeds of the motion; use a law with fewer numbers (--law coulomb-viscous).",
    )


def controller_step(case: Case) -> Remark | None:
    """Remark on viscous friction and inertia that depend on how often the drive's controller acts, which no log tells."""
    if case.evidence.controller_step is None:
        return None
    step, damping, mass = case.evidence.controller_step
    curve, unit = case.evidence.curve, case.friction.joint.unit
    top = int(np.argmax(np.abs(curve.velocity)))
    speed, friction = abs(float(curve.velocity[top])), abs(float(curve.torque[top]))
    inertia, error = case.value("inertia")
    viscous = [abs(v) for name, v in case.friction.law.rate.values().items() if name.startswith("viscous")]
    damping = min(damping, max(viscous, default=damping))
    less, parts, much = damping * speed, [], False
    if friction > 0.0 and less > max(SLIGHT * friction, np.nan_to_num(curve.standard_error[top])):
        parts.append(
            f"viscous friction by up to {damping:.3g} {case.unit}.s/{unit} ({100.0 * less / friction:.2g} % of the friction at "
            f"{speed:.3g} {unit}/s)"
        )
        much = less > SHARE * friction or damping > SHARE * max(viscous, default=math.inf)
    if inertia > 0.0 and mass > max(SLIGHT * inertia, np.nan_to_num(error)):
        parts.append(
            f"inertia by up to {mass:.3g} {'kg.m^2' if unit == 'rad' else 'kg'} ({100.0 * mass / inertia:.2g} %)"
        )
        much = much or mass > SHARE * inertia
    if not parts:
        return None
    return Remark(
        severity="care" if much else "note",
        sentence=f"The controller of the drive acts every {1e3 * step:.3g} ms here. If it acts more often, it damps more, and "
        f"there is less {' and '.join(parts)}. Give its period (--step SECONDS).",
    )


def _size(case: Case) -> float:
    """Return the mean magnitude of the friction [N.m or N]; NaN if it is not known."""
    return math.nan if case.residual is None else case.residual.size
