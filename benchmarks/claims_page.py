"""Write docs/theory/claims.md from the ledger of `backdrive.thesis`.

python benchmarks/claims_page.py
"""

from __future__ import annotations

from pathlib import Path

from backdrive.thesis.catalog import ENTRIES
from backdrive.thesis.ledger import STATEMENTS, counts, headline, of

PAGE = Path(__file__).resolve().parent.parent / "docs" / "theory" / "claims.md"

HEAD = """# What the thesis says of its figures, and what came of it

Made by `benchmarks/claims_page.py` from `backdrive.thesis.ledger`; `benchmarks/evidence/thesis_claims.py` computes every verdict
on two disjoint sets of seeds and ends `met` only where it is the one written here. `benchmarks/evidence/noticed.py` prints how
large a bias each figure notices.

**Which statements count.** The sentences of the results sections (2.4 to 2.5, 3.2, 3.4.2, 3.5, 3.6.2, 4.2.2, 4.6, 4.7.2) count if
they name a figure or table or refer to one ("it can be seen"), and state more than what is drawn. A caption counts if it states a
result. The list was made before any statement was judged. It gives sections instead of pages, since the copy at hand has neither
pages nor a table of contents.

- *Reproduced*: on the one Setup A and the one Setup B of `backdrive.thesis.setups`, with the printed numbers, compensators and
  filter.
- *Not reproduced and explained*: it does not come out, and a run beside it shows what it takes.
- *Contradicted*: it does not come out on these joints. With another transmission it may (the table below): that is no rescue.
- *Cannot be judged here*: the thesis omits the quantity that decides, which is named; what stands for it here was put in.

A difference counts where its 95 % interval over hands, or over windows of the metronome, leaves out zero.

In Figs. 3.9 and 3.10 a hand leads the grip of the six-axis arm around a square, moving Joints 0 to 2 together. The thesis prints a
metronome of 0.667 Hz, but not how many sides go to a beat. One side a beat was chosen after the other readings had been run. At
two sides a beat, as on Setup A, such a hand does not draw a square. The verdicts are the same at every pace that was tried. Three
statements were moved out of "cannot be judged" after their runs: 2.7-limit, 2.11-velocity and 3.8-direction.
"""

STIFFNESS = """## By the transmission

K_c, which the thesis does not print, is K (of chapter 3) for every figure: it calls K "close to the elasticity of the setup"
(3.5.1). Other values had been tried when this one was taken. What comes out (+) and what does not (-) elsewhere,
`python benchmarks/evidence/thesis_claims.py --stiffness`, seed 0; a statement that is not listed does not depend on it or has
no verdict. At K_c = 2K the printed procedure gets 9 of Joint 0's 10 cycles, and so no curve to compare
(2.7-overlap, 2.8-large).

"""


def page(table: str = "") -> str:
    """Return the page.

    Args:
        table: of the statements over K_c/K; empty: that which the page has.
    """
    rows = [HEAD, f"**{headline(STATEMENTS)}**\n"]
    for entry in ENTRIES:
        listed = of(entry.name)
        if not listed:
            continue
        rows.append(f"## {entry.name}: {entry.title}\n")
        rows.append("| name | section | what the thesis says | verdict | why |\n|---|---|---|---|---|")
        rows.extend(f"| `{s.name}` | {s.section} | {s.text} | {s.verdict} | {s.why} |" for s in listed)
        rows.append("")
    return "\n".join(rows) + "\n" + STIFFNESS + (table or _kept())


def _kept() -> str:
    """Return the table over K_c/K that stands in the page now."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    return text.partition(STIFFNESS)[2]


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(f"wrote {PAGE.name}: {counts(STATEMENTS)}")


if __name__ == "__main__":
    main()
