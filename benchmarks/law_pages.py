"""Write the pages and pictures of all friction laws: docs/theory/laws/*.md and docs/figures/laws/*.png.

    python benchmarks/law_pages.py [--text] [NAME ...]

`--text` leaves the pictures alone; with names only the pictures of those are drawn. Pages without a law are removed.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

from backdrive.laws import ELEMENTS, RATES
from backdrive.laws.base import Rate, Rows
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES, example
from backdrive.laws.pages import Kind, entries, facts, find, is_shared, paragraphs, partners, summary

DOCS = Path(__file__).resolve().parent.parent / "docs"
TEXT, FIGURES = DOCS / "theory" / "laws", DOCS / "figures" / "laws"
COLORS = 48  # of a picture's palette
CODE_WIDTH = 100  # columns of a line of an example
BENEATH = "stribeck-gauss"  # the rate law that an element carries in its picture and its example

INTRODUCTION = """# Friction laws

A law consists of a **rate law**, the friction torque at a velocity, and a **presliding element**, which describes how
that torque builds up and relaxes at reversals. `benchmarks/law_pages.py` generates a page for each of them from its
source file. The same text in the terminal:

```sh
backdrive laws
backdrive laws lugre
backdrive laws polyline+maxwell-slip --plot signatures.png
```
"""

PICTURES = f"""## The pictures

All laws go through the same four experiments, with parameters of a small arm's joint with a friction of about 5 N.m. An
element is combined with the rate law `{BENEATH}`, a rate law with the element `none`.

1. **Steady friction**: the final torque at constant velocity, over the logarithm of the speed. Dashed: along -q, if the
   two directions differ. Dotted: the rate law, if the steady torque of the element differs from it.
2. **Presliding with reversals**: slow motion from rest over a few break-away distances, with three nested loops, at two
   speeds. If the two curves agree, the torque depends on the path only. A law without presliding shows the jump of a
   set-valued torque; that of a smooth law is zero at every reversal.
3. **A mass pulled by a spring** whose other end moves at constant speed: the mass may stick and slip, or creep. The
   velocity of each tick solves the implicit step (`kernels.solve`).
4. **Frictional lag**: a positive velocity that oscillates at 1 and 10 Hz, drawn on the curve of steady friction.

A law that depends on load is drawn for three loads, each with the torque of the motor and the torque of everything else.
A law that depends on temperature is drawn for three temperatures under one load.
"""


def pages() -> dict[str, str]:
    """Return every page by its file's name, the index as README.md."""
    return {"README.md": index()} | {f"{name}.md": page(name) for name in (*RATES, *ELEMENTS)}


def index() -> str:
    lines = [INTRODUCTION]
    for title, catalogue in (("Rate laws", RATES), ("Presliding elements", ELEMENTS)):
        lines += [f"## {title}\n", "| name | what it is | parameters |", "|---|---|---|"]
        for name, kind in catalogue.items():
            parameters = ", ".join(f"`{p}`" for p in kind.PARAMETERS) or "none"
            lines.append(f"| [{name}]({name}.md) | {summary(kind)} | {parameters} |")
        lines.append("")
    return "\n".join([*lines, PICTURES])


def page(name: str) -> str:
    """Return the page of a law."""
    kind = find(name)
    is_rate = issubclass(kind, Rate)
    blocks = [f"# {name}"] + ([summary(kind)] if is_shared(kind) else [])
    blocks += [f"```text\n{text}\n```" if displayed else text for text, displayed in paragraphs(kind)]
    over = "" if is_rate else f", over [{BENEATH}]({BENEATH}.md)"
    blocks += [
        f"![{name}: steady friction, presliding, stick-slip and frictional lag](../../figures/laws/{name}.png)",
        f"Drawn with the values of the example below{over}; [what the four pictures show](README.md#the-pictures).",
        "## Parameters",
        parameter_table(kind),
        "## What it promises",
        "\n".join(f"- {fact}" for fact in facts(kind)),
        f"## {'Presliding' if is_rate else 'Rate laws'}",
        partner_sentence(kind),
        "## In Python",
        f"<!-- not run: tests/test_law_pages.py runs it -->\n```python\n{code(kind)}\n```",
    ]
    return "\n\n".join(blocks) + "\n"


def parameter_table(kind: Kind) -> str:
    rows = entries(kind)
    if not rows:
        return "None."
    lines = ["| name | symbol | what | unit | bounds | typical | source |", "|---|---|---|---|---|---|---|"]
    for e in rows:
        cells = (f"`{e.name}`", f"`{e.symbol}`", e.meaning, e.unit, e.bounds, e.typical, e.source)
        lines.append("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")
    return "\n".join(lines)


def partner_sentence(kind: Kind) -> str:
    good, reason = partners(kind)
    links = ", ".join(f"[{name}]({name}.md)" for name in good)
    if issubclass(kind, Rate):
        return f"It can be carried by {links}." + (f" Not by others: {reason}" if reason else "")
    return f"It can carry {links}." + (
        " Not the others, which are continuous and zero at rest." if reason else ""
    )


def code(kind: Kind) -> str:
    """Return a few lines of Python that make the law and ask it for a torque."""
    if issubclass(kind, Rate):
        rate = RATE_EXAMPLES[kind.NAME]
        return "\n".join(
            [
                f"from backdrive.laws import {imports('Law', type(rate).__name__)}",
                "",
                *call("law = Law", rate=rate),
                "print(law.torque([-0.5, 0.01, 0.5]))  # steady friction [N.m] at velocities [rad/s]",
            ]
        )
    rate, element = RATE_EXAMPLES[BENEATH], ELEMENT_EXAMPLES[kind.NAME]
    return "\n".join(
        [
            "import numpy as np",
            "",
            f"from backdrive.laws import {imports('Law', type(rate).__name__, type(element).__name__, 'kernels')}",
            "",
            *call("law = Law", rate=rate, element=element),
            "x, load, temperature = law.state(), np.zeros(2), 20.0  # [-], [N.m], [degC]",
            "dp, dt = 1e-5, 1e-3  # one tick: motion [rad] in time [s]",
            "print(kernels.step(law.rate.KIND, law.element.KIND, law.row(), x, dp, dt, load, temperature))  # [N.m]",
        ]
    )


def imports(*names: str) -> str:
    """Sort names as import sorters do: constants, classes, modules."""
    return ", ".join(sorted(names, key=lambda n: (0 if n.isupper() else 1 if n[0].isupper() else 2, n)))


def call(head: str, **parts: Rows) -> list[str]:
    """Return a call as lines, broken between arguments where it is too long."""
    made = {key: f"{type(rows).__name__}({arguments(rows, ', ')})" for key, rows in parts.items()}
    whole = f"{head}({', '.join(f'{key}={text}' for key, text in made.items())})"
    if len(whole) <= CODE_WIDTH:
        return [whole]
    lines = [f"{head}("]
    for key, rows in parts.items():
        line = f"    {key}={made[key]},"
        if len(line) > CODE_WIDTH:
            inner = arguments(rows, ",\n        ")
            line = f"    {key}={type(rows).__name__}(\n        {inner},\n    ),"
        lines += line.splitlines()
    return [*lines, ")"]


def arguments(rows: Rows, between: str) -> str:
    return between.join(f"{name}={value!r}" for name, value in rows.values().items())


def small(png: bytes) -> bytes:
    """Return a picture with a palette, a quarter of the bytes."""
    from PIL import Image

    with Image.open(io.BytesIO(png)) as image:
        reduced = image.convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
    stream = io.BytesIO()
    reduced.save(stream, "png", optimize=True)
    return stream.getvalue()


def write(path: Path, content: bytes) -> None:
    if not path.exists() or path.read_bytes() != content:
        path.write_bytes(content)
        print(f"wrote {path.relative_to(DOCS.parent)} ({len(content) / 1e3:.0f} kB)")


def main() -> None:
    """Write what has changed."""
    from backdrive.report.pictures.signatures import picture

    names = [find(name).NAME for name in sys.argv[1:] if name != "--text"] or [*RATES, *ELEMENTS]
    for folder in (TEXT, FIGURES):
        folder.mkdir(parents=True, exist_ok=True)
    texts = pages()
    for name, text in texts.items():
        write(TEXT / name, text.encode())
    for stale in (p for p in TEXT.glob("*.md") if p.name not in texts):
        stale.unlink()
    if "--text" not in sys.argv:
        for name in names:
            write(FIGURES / f"{name}.png", small(picture(example(name), "png", title=name)))


if __name__ == "__main__":
    main()
