"""The output of `backdrive identify`: a table of joints and, after a search, the laws tried with their parameters."""

from __future__ import annotations

import json
from dataclasses import asdict
from statistics import median
from typing import Any

from backdrive.cli._output import console as new_console
from backdrive.cli._output import print_json, print_lines, table
from backdrive.identification import Identification
from backdrive.identification.dynamic.choice import Choice
from backdrive.model import JointFriction
from backdrive.model.file import encode


def show_json(result: Identification, written: list[str], bad: list[str]) -> None:
    """Print the result as one JSON document.

    Args:
        result: of the identification.
        written: paths of the files.
        bad: joints below the quality gate.
    """
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
            "standard_errors": {
                e.joint: [asdict(p) for p in e.precision] for e in result.evidence if e.precision
            },
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
    console = new_console()
    console.print(f"Method: {result.method} ({result.reason}).")
    for choice in result.choices:
        console.print(_laws(choice))
        print_lines(console, (f"  {c.name}: {c.remark}" for c in choice.candidates if c.remark))
        console.print(choice.reason)
    rows = table("joint", "law", "residual fitted", "held out", text=("joint", "law"))
    for j in result.model.joints:
        rows.add_row(
            j.joint.name,
            j.law.name if result.choices else j.law.rate.NAME,
            f"{j.fitted.residual:.1f} %" if j.fitted else "-",
            f"{j.held_out.residual:.1f} %" if j.held_out else "-",
        )
    console.print(rows)
    for j, e in zip(result.model.joints, result.evidence, strict=False):
        console.print(f"{j.joint.name}: {e.verdict}")
        if result.choices:
            console.print(_numbers(j, result.intervals.get(j.joint.name, {})))
        print_lines(console, (f"  {warning}" for warning in j.warnings), style="yellow")
    if any(e.precision for e in result.evidence):
        console.print(
            "Standard errors: achieved (expected of the motion); for bodies, the ratio achieved / expected:"
        )
        console.print(_precision(result))
    print_lines(console, result.warnings, style="yellow")
    print_lines(console, result.notes, style="dim")
    print_lines(console, (f"Wrote {path}" for path in written))


def _precision(result: Identification) -> Any:
    """Return a table of an arm's achieved and expected standard errors; for bodies, the median of achieved / expected."""
    names = ("coulomb", "viscous", "offset", "inertia")
    rows = table("joint", "Coulomb", "viscous", "offset", "inertia", "bodies", text=("joint",))
    for e in result.evidence:
        own = {p.name: p for p in e.precision if p.name in names}
        ratios = [
            p.achieved / p.expected for p in e.precision if p.name not in names and p.achieved and p.expected
        ]
        cells = [f"{own[n].achieved:.2g} ({own[n].expected:.2g})" for n in names]
        rows.add_row(e.joint, *cells, f"{median(ratios):.2f}" if ratios else "-")
    return rows


def _laws(choice: Choice) -> Any:
    """Return the candidate laws as a table, the selected one in bold; their remarks follow below it."""
    errors = (f"fitted [{choice.unit}]", f"held out [{choice.unit}]")
    rows = table(
        "law",
        "parameters",
        *errors,
        "AIC",
        "s",
        text=("law",),
        title=f"{choice.joint}: laws, all compared on the same samples",
    )
    rows.columns[0].no_wrap = True
    for c in choice.candidates:
        rows.add_row(
            c.name,
            str(c.parameters or "-"),
            f"{c.error:.3g}",
            f"{c.held_out:.3g}",
            f"{c.aic:.0f}",
            f"{c.seconds:.1f}",
            style="bold" if c.name == choice.chosen else None,
        )
    return rows


def _numbers(friction: JointFriction, intervals: Any) -> Any:
    """Return every number of a law with its interval as a table."""
    rows = table("parameter", "value", "standard error", "95 % interval", "unit", text=("parameter", "unit"))

    def add(name: str, value: float, error: float, unit: str) -> None:
        ends = ""
        if name in intervals and not name.startswith("share"):
            ends = "{:.4g} to {:.4g}".format(*intervals[name])
        rows.add_row(name, f"{value:.4g}", f"{error:.2g}", ends, unit)

    for part in friction.law.parts:
        for name, parameter in part.PARAMETERS.items():
            value, error = getattr(part, name), friction.standard_errors.get(name, float("nan"))
            values = value if parameter.many else (value,)
            spread = error if isinstance(error, (tuple, list)) else [error] * len(values)
            for i, (v, e) in enumerate(zip(values, spread, strict=False)):
                add(f"{name}[{i}]" if parameter.many else name, v, e, parameter.unit_for(friction.joint.unit))
    for name, e in friction.dynamics.items():
        add(name, e.value, e.standard_error, e.unit)
    return rows
