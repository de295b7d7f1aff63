"""What is asked of a fit, refused before anything long begins where it makes no sense, and remembered in the model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.identification.dynamic import intervals
from backdrive.identification.dynamic.search import LOSSES
from backdrive.identification.dynamic.unknowns import range_asked
from backdrive.logs.log import Drive, Log

if TYPE_CHECKING:
    from backdrive.engine import DriveModel
    from backdrive.identification.dynamic.request import Request

POSITIVE = ("inertia", "stiffness")
NOT_NEGATIVE = ("load_inertia", "damping", "load_dependence")


def refuse_nonsense(
    *,
    loss: str,
    interval: str,
    seed: int,
    cutoff: float | None,
    step: float | None,
    known: Mapping[str, float],
    bounds: Mapping[str, Any],
    drive: object,
) -> None:
    """Refuse arguments that no log could make sense of; see `fitting.fit` for them.

    Raises:
        InvalidInput: one of them makes no sense, or two contradict each other.
        UnknownName: no such loss or kind of interval.
    """
    from backdrive.engine import DriveModel

    lookup(loss, LOSSES, "loss")
    intervals.check(interval, loss)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InvalidInput(f"seed = {seed!r}.", remedy="Give a whole number, 0 or above.")
    for name, value, unit in (("cutoff", cutoff, "Hz"), ("step", step, "s")):
        if value is not None and not 0.0 < value < math.inf:
            raise InvalidInput(f"{name} = {value} {unit}.", remedy="Give a positive number, or leave it out.")
    if drive is not None and not isinstance(drive, (Drive, DriveModel)):
        raise InvalidInput(
            f"drive = {drive!r}.",
            remedy="Give Drive(law=..., gains={...}) of backdrive.logs.log, or a DriveModel of backdrive.engine.",
        )
    for name, given in bounds.items():
        plain = name.partition("[")[0]
        if plain in known:
            raise InvalidInput(
                f"'{name}' is known ({known[plain]:g}) and bounded at once.",
                remedy="Leave one of the two out: what is bounded is sought.",
            )
        low, high = range_asked(name, given[:2] if isinstance(given, (list, tuple)) else given)
        if not low < high:
            raise InvalidInput(
                f"The bounds {low:g} to {high:g} of '{name}' are no range.",
                remedy="Give a lower and a higher bound, in SI units.",
            )
    for name, value in known.items():
        number = isinstance(value, (int, float)) and math.isfinite(value)
        if not number or (name in POSITIVE and value <= 0.0) or (name in NOT_NEGATIVE and value < 0.0):
            raise InvalidInput(
                f"{name} = {value!r} is taken as known.", remedy="Give a finite SI value in its range."
            )


def drive_off(logs: Sequence[Log]) -> list[str]:
    """Say where a log has moments without a drive, which a fit through its input would take for driven ones."""
    return [
        f"{note} A fit takes the drive to be on throughout: cut those stretches out."
        for log in logs
        for note in log.notes
        if "torque_enable" in note and "off" in note
    ]


def remembered(asked: Request, **others: Any) -> dict[str, Any]:
    """Return what was asked, as plain values for a model's options.

    Args:
        asked: of every joint.
        others: beside it; what is None or empty is left out.
    """
    law = asked.law
    options: dict[str, Any] = {
        "law": law if isinstance(law, str) else list(law),
        "loss": asked.loss,
        "seed": asked.seed,
        "interval": None if asked.interval == "covariance" else asked.interval,
        "gravity": asked.gravity,
        "delay": None if asked.delay else False,
        "bounds": {n: [float(x) for x in r[:2]] for n, r in (asked.bounds or {}).items()},
        "known": {n: float(x) for n, x in asked.known.items()},
        "cutoff": asked.cutoff,
        "step": asked.step,
        "drive": None if asked.drive is None else described(asked.drive),
        **others,
    }
    return {k: v for k, v in options.items() if v is not None and v not in ({}, [])}


def described(drive: DriveModel) -> dict[str, Any]:
    """Return the numbers of a drive by name that are not the usual ones, its controller and actuator among them."""
    usual = type(drive)()
    found = {f.name: getattr(drive, f.name) for f in fields(drive)}
    always = ("controller", "actuator")
    return {n: v for n, v in found.items() if n in always or v != getattr(usual, n)}
