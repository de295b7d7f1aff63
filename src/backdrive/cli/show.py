"""`backdrive show`: a model file as tables, plot, picture or JSON.

It also prints the JSON schemas of the files that backdrive writes.
"""

from __future__ import annotations

import codecs
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, print_lines
from backdrive.cli._targets import check_targets
from backdrive.errors import InvalidInput

SPEEDS = 21  # velocities of the table in --json
SCHEMAS = ("model", "tuning")  # of our files


def command(
    model: Annotated[
        str | None,
        typer.Argument(
            metavar="MODEL.json",
            help="Model file made by `identify -o` or preset:NAME; preset: alone lists them.",
        ),
    ] = None,
    joint: Annotated[
        list[str] | None,
        typer.Option("--joint", "-j", metavar="NAME", help="Only this joint; may be repeated."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", metavar="FILE", help="Also draw the curves into FILE, ending in .svg or .png."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the model file and its evaluated curves as JSON.")
    ] = False,
    schema: Annotated[
        str | None,
        typer.Option(
            "--schema",
            metavar="model|tuning",
            help="Print the JSON schema of model or of tuning files instead.",
        ),
    ] = None,
) -> None:
    """Show a friction model: its laws with errors and bounds, its range of validity, its quality and its origin.

    Example: backdrive show model.json --joint elbow --plot elbow.png

    Example: backdrive show preset:mx106/m6

    Example: backdrive show --schema model
    """
    if schema is not None:
        _print_schema(schema)
        return
    if model is None:
        raise InvalidInput("No model is named.", remedy="Name a model file, preset:NAME, or --schema model.")
    from backdrive.model import load_model
    from backdrive.model.presets import preset_name

    if preset_name(model) == "" and plot is None and not joint:
        _print_presets(as_json)
        return
    check_targets([], _logs.files_of(model), drawn=[plot])
    loaded = load_model(model)
    shown = loaded
    if joint:
        chosen = tuple(loaded.joint(name) for name in dict.fromkeys(joint))
        rows = loaded.coupled or loaded.names if loaded.coupling else ()
        shown = replace(loaded, joints=chosen, coupled=rows)
    if plot is not None:
        from backdrive.report.pictures.curve import save_curves

        save_curves(plot, shown)
    if as_json:
        _print_json(shown, plot)
    else:
        _print_tables(shown)
        if plot is not None:
            echo(f"Wrote {plot}.")


def _print_schema(kind: str) -> None:
    from importlib.resources import files

    if kind not in SCHEMAS:
        raise InvalidInput(f"--schema is {kind!r}.", remedy=f"Give {' or '.join(SCHEMAS)}.")

    typer.echo(
        files(f"backdrive.{kind}").joinpath(f"{kind}.schema.json").read_text().rstrip()
    )  # not to be broken


def _print_presets(as_json: bool) -> None:
    from backdrive.model.presets import PREFIX, overview

    presets = list(overview())
    if as_json:
        print_json({"ok": True, "presets": presets})
        return
    width = max(len(preset["name"]) for preset in presets)
    for preset in presets:
        echo(f"{PREFIX}{preset['name']:{width}s}  {preset['title']}")


def _print_json(model, plot: Path | None) -> None:
    from backdrive.model.file import encode
    from backdrive.report.pictures.model_curve import error_of

    curves = {}
    for friction, (name, curve) in zip(model.joints, model.table(SPEEDS).items(), strict=False):
        curves[name] = {
            "velocity": curve["velocity"],
            "velocity_unit": f"{friction.joint.unit}/s",
            "torque": curve["torque"],
            "torque_unit": friction.joint.torque_unit,
            "standard_error": error_of(friction)(curve["velocity"]),
            "remarks": [*friction.remarks(), *filter(None, [friction.lowest_speed_remark()])],
        }
    document = {"ok": True, "model": json.loads(encode(model)), "curves": curves}
    if plot is not None:
        document["plot"] = str(plot)
    print_json(document)


def _print_tables(model) -> None:
    from backdrive.report.terminal import joint_tables, provenance_lines

    _spell_out(sys.stdout)
    console = new_console()
    unicode = (console.encoding or "").lower().startswith("utf")
    for friction in model.joints:
        print_lines(console, joint_tables(friction, width=min(console.width, 110), unicode=unicode))
        if remark := friction.lowest_speed_remark():
            echo(remark)
    for line in provenance_lines(model):
        echo(line)


def _spell_out(stream) -> None:
    """Let a terminal that has no ± or minus sign show `+/-` and `-`, so that no sign is lost."""
    plain = {"\u2212": "-", "±": "+/-", "≥": ">=", "≤": "<=", "…": "..", "—": "-"}

    def spell(error: UnicodeError):
        if not isinstance(error, UnicodeEncodeError):
            raise error
        return "".join(plain.get(c, "?") for c in error.object[error.start : error.end]), error.end

    codecs.register_error("backdrive-spell-out", spell)
    if hasattr(stream, "reconfigure"):
        stream.reconfigure(errors="backdrive-spell-out")
