"""The output of `backdrive tune`: the numbers, their reasons and scores, the margins, and what to type into a controller."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_lines, table

if TYPE_CHECKING:
    from backdrive.tuning import Tuning

RESTS = (("NOT all rest", "all rest"), ("NOT all fade", "all fade"))  # of the joints tried: no, yes

NO_ENERGY = 1e-9  # less is rounding [J]


def show_tuning(tuning: Tuning) -> None:
    """Print the tuning of one joint for a person."""
    console = new_console()
    title = f"{tuning.joint}, for {tuning.goal}"
    texts = ("parameter", "symbol", "unit")
    rows = table("parameter", "symbol", "value", "unit", text=texts, no_wrap=True, title=title)
    for name, number in tuning.numbers.items():
        rows.add_row(_words(name), number.symbol, f"{number.value:.4g}", number.unit)
    console.print(rows)
    console.print("Reasons, and constraints:")
    reasons = (f"{_words(name)}: {n.reason} {n.bound}".rstrip() for name, n in tuning.numbers.items())
    print_lines(console, (f"  {reason}" for reason in reasons))
    print_lines(console, _scores(tuning, console))
    print_lines(console, _margins(tuning))
    if tuning.trip_speed is not None:
        force = "N.m" if tuning.unit == "rad" else "N"
        console.print(
            f"In the loop the compensator gives at most {tuning.limit:.3g} {force}, and switches off once the joint "
            f"is faster than {tuning.trip_speed:.3g} {tuning.unit}/s."
        )
    print_lines(console, tuning.notes, style="yellow")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _scores(tuning: Tuning, console: Any) -> Sequence[str]:
    """Print the scores as a table, the proposal's first, and return what its columns mean."""
    from backdrive.tuning.wishes import FEELINGS

    words, unit, scores = tuning.scores["words"], tuning.scores["unit"], tuning.scores["rows"]
    parts = list(scores["chosen"].get("felt", {}))
    console.print(f"Score [{unit}], the smaller the better: {words}.")
    rows = table("numbers", "score", "joints tried", *parts, text=("numbers", "joints tried"), no_wrap=True)
    for name, row in scores.items():
        felt = row.get("felt", {})
        cells = [f"{felt[part]:.3g}" if part in felt else "-" for part in parts]
        rows.add_row(name, f"{row['score']:.4g}", RESTS[tuning.goal == "estimate"][row["safe"]], *cells)
    console.print(rows)
    if not parts:
        return ()
    return ("  " + "; ".join(f"{part}: {FEELINGS[part]}" for part in parts) + "; without dither.",)


def _margins(tuning: Tuning) -> Sequence[str]:
    """Return the margins in sentences."""
    m, unit = tuning.margins, tuning.unit
    if "cycle" not in m:
        return (
            f"Over {m['joints']} joints of the intervals (a quarter of --joints, at least 8) the loop at rest "
            f"reaches {m['left_over']:.2g} times the allowed value.",
        )
    force = "N.m" if unit == "rad" else "N"
    share = (
        f"a share of friction R = {m['share_breaks']:.2f}"
        if m["share_breaks"] < 1e3
        else f"no share up to {m['share_searched']:g}"
    )
    delay = (
        f"a delay of {1e3 * m['delay_breaks']:.1f} ms"
        if m["delay_breaks"] < 1e3
        else f"no delay up to {1e3 * m['delay_searched']:g} ms, where the search ended"
    )
    dither = (
        f"With the dither, at rest, the motor sways by up to {m['dither_motor']:.2g} {unit} ({m['dither_counts']:.2g} counts) "
        f"and the load by {m['dither_load']:.2g} {unit}.",
    )
    switching = ()
    if "switching_at_rest" in m:
        switching = (
            f"With algFC2 (`compensator(switching=True)`), which the test above does not include, "
            f"{100 * m['switching_at_rest']:.0f} % of them come to rest after a knock.",
        )
    return (
        f"Of {m['joints']} joints drawn from the intervals, without dither: {100 * m['at_rest']:.0f} % come to rest. "
        f"The largest amplitude at rest is {m['cycle']:.2g} {unit} ({m['cycle_counts']:.2g} counts, "
        f"{100 * m['cycle_by_bound']:.3g} % of the bound). "
        + (
            f"The compensator puts in {m['energy']:.2g} J."
            if m["energy"] > NO_ENERGY
            else "The compensator puts in no energy."
        ),
        *(dither if "dither_motor" in m else ()),
        f"Without dither the joint first fails to come to rest at: {share}; {delay}. Remaining break-away torque"
        f"{', with the dither' if 'dither_motor' in m else ''}: {m['breakaway']:.3g} {force} "
        f"(worst {m['breakaway_worst']:.3g}, bare {m['breakaway_bare']:.3g}).",
        *switching,
    )


def show_controller(model: str, output: Path | None) -> None:
    """Print what to type into a controller, in Python and in C."""
    if output is None:
        echo("For a controller, keep the numbers in a file: give -o tuning.json.")
        return
    echo("In a controller in Python:")
    for line in (
        "from backdrive import load_model",
        "from backdrive.tuning import load_tunings",
        f"loop = load_model({model!r}).loop(load_tunings({str(output)!r}))",
        "loop.reset(position)            # once, at rest: one number a joint",
        "loop.update(position, applied)  # every period: the encoders, the torques applied",
        "torque = loop.torque            # what to add to the controller's own",
    ):
        echo(f"  {line}")
    echo("In a controller in C:")
    echo(
        f"  {shlex.join(['backdrive', 'export', model, '--tuning', str(output), '--to', 'c', '-o', 'firmware/'])}"
    )
