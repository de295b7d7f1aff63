"""`backdrive estimate --payload`: its options, checks and output."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from backdrive.cli._logs import numbers
from backdrive.cli._output import console as new_console
from backdrive.cli._output import print_json, print_lines, table
from backdrive.errors import InvalidInput

if TYPE_CHECKING:
    from backdrive.external.payload import PayloadEstimate


def check_options(payload: bool, urdf: Any, own: Mapping[str, Any], others: Mapping[str, Any]) -> None:
    """Refuse options of a payload without --payload, and others with it.

    Args:
        payload: whether --payload was given.
        urdf: the robot description.
        own: values of the options that need --payload, by name; None where they were not given.
        others: values of the options that --payload excludes.

    Raises:
        InvalidInput: names the option.
    """
    wrong = [
        name
        for name, value in (others if payload else own).items()
        if not (value is None or value is False or value == [])
    ]
    if wrong:
        raise InvalidInput(
            f"{wrong[0]} {'does not go with' if payload else 'goes with'} --payload.",
            remedy=f"Leave {wrong[0]} out." if payload else "Add --payload.",
        )
    if payload and urdf is None:
        raise InvalidInput(
            "A payload needs the robot's description.",
            remedy="Pass the --urdf that the model was identified with.",
        )


def center_from(text: str | None) -> list[float] | None:
    """Return what --at says [m], (3,), or None.

    Raises:
        InvalidInput: it is not three numbers.
    """
    place = numbers(text, "--at")
    if text is not None and (place is None or len(place) != 3):
        raise InvalidInput(
            f"--at {text}: not three numbers.", remedy="Give x,y,z in the frame [m]: 0,0,0.05."
        )
    return place


def print_payload(payload: PayloadEstimate, remarks: list[str], as_json: bool) -> None:
    """Print what an arm carries, and the remarks."""
    remarks = [*remarks, *payload.remarks]
    if as_json:
        print_json({"ok": True, "payload": document(payload), "warnings": remarks})
        return
    console = new_console()
    rows = table(f"payload at {payload.frame}", "value", "95 %", text=(f"payload at {payload.frame}",))
    if payload.mass_error > 0.0:
        low, high = payload.mass_interval
        rows.add_row("mass", f"{payload.mass:.4g} kg", f"{low:.4g} to {high:.4g} kg")
    else:
        rows.add_row("mass", f"{payload.mass:.4g} kg", "as given")
    for axis, value, low, high in zip("xyz", payload.center, *payload.center_interval(), strict=False):
        rows.add_row(f"center, {axis}", f"{1e3 * value:.1f} mm", f"{1e3 * low:.1f} to {1e3 * high:.1f} mm")
    if payload.inertia is not None and payload.inertia_error is not None:
        for i, axis in enumerate("xyz"):
            value, half = payload.inertia[i, i], 1.96 * payload.inertia_error[i, i]
            rows.add_row(
                f"inertia, {axis}{axis}",
                f"{value:.3g} kg.m^2",
                f"{value - half:.3g} to {value + half:.3g} kg.m^2",
            )
    for name, gain in payload.gains.by_joint.items():
        what = "gain" if payload.gains.kind == "absolute" else "gain ratio"
        half = 1.96 * gain.error
        rows.add_row(
            f"{what} of {name}", f"{gain.value:.3f}", f"{gain.value - half:.3f} to {gain.value + half:.3f}"
        )
    console.print(rows)
    print_lines(console, remarks, style="yellow")


def document(payload: PayloadEstimate) -> dict[str, Any]:
    """Return the results for a payload, in SI units."""
    return payload.to_dict()
