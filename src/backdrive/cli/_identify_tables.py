"""What `backdrive identify` prints: a table of joints, after a search also the laws that were tried and their numbers."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from backdrive.cli._output import console as new_console
from backdrive.cli._output import print_json

if TYPE_CHECKING:
    from backdrive.identification import Identification
    from backdrive.identification.dynamic.choice import Choice
    from backdrive.model import JointFriction


def show_json(result: Identification, written: list[str], bad: list[str]) -> None:
    """Print the result as one JSON document.

    Args:
        result: of the identification.
        written: paths of the files.
        bad: joints below the quality gate.
    """
    from backdrive.model.file import encode

    print_json(
        {
            "ok": not bad,
            "below_gate": bad,
            "method": result.method,
            "reason": result.reason,
            "interrupted": result.stopped,
            "warnings": result.warnings,
            "notes": result.notes,
            "verdicts": {e.joint: e.verdict for e in result.evidence},
            "intervals": result.intervals,
            "choices": {c.joint: _choice(c) for c in result.choices},
            "model": json.loads(encode(result.model)),
            "written": written,
        }
    )


def _choice(choice: Choice) -> dict[str, Any]:
    return {
        "chosen": choice.chosen,
        "reason": choice.reason,
        "unit": choice.unit,
        "laws": [
            {
                "law": x.name,
                "parameters": x.parameters,
                "error_fitted": x.error,
                "error_held_out": x.held_out,
                "aic": x.aic,
                "seconds": x.seconds,
                "remark": x.remark,
            }
            for x in choice.candidates
        ],
    }


def show_tables(result: Identification, written: list[str]) -> None:
    """Print the result for a person; see `show_json` for the arguments."""
    from rich.markup import escape
    from rich.table import Table

    console = new_console()
    console.print(f"Method: {result.method} ({escape(result.reason)}).")
    for choice in result.choices:
        console.print(_laws(choice))
        console.print(escape(choice.reason))
    table = Table(box=None, pad_edge=False)
    for heading in ("joint", "law", "residual fitted", "unseen"):
        table.add_column(heading, justify="left" if heading in ("joint", "law") else "right")
    for j in result.model.joints:
        table.add_row(
            escape(j.joint.name),
            j.law.name if result.choices else j.law.rate.NAME,
            f"{j.fitted.residual:.1f} %" if j.fitted else "-",
            f"{j.held_out.residual:.1f} %" if j.held_out else "-",
        )
    console.print(table)
    for j, e in zip(result.model.joints, result.evidence):
        console.print(f"{escape(j.joint.name)}: {escape(e.verdict)}")
        if result.choices:
            console.print(_numbers(j, result.intervals.get(j.joint.name, {})))
        for warning in j.warnings:
            console.print(f"  {escape(warning)}", style="yellow")
    for warning in result.warnings:
        console.print(escape(warning), style="yellow")
    for note in result.notes:
        console.print(escape(note), style="dim")
    for path in written:
        console.print(f"Wrote {escape(path)}")


def _laws(choice: Choice) -> Any:
    """Return the laws that were tried as a table, the chosen one in bold."""
    from rich.markup import escape
    from rich.table import Table

    unit = choice.unit
    table = Table(box=None, pad_edge=False, title=escape(choice.joint), title_justify="left")
    table.add_column("law", no_wrap=True)
    for heading in ("numbers", f"fitted [{unit}]", f"unseen [{unit}]", "AIC", "s"):
        table.add_column(heading.replace("[", r"\["), justify="right")
    table.add_column("remark")
    for c in choice.candidates:
        style = "bold" if c.name == choice.chosen else None
        table.add_row(
            c.name,
            str(c.parameters or "-"),
            f"{c.error:.3g}",
            f"{c.held_out:.3g}",
            f"{c.aic:.0f}",
            f"{c.seconds:.1f}",
            escape(c.remark),
            style=style,
        )
    return table


def _numbers(friction: JointFriction, intervals: Any) -> Any:
    """Return every number of a law with its interval as a table."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for heading in ("number", "value", "standard error", "95 % interval", "unit"):
        table.add_column(heading, justify="left" if heading in ("number", "unit") else "right")

    def add(name: str, value: float, error: float, unit: str, sought: str) -> None:
        ends = ""
        if sought in intervals and not sought.startswith("share"):
            low, high = intervals[sought]
            ends = f"{low:.4g} to {high:.4g}"
        table.add_row(name.replace("[", r"\["), f"{value:.4g}", f"{error:.2g}", ends, unit)

    for rows in friction.law.parts:
        for name, parameter in rows.PARAMETERS.items():
            value, error = getattr(rows, name), friction.standard_errors.get(name, float("nan"))
            values = value if parameter.many else (value,)
            spread = error if isinstance(error, (tuple, list)) else [error] * len(values)
            for i, (v, e) in enumerate(zip(values, spread)):
                label = f"{name}[{i}]" if parameter.many else name
                add(label, v, e, parameter.unit_for(friction.joint.unit), label)
    for name, e in friction.dynamics.items():
        add(name, e.value, e.standard_error, e.unit, name)
    return table
