"""`backdrive plan sweep --centres`: one sweep a center, so that unequal directions can be told from gravity."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from backdrive.cli._plan_request import Request
from backdrive.cli._planning import build, checked

if TYPE_CHECKING:
    from backdrive.excite.centres import Separation
    from backdrive.limits import JointLimits


def build_centres(request: Request) -> tuple[Separation, dict[str, JointLimits]]:
    """Return the sweeps about the centers that were asked for, checked against the limits, and those limits.

    Raises:
        BackdriveError: as `build`; or the centers are too near, or the joint is linear, or several joints were named.
    """
    from backdrive.errors import InvalidInput
    from backdrive.excite.centres import choose_centers, sweeps_about

    word = str(request.centres).strip()
    if request.center is not None and word != "auto" and not word.isdigit():
        raise InvalidInput(
            "--center and --centres both place the sweep.", remedy="Give one of them, or --centres auto."
        )
    # limits are checked about every center below, not about one that will not be used
    plan, limits = build(replace(request, centres=None), check=False)
    if plan.kind != "sweep":
        raise InvalidInput(
            "--centres plans several sweeps of one joint.",
            remedy="Name one joint with --joint, without others.",
        )
    own = limits[plan.joint]
    if word == "auto" or word.isdigit():
        found = choose_centers(plan, own, sweeps=None if word == "auto" else int(word))
    else:
        found = sweeps_about(plan, _degrees(word))
    for one in found.plans:
        checked(one, own, request, alternative=True)
    return found, limits


def _degrees(word: str) -> list[float]:
    from backdrive.errors import InvalidInput

    try:
        values = [math.radians(float(part)) for part in word.split(",")]
    except ValueError:
        values = []
    if len(values) < 2 or not all(map(math.isfinite, values)):
        raise InvalidInput(
            f"--centres {word}: neither `auto`, a number of sweeps, nor centers in degrees.",
            remedy="For example --centres auto, --centres 3 or --centres -60,0,60.",
        )
    return values


def figures_of_centres(found: Separation) -> dict[str, Any]:
    """Return what a person wants to know before anyone moves."""
    return {
        "centers": list(found.centers),
        "noise_gain": found.noise_gain,
        "condition": found.condition,
        "duration": found.duration,
    }


def sentence_of_centres(found: Separation) -> str:
    """Return the same in words."""
    places = ", ".join(f"{math.degrees(c):.4g}" for c in found.centers)
    return (
        f"{len(found.plans)} sweeps about {places} deg, {found.duration:.4g} s without the ways between them. Half the constant "
        f"difference of the directions will have {found.noise_gain:.3g} times the standard error of one sweep's half sum "
        f"(condition number {found.condition:.3g}). "
        "Record one log a sweep, in one posture of the other joints, and identify them together."
    )
