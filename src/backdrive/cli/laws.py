"""`backdrive laws`: the catalogue of friction laws; of one, its equation, parameters, claims and four signatures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json
from backdrive.cli._targets import check_targets
from backdrive.errors import InvalidInput


def command(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="A rate law, a presliding element, or RATE+ELEMENT."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Also draw steady friction, presliding, stick-slip and frictional lag into FILE, ending in .svg or .png.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the same as JSON.")] = False,
) -> None:
    """List the friction laws, or show one: its equation, its parameters with units and bounds, and its proven properties.

    Example: backdrive laws stribeck-gauss+lugre --plot lugre.png
    """
    if name is None:
        if plot is not None:
            raise InvalidInput(
                "No law was named to draw.", remedy="Name one: backdrive laws lugre --plot lugre.png"
            )
        if as_json:
            print_json(_catalogue())
        else:
            _print_catalogue()
        return
    check_targets([], [], drawn=[plot])
    law, kinds = _parts_of(name)
    if plot is not None:
        from backdrive.report.pictures.signatures import save

        save(plot, law, title=name)
    if as_json:
        document = {
            "ok": True,
            "name": name,
            "parts": [_part(kind) for kind in kinds],
            "example": _example(law),
        }
        print_json(document | ({"plot": str(plot)} if plot is not None else {}))
        return
    _print_law(law, kinds)
    if plot is not None:
        echo(f"Wrote {plot}.")


def _parts_of(name: str) -> tuple[Any, list[Any]]:
    """Return the example of a law and the classes that were named, or say what is wrong with the name.

    Raises:
        UnknownName: with the nearest name.
        InvalidInput: the rate law cannot be carried by the element.
    """
    from backdrive.laws import ELEMENTS, RATES, element, rate_law
    from backdrive.laws.examples import example
    from backdrive.laws.pages import find

    first, plus, second = name.partition("+")
    if not plus:
        return example(find(name).NAME), [find(name)]
    if first in ELEMENTS and second in RATES:
        raise InvalidInput(
            f"'{first}' is a presliding element.", remedy=f"The rate law comes first: {second}+{first}."
        )
    return example(name), [rate_law(first), element(second)]


def _catalogue() -> dict[str, Any]:
    from backdrive.laws import ELEMENTS, RATES

    return {
        "ok": True,
        "rates": [_part(kind) for kind in RATES.values()],
        "elements": [_part(kind) for kind in ELEMENTS.values()],
    }


def _part(kind: Any) -> dict[str, Any]:
    """Return a rate law or an element as plain values."""
    from backdrive.laws import pages
    from backdrive.laws.base import Rate

    said = {e.name: e.meaning for e in pages.entries(kind)}
    return {
        "name": kind.NAME,
        "kind": "rate" if issubclass(kind, Rate) else "element",
        "summary": pages.summary(kind),
        "equation": pages.equation(kind),
        "parameters": {
            name: {
                "symbol": p.symbol,
                "meaning": said[name],
                "unit": p.unit_for("rad"),
                "unit_linear": p.unit_for("m"),
                "lower": p.lower,
                "upper": p.upper,
                "many": p.many,
                "typical": p.typical,
                "source": p.source,
            }
            for name, p in kind.PARAMETERS.items()
        },
        "claims": pages.facts(kind),
        "combines_with": pages.partners(kind)[0],
    }


def _example(law: Any) -> dict[str, Any]:
    return {
        "rate": law.rate.NAME,
        "element": law.element.NAME,
        "parameters": law.rate.values(),
        "element_parameters": law.element.values(),
    }


def _table(*columns: str) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="dim")
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _print_catalogue() -> None:
    from backdrive.laws import ELEMENTS, RATES, pages

    console = new_console()
    for title, catalogue in (("rate law", RATES), ("presliding element", ELEMENTS)):
        table = _table(title, "what it is", "parameters")
        table.columns[0].no_wrap = True
        for name, kind in catalogue.items():
            table.add_row(name, pages.summary(kind), ", ".join(kind.PARAMETERS) or "none")
        console.print(table)
        console.print()
    console.print("A law is a rate law, or RATE+ELEMENT. More of one: backdrive laws NAME", soft_wrap=True)


def _parameters(kind: Any) -> Iterator[Any]:
    """Yield the parameters as a table and, below it, where the typical values come from."""
    from rich.text import Text

    from backdrive.laws import pages

    rows = pages.entries(kind)
    if not rows:
        return
    sources = list(dict.fromkeys(e.source for e in rows if e.source))
    table = _table("parameter", "symbol", "what", "unit", "bounds", "typical")
    for e in rows:
        mark = f" [{sources.index(e.source) + 1}]" if e.source else ""
        table.add_row(e.name, e.symbol, e.meaning, e.unit, e.bounds, e.typical + mark)
    yield table
    if sources:
        yield Text("\n".join(f"[{i}] {source}" for i, source in enumerate(sources, start=1)))


def _print_law(law: Any, kinds: list[Any]) -> None:
    from rich.padding import Padding
    from rich.text import Text

    from backdrive.laws import pages

    console = new_console()
    for kind in kinds:
        console.print(Text.assemble((kind.NAME, "bold"), f"  {pages.summary(kind)}"), soft_wrap=True)
        console.print()
        for line in pages.equation(kind).splitlines():
            echo(f"    {line}")
        console.print()
        for text, displayed in pages.paragraphs(kind)[1:]:
            if not displayed:
                console.print(Padding(Text(" ".join(text.split())), (0, 0, 1, 2)))
        for part in _parameters(kind):
            console.print(Padding(part, (0, 0, 1, 2), expand=False))
        for fact in pages.facts(kind):
            echo(f"  - {fact}")
        if len(kinds) == 1:
            good, reason = pages.partners(kind)
            word = "Carried by" if kind.NAME == law.rate.NAME else "Carries"
            console.print(Padding(Text(f"{word}: {', '.join(good)}."), (0, 0, 0, 2)))
            if reason and word == "Carried by":
                console.print(Padding(Text(f"Not by others: {reason}"), (0, 0, 0, 2)))
        console.print()
    advice = law.element.advice(law.rate)
    if advice:
        console.print(f"With the values of the example: {advice}", soft_wrap=True)
