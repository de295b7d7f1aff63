"""`backdrive plan sweep --centres`: one sweep at each center, which separates friction unequal in its directions from
gravity.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from backdrive.cli._plan_request import Request
from backdrive.cli._planning import build, center_of, holds_of, refuse_beyond, single_plans
from backdrive.errors import InvalidInput
from backdrive.plans import InTurn
from backdrive.plans.centres import MOST_GAIN, MOST_SWEEPS, Separation, choose_centers, sweeps_about
from backdrive.plans.limits import JointLimits
from backdrive.plans.margins import inside


def build_centres(request: Request) -> tuple[Separation, list[Any], dict[str, JointLimits]]:
    """Return the sweeps about the centers that were asked for, checked against the limits.

    Returns:
        The sweeps; the plans to be driven, which hold the joints of --hold; the limits by joint.

    Raises:
        BackdriveError: as `build`; or the centers are too near, or the joint is linear, or several joints were named.
    """
    word = str(request.centres).strip().lower()
    chosen = word == "auto" or word.isdigit()
    if not (request.center is None and request.center_deg is None) and not chosen:
        raise InvalidInput(
            "--center and --centres both place the sweep.", remedy="Give one of them, or --centres auto."
        )
    # limits are checked about every center below, not about one that will not be used
    plan, limits = build(request, check=False)
    sweep, *more = single_plans(plan)
    if more:
        raise InvalidInput(
            "--centres plans several sweeps of one joint.",
            remedy="Name one joint with --joint; the others can be held with --hold.",
        )
    if sweep.joint in holds_of(request):
        raise InvalidInput(
            f"--centres and --hold both place joint '{sweep.joint}'.", remedy="Hold the other joints only."
        )
    if chosen:
        own = limits[sweep.joint] if request.margin is not None else inside(limits[sweep.joint], sweep.stroke)
        found = choose_centers(sweep, own, sweeps=None if word == "auto" else int(word))
        middle = 0.5 * (min(found.centers) + max(found.centers))
        center = center_of(request, limits[sweep.joint])
        if center is not None and abs(middle - center) > 1e-6:
            raise InvalidInput(
                f"--center {center:g}: the range of joint '{sweep.joint}' puts the middle of the centers at "
                f"{middle:.4g} rad.",
                remedy="Leave --center out, or give the centers: --centres -60,0,60.",
            )
    else:
        found = sweeps_about(sweep, _degrees(word))
    held = plan.held if isinstance(plan, InTurn) else ()
    plans = [InTurn((one,), held=held) if held else one for one in found.plans]
    for one in plans:
        refuse_beyond(one, limits, request, alternative=True)
    return found, plans, limits


def folders_of(found: Separation, output: Path) -> list[Path]:
    """Return a folder for every sweep, named by joint and center: `j1_at_-60deg`, `j1_at_-60deg_2`."""
    joint = re.sub(r"[^\w.-]", "_", found.plans[0].joint)[:60].lstrip(".") or "joint"
    names = [f"{joint}_at_{math.degrees(center):.4g}deg" for center in found.centers]
    before = [names[:i].count(name) for i, name in enumerate(names)]
    return [
        output / (f"{name}_{count + 1}" if count else name)
        for name, count in zip(names, before, strict=False)
    ]


def notes_of_centres(found: Separation, request: Request) -> list[str]:
    """Return a note if the noise gain stays above its target."""
    if str(request.centres).strip().lower() != "auto" or found.noise_gain <= MOST_GAIN:
        return []
    return [
        f"The noise gain stays above its target of {MOST_GAIN:g}: within this range {MOST_SWEEPS} sweeps reach "
        f"{found.noise_gain:.3g}. A wider range would help most."
    ]


def _degrees(word: str) -> list[float]:
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
    """Return the figures of the sweeps, in SI units."""
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
