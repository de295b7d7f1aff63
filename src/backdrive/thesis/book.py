"""The book of all experiments: one self-contained HTML file with a section and a picture for each.

It names no network address, runs no script and escapes every text. The same results give the same bytes.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

from backdrive._files import write_whole
from backdrive.report import POLICY
from backdrive.report.joint import table
from backdrive.report.sheet import CSS
from backdrive.report.words import count_of, esc, number, prose, sentence
from backdrive.thesis.ledger import disagreements, evaluate
from backdrive.thesis.ledger import headline as statement_counts
from backdrive.thesis.ledger import of as statements_of
from backdrive.thesis.outcome import Claim
from backdrive.thesis.run import Result

TITLE = "Friction of robot joints: the experiments of Iwatani 2017, run again in simulation"
#: Result of the package's own check -> colour level in the report, word.
WORDS: dict[bool | None, tuple[str, str]] = {
    True: ("good", "holds"),
    False: ("poor", "falls short"),
    None: ("unknown", "shown"),
}
#: Whether a statement of the thesis is reproduced -> the same.
CAME_OUT: dict[bool | None, tuple[str, str]] = {
    True: ("good", "comes out"),
    False: ("poor", "does not come out"),
    None: ("unknown", "shown"),
}
MORE = """
.summary td,.summary th{padding-right:1rem}
.picture{margin:1rem 0}
.picture img{display:block;max-width:100%;height:auto;background:#fff;border-radius:4px}
.claims td{min-width:4.5rem}
.claims .why{display:block;margin-top:.15rem}
@media screen and (max-width:899px){
.claims thead{display:none}
.claims tr{display:block;padding:.6rem 0;border-bottom:1px solid var(--grid)}
.claims th,.claims td{display:block;border:0;padding:.1rem 0}
.claims td[data-label]:not(:empty)::before{content:attr(data-label) ": ";color:var(--muted);font-size:.86rem}
.summary th,.summary td{grid-column:1/-1}
}
"""


def verdict(result: Result) -> tuple[str, str]:
    """Return the colour level and the result of an experiment in words."""
    if result.outcome is None:
        return "poor", "broke down"
    short, held = len(result.of(False)), len(result.of(True))
    if short:
        return "poor", f"{short} of {short + held} fall short" if short + held > 1 else "falls short"
    came_out = evaluate([result.outcome])
    if other := disagreements(came_out):
        return "poor", f"other than in the ledger: {', '.join(other)}"
    if came_out:
        n, of = sum(came_out.values()), len(came_out)
        return "good" if n == of else "unknown", f"{n} of {of} statements come out"
    return ("good", f"all {held} hold" if held > 1 else "holds") if held else ("unknown", "shown")


def overall(results: Sequence[Result]) -> str:
    """Return the verdict on all in a sentence."""
    held, short, told = (sum(len(r.of(v)) for r in results) for v in (True, False, None))
    done = [r for r in results if r.outcome is not None]
    broken = [r.entry.name for r in results if r.outcome is None]
    listed = [s for r in done for s in statements_of(r.entry.name)]
    other = disagreements(evaluate(r.outcome for r in done if r.outcome is not None))
    said = [statement_counts(listed)] if listed else []
    checks = f"Of {count_of(held + short, 'check')} of our own in {count_of(len(results), 'experiment')}, {held} hold"
    said.append(checks + (f"; {told} more notes inform." if told else "."))
    said += [f"Other than in the ledger: {', '.join(other)}."] if other else []
    said += [f"Broke down: {', '.join(broken)}."] if broken else []
    return " ".join(said)


def word(claim: Claim) -> tuple[str, str]:
    """Return the colour level and the result of a claim in words."""
    return (CAME_OUT if claim.statement else WORDS)[claim.holds]


def render(
    results: Sequence[Result], *, command: str, seed: int, version: str, missing: Sequence[str] = ()
) -> str:
    """Return the book as HTML.

    Args:
        results: in the order of the sections.
        command: that made it, to be copied.
        seed: of everything random.
        version: of the package.
        missing: names of requested experiments that were not finished.
    """
    facts = {"Experiments": str(len(results)), "Seed": str(seed), "By": f"backdrive {version}"}
    items = "".join(f"<div><dt>{esc(k)}</dt><dd>{esc(v)}</dd></div>" for k, v in facts.items())
    left = ""
    if missing:
        left = f'<div class="warn" role="note"><b>Not finished</b><ul><li>{esc(", ".join(missing))}</li></ul></div>'
    return (
        "<!DOCTYPE html>\n"
        '<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}; img-src data:">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark"><meta name="referrer" content="no-referrer">'
        f"<title>{esc(TITLE)}</title>\n<style>{CSS}{MORE}</style></head>\n<body><main>\n"
        f'<header><h1>{esc(TITLE)}</h1><p class="lead">{esc(overall(results))}</p>'
        f'<dl class="facts">{items}</dl>{left}</header>\n{_summary(results)}\n'
        + "\n".join(section(result) for result in results)
        + f'\n<section class="about"><h2>The command that made it</h2><pre class="copy">{esc(command)}</pre>'
        "<p>The same seed gives the same numbers. Joints, hands and sensors are simulated. Parameters that the thesis does not "
        "print are estimated, as stated in each setting.</p></section>\n</main></body></html>\n"
    )


def write_book(
    path: str | Path,
    results: Sequence[Result],
    *,
    command: str,
    seed: int,
    version: str,
    missing: Sequence[str] = (),
) -> Path:
    """Write the book, whole or not at all; see `render`.

    Raises:
        InvalidInput: the folder does not exist.
    """
    text = render(results, command=command, seed=seed, version=version, missing=missing)
    return write_whole(path, text)


def headline(name: str) -> str:
    """Return the name of an experiment as a heading has it: `Fig. 3.8`."""
    kind, _, label = name.partition("-")
    return f"{ {'fig': 'Fig.', 'table': 'Table'}.get(kind, kind.capitalize()) } {label}".strip()


def _summary(results: Sequence[Result]) -> str:
    rows = []
    for result in results:
        level, word = verdict(result)
        name = result.entry.name
        rows.append(
            f'<tr><th scope="row" class="name"><a href="#{esc(name)}">{esc(headline(name))}</a></th>'
            f'<td class="verdict"><span class="chip {level}">{esc(word)}</span></td>'
            f"<td>{esc(_title(result))}</td></tr>"
        )
    head = "".join(f'<th scope="col">{h}</th>' for h in ("Experiment", "Verdict", "What it shows"))
    return f'<table class="summary"><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table>'


def _title(result: Result) -> str:
    return result.entry.title if result.outcome is None else result.outcome.title


def section(result: Result) -> str:
    """Return the section of one experiment: setting, picture, claims, numbers."""
    level, word = verdict(result)
    title = f"{headline(result.entry.name)}: {_title(result)}"
    head = (
        f'<section class="joint" id="{esc(result.entry.name)}"><div class="head"><h2>{esc(title)}</h2>'
        f'<span class="chip {level}">{esc(word)}</span></div>'
    )
    if result.outcome is None:
        return (
            f'{head}<div class="warn" role="note"><b>It broke down.</b> {esc(result.error)}</div></section>'
        )
    data = base64.b64encode(result.png).decode()
    picture = f'<figure class="picture"><img alt="{esc(title)}" src="data:image/png;base64,{data}"></figure>'
    numbers = ""
    if result.outcome.numbers:
        rows = [
            [esc(name), f'<span class="n">{number(float(x), 5)}</span>']
            for name, x in result.outcome.numbers.items()
        ]
        inside = table("", ["Number", "Value"], rows)
        numbers = f"<details><summary>{count_of(len(rows), 'number')}</summary>{inside}</details>"
    return (
        f"{head}<p>{esc(prose(sentence(result.outcome.setting)))}</p>{picture}"
        f"{_claims(result.outcome.claims)}{numbers}</section>"
    )


def _claims(claims: Sequence[Claim]) -> str:
    heads = ("Claim", "Thesis", "Here", "Gate", "Verdict")
    rows = []
    for claim in claims:
        level, came = word(claim)
        why = (
            f'<small class="why">{esc(prose(sentence(claim.explanation)))}</small>'
            if claim.explanation
            else ""
        )
        cells = "".join(
            f'<td data-label="{label}">{esc(prose(text))}</td>'
            for label, text in zip(heads[1:], (claim.thesis, claim.ours, claim.gate), strict=False)
        )
        rows.append(
            f'<tr><th scope="row">{esc(prose(claim.what))}{why}</th>{cells}'
            f'<td><span class="chip {level}">{came}</span></td></tr>'
        )
    top = "".join(f'<th scope="col">{h}</th>' for h in heads)
    return f'<table class="claims"><thead><tr>{top}</tr></thead><tbody>{"".join(rows)}</tbody></table>'
