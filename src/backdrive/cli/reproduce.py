"""`backdrive reproduce`: repeat the experiments of the thesis, judge and draw them, and bind them into an HTML book."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from backdrive._files import make_folder, write_together
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, table
from backdrive.cli._progress import progress
from backdrive.cli._targets import check_folder

if TYPE_CHECKING:
    from backdrive.thesis.catalog import Entry
    from backdrive.thesis.run import Result

BOOK = "index.html"
WIDE = 120  # terminal width from which claims are printed as a table of five columns [characters]


def command(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help="fig-3.8, table-2.2, chapter-3, or all (the default)."),
    ] = None,
    folder: Annotated[Path, typer.Option("--folder", help="Folder for the book and its pictures.")] = Path(
        "backdrive-book"
    ),
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of everything random.")] = 0,
    list_only: Annotated[bool, typer.Option("--list", help="List the experiments and run none.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Run experiments of the thesis in simulation, print its statements beside the results, and write an HTML book.

    Ctrl-C keeps the finished experiments. The exit code is 1 if one of this package's own checks fails, or if a statement of
    the thesis comes out differently from docs/theory/claims.md.

    Example: backdrive reproduce fig-2.12
    """
    from backdrive.thesis.catalog import ENTRIES, choose

    if list_only:
        entries = choose(names) if names else list(ENTRIES)
        if as_json:
            print_json({"ok": True, "experiments": [_entry(e) for e in entries]})
        else:
            _print_list(entries)
        return
    from backdrive.report.pictures.canvas import require_matplotlib

    entries = choose(names or ())
    pictures = [f"{entry.name}.{kind}" for entry in entries for kind in ("png", "svg")]
    check_folder(folder, [BOOK, *pictures])
    require_matplotlib()

    def bind(done: list[Result]) -> Path:
        return _bind(done, entries, folder, seed, [*(names or ())])

    results, interrupted = _run(entries, folder, seed, bind, quiet=as_json)
    book = bind(results)
    code = _exit_code(results, interrupted)
    if as_json:
        print_json(
            {
                "ok": code == 0,
                "seed": seed,
                "book": str(book),
                "experiments": [_result(r, folder) for r in results],
                "missing": [e.name for e in _missing(results, entries)],
            }
        )
    else:
        _print(results, book, interrupted, len(entries))
    if code:
        raise typer.Exit(code)


def _run(
    entries: list[Entry], folder: Path, seed: int, bind: Callable[[list[Result]], Path], *, quiet: bool
) -> tuple[list[Result], bool]:
    """Run, write each picture as it comes and the book with it, and return what is done, in the order of the book."""
    from backdrive.thesis.book import verdict
    from backdrive.thesis.run import run_all

    make_folder(folder, "--folder")
    done: dict[str, Result] = {}
    interrupted = False
    with progress(quiet=quiet) as say:
        say(f"Running {entries[0].name}")
        try:
            for result in run_all(entries, seed=seed, say=say):
                name = result.entry.name
                done[name] = result
                if result.outcome is not None:
                    write_together({folder / f"{name}.png": result.png, folder / f"{name}.svg": result.svg})
                bind([done[e.name] for e in entries if e.name in done])
                if not quiet:
                    echo(f"{name}: {verdict(result)[1]} ({result.seconds:.1f} s)", err=True)
                if len(done) < len(entries):
                    say(f"Running {entries[len(done)].name}, {len(done)} of {len(entries)} are done")
        except KeyboardInterrupt:
            interrupted = True
    return [done[e.name] for e in entries if e.name in done], interrupted


def _missing(results: list[Result], entries: list[Entry]) -> list[Entry]:
    names = {r.entry.name for r in results}
    return [e for e in entries if e.name not in names]


def _bind(results: list[Result], entries: list[Entry], folder: Path, seed: int, words: list[str]) -> Path:
    from backdrive import __version__
    from backdrive.thesis.book import write_book

    return write_book(
        folder / BOOK,
        results,
        command=" ".join(["backdrive reproduce", *words, f"--seed {seed}"]),
        seed=seed,
        version=__version__,
        missing=[e.name for e in _missing(results, entries)],
    )


def _exit_code(results: list[Result], interrupted: bool) -> int:
    if interrupted:
        return 130
    return max((r.exit_code if r.error else int(not r.holds) for r in results), default=0)


def _entry(entry: Entry) -> dict[str, Any]:
    return {"name": entry.name, "group": entry.group, "title": entry.title, "available": entry.available}


def _result(result: Result, folder: Path) -> dict[str, Any]:
    from backdrive.thesis.ledger import of

    document = _entry(result.entry) | {"holds": result.holds, "seconds": round(result.seconds, 2)}
    document["statements"] = [
        {"name": s.name, "section": s.section, "text": s.text, "verdict": s.verdict, "why": s.why}
        for s in of(result.entry.name)
    ]
    if result.outcome is None:
        return document | {"error": result.error}
    outcome = result.outcome
    return document | {
        "title": outcome.title,
        "setting": outcome.setting,
        "pictures": [str(folder / f"{result.entry.name}.{kind}") for kind in ("png", "svg")],
        "claims": [
            {
                "what": c.what,
                "thesis": c.thesis,
                "ours": c.ours,
                "gate": c.gate,
                "holds": c.holds,
                "why": c.explanation,
                "statement": c.statement,
            }
            for c in outcome.claims
        ],
        "numbers": dict(outcome.numbers),
    }


def _print_list(entries: list[Entry]) -> None:
    width = max((len(e.name) for e in entries), default=0)
    for entry in entries:
        echo(f"{entry.name:<{width}}  {entry.title}{'' if entry.available else ' (no program yet)'}")


def _print(results: list[Result], book: Path, interrupted: bool, asked: int) -> None:
    from backdrive.thesis.book import headline, overall

    console = new_console()
    for result in results:
        title = result.entry.title if result.outcome is None else result.outcome.title
        console.print(f"\n{headline(result.entry.name)}: {title}", style="bold")
        if result.outcome is None:
            console.print(f"broke down: {result.error}", soft_wrap=True)
            if result.where:
                echo(result.where, err=True)
        else:
            console.print(_table(result) if console.width >= WIDE else _blocks(result))
    console.print()
    if interrupted:
        console.print(f"Interrupted: {len(results)} of {asked} experiments are done and kept.")
    console.print(overall(results), soft_wrap=True)
    console.print(f"Open {book}", soft_wrap=True)


def _table(result: Result) -> Any:
    """Return the claims of an experiment as a table with a column each."""
    from backdrive.thesis.book import word

    rows = table("verdict", text=("verdict",), no_wrap=True)
    for heading, ratio in (("claim", 4), ("thesis", 2), ("here", 5), ("gate", 3)):
        rows.add_column(heading, ratio=ratio, overflow="fold")
    for c in result.outcome.claims if result.outcome else ():
        why = f"{c.what}. {c.why_not}" if c.holds is False and c.why_not else c.what
        rows.add_row(word(c)[1], why, c.thesis, c.ours, c.gate)
    return rows


def _blocks(result: Result) -> Any:
    """Return the same for a narrow terminal: a block a claim."""
    from rich.table import Table

    from backdrive.thesis.book import word

    rows = Table(box=None, pad_edge=False, show_header=False)
    rows.add_column(no_wrap=True)
    rows.add_column(overflow="fold")
    for c in result.outcome.claims if result.outcome else ():
        rows.add_row(word(c)[1], c.what)
        shown = [("thesis", c.thesis), ("here", c.ours), ("gate", c.gate)]
        shown += [("why", c.why_not)] if c.holds is False else []
        for heading, text in shown:
            if text:
                rows.add_row(f"  {heading}", text)
    return rows
