"""`backdrive tune`: parameters of compensation, estimation and admittance control, chosen and checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from backdrive.cli import _logs

if TYPE_CHECKING:
    from backdrive.tune import Tuning


def command(
    model: Annotated[
        str, typer.Argument(help="Model file made by `identify -o` or `fit -o`, or preset:NAME.")
    ],
    goal: Annotated[str, typer.Option("--goal", help="backdrive, track, estimate or admit.")] = "backdrive",
    joint: _logs.Joints = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="File to write (JSON).")] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Safe region to draw (PNG or SVG).")
    ] = None,
    stiffness: Annotated[
        str | None,
        typer.Option(
            "--stiffness",
            help="K_c that the encoder sees before break-away, LOW:HIGH [N.m/rad or N/m].  [default: of the law's element]",
        ),
    ] = None,
    inertia: Annotated[
        str | None,
        typer.Option("--inertia", help="Motor and load, LOW:HIGH [kg.m^2 or kg].  [default: the model's]"),
    ] = None,
    motor_share: Annotated[
        float | None,
        typer.Option("--motor-share", help="Of the inertia, on the motor's side.  [default: 0.15]"),
    ] = None,
    counts: Annotated[
        float | None,
        typer.Option("--counts", help="Of the encoder per rad or m at the joint.  [default: the model's]"),
    ] = None,
    noise: Annotated[
        float, typer.Option("--noise", help="Of a reading, standard deviation in counts.")
    ] = 0.0,
    interval: Annotated[
        float, typer.Option("--interval", help="Sampling time of the torque loop [s].")
    ] = 1e-3,
    delay: Annotated[
        float | None,
        typer.Option("--delay", help="Longest, from command to torque [s].  [default: one interval]"),
    ] = None,
    friction_error: Annotated[
        float | None,
        typer.Option(
            "--friction-error", help="Largest relative error of friction from day to day.  [default: 0.1]"
        ),
    ] = None,
    temperature: Annotated[
        str | None, typer.Option("--temperature", help="LOW:HIGH [degC].  [default: what the model has seen]")
    ] = None,
    stroke: Annotated[
        float | None,
        typer.Option("--stroke", help="Of the hand, end to end [rad or m].  [default: 0.15 or 0.06]"),
    ] = None,
    duration: Annotated[float, typer.Option("--duration", help="Of a stroke [s].")] = 0.5,
    dither: Annotated[
        bool, typer.Option("--dither/--no-dither", help="Propose dither where it is safe.")
    ] = True,
    joints: Annotated[int, typer.Option("--joints", help="Drawn from the intervals for the check.")] = 200,
    seed: Annotated[int, typer.Option("--seed", help="Of the search and of the draw.")] = 0,
    as_json: _logs.AsJson = False,
) -> None:
    """Choose K, R, decay rates, dither, filter and admittance for a joint, and say how far they are from breaking.

    Example: backdrive tune preset:thesis/hp3j --joint joint_0 --stiffness 8e4:1.2e5 --inertia 0.6:0.8 -o tuning.json
    """
    from backdrive import load_model
    from backdrive.cli._progress import progress
    from backdrive.errors import InvalidInput
    from backdrive.tune import facts_of, save_tunings, tune
    from backdrive.tune.scenes import stated

    _logs.check_targets([output, picture], [])
    if picture is not None and (
        picture.suffix.lower() not in (".png", ".svg") or goal not in ("backdrive", "track")
    ):
        raise InvalidInput(
            f"--picture {picture} --goal {goal}: no picture of that.",
            remedy="Name a .png or .svg file; the safe region is that of --goal backdrive or track.",
        )
    loaded = load_model(model)
    names = joint or list(loaded.names)
    found: list[Tuning] = []
    with progress(quiet=as_json) as say:
        for name in names:
            facts = facts_of(
                loaded.joint(name),
                stiffness=_ends(stiffness, "--stiffness"),
                inertia=_ends(inertia, "--inertia"),
                motor_share=motor_share,
                counts=counts,
                noise=noise,
                delay=delay,
                interval=interval,
                friction_error=friction_error,
                temperature=_pair(temperature),
            )
            found.append(
                tune(
                    facts,
                    goal,
                    stroke=stated(facts, stroke, duration),
                    joints=joints,
                    seed=seed,
                    draw=picture is not None,
                    dither=dither,
                    say=lambda sentence, name=name: say(f"{name}: {sentence}"),
                )
            )
        if picture is not None:
            from backdrive.plots.tuning import draw

            say("Drawing")
            draw(found[0], picture)
        if output is not None:
            save_tunings(found, output)
    written = [str(p) for p in (output, picture) if p]
    if as_json:
        from backdrive.cli._output import print_json
        from backdrive.tune.tuning import plain

        print_json({"ok": True, "joints": [plain(t) for t in found], "written": written})
    else:
        for tuning in found:
            _print(tuning)
        for path in written:
            typer.echo(f"Wrote {path}")


def _ends(words: str | None, option: str) -> tuple[float, float] | float | None:
    """Return LOW:HIGH, or one number."""
    from backdrive.errors import InvalidInput

    if words is None:
        return None
    try:
        ends = [float(w) for w in words.split(":")]
    except ValueError:
        ends = []
    if len(ends) not in (1, 2) or ends != sorted(ends) or not ends[0] > 0.0:
        raise InvalidInput(
            f"{option} {words}: not LOW:HIGH.",
            remedy=f"Two positive numbers, the lower first: {option} 8e4:1.2e5.",
        )
    return (ends[0], ends[1]) if len(ends) == 2 else ends[0]


def _pair(words: str | None) -> tuple[float, float] | None:
    """Return the ends of --temperature."""
    from backdrive.errors import InvalidInput

    if words is None:
        return None
    try:
        low, high = (float(w) for w in words.split(":"))
    except ValueError as error:
        raise InvalidInput(f"--temperature {words}: not LOW:HIGH.", remedy="For example 20:45.") from error
    return low, high


def _print(tuning: Tuning) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(highlight=False)
    table = Table(
        box=None, pad_edge=False, title=f"{escape(tuning.joint)}, for {tuning.goal}", title_justify="left"
    )
    table.add_column("number", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("why, and what it respects")
    for number in tuning.numbers.values():
        table.add_row(
            number.symbol,
            f"{number.value:.4g}",
            number.unit,
            escape(f"{number.reason} {number.bound}".strip()),
        )
    console.print(table)
    for row, what in tuning.scores["rows"].items():
        rests = "comes to rest" if what["safe"] else "does NOT come to rest"
        console.print(f"  {row:<11} {tuning.scores['words']} {what['score']:.4g}, {rests}")
    for sentence in _margins(tuning):
        console.print(escape(sentence))
    for note in tuning.notes:
        console.print(escape(note), style="yellow")


def _margins(tuning: Tuning) -> Sequence[str]:
    m, unit = tuning.margins, tuning.unit
    if "cycle" not in m:
        return (
            f"Over {m['joints']} joints of the intervals it shows {m['left_over']:.2g} of what is allowed at rest.",
        )
    force = "N.m" if unit == "rad" else "N"
    share = f"R = {m['share_breaks']:.2f}" if m["share_breaks"] < 1e3 else "no R up to 1.3"
    delay = (
        f"a delay of {1e3 * m['delay_breaks']:.1f} ms"
        if m["delay_breaks"] < 1e3
        else "no delay up to 12 ticks"
    )
    return (
        f"Over {m['joints']} joints of the intervals: {100 * m['at_rest']:.0f} % come to rest; largest amplitude there "
        f"{m['cycle']:.2g} {unit} ({m['cycle_counts']:.2g} counts, {100 * m['cycle_by_bound']:.2g} % of the bound); "
        f"energy put in {m['energy']:.2g} J.",
        f"It breaks at {share}, and at {delay}. Break-away left over: {m['breakaway']:.3g} {force} "
        f"(worst {m['breakaway_worst']:.3g}, bare {m['breakaway_bare']:.3g}).",
    )
