"""The report: one self-contained HTML file with the result, the evidence for it, and what speaks against it.

It names no network address, runs no script, and escapes every name that came from a file. The same result gives the same
bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from backdrive.errors import InvalidInput
from backdrive.identification.result import Curve, Identification

POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"


def render(
    result: Identification,
    *,
    command: str,
    title: str | None = None,
    compare: Mapping[str, Curve] | None = None,
    more: Sequence[str] = (),
) -> str:
    """Return the report of an identification as HTML.

    Args:
        result: what `identify` returned.
        command: the command line that made it, to be copied.
        title: of the report; by default it names the joint or the number of joints.
        compare: joint name -> a true curve, drawn and measured against the identified one.
        more: further sections, as functions of `report` return them.

    Raises:
        InvalidInput: the evidence does not belong to the model's joints, or `compare` names another joint.
        MissingExtra: matplotlib is not installed.
    """
    from backdrive.report import page
    from backdrive.report.joint import joint_section
    from backdrive.report.pictures.canvas import house_style
    from backdrive.report.sheet import CSS
    from backdrive.report.words import esc

    names = result.model.names
    if tuple(e.joint for e in result.evidence) != names:
        raise InvalidInput(
            f"The evidence is of joints {[e.joint for e in result.evidence]}, the model of {list(names)}.",
            remedy="Give one evidence a joint, in the model's order.",
        )
    truths = dict(compare or {})
    if strange := sorted(set(truths) - set(names)):
        raise InvalidInput(f"`compare` names {strange}.", remedy=f"The joints are {list(names)}.")
    title = title or (f"Friction of {names[0]}" if len(names) == 1 else f"Friction of {len(names)} joints")
    with house_style():
        sections = [
            joint_section(friction, evidence, truths.get(friction.joint.name), i)
            for i, (friction, evidence) in enumerate(zip(result.model.joints, result.evidence), start=1)
        ]
    return (
        "<!DOCTYPE html>\n"
        '<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark"><meta name="referrer" content="no-referrer">'
        f"<title>{esc(title)}</title>\n<style>{CSS}</style></head>\n<body><main>\n"
        f"{page.header(result, title)}\n{page.summary(result)}\n"
        + "\n".join([*sections, *more])
        + f"\n{page.provenance(result, command)}\n</main></body></html>\n"
    )


def write_report(
    result: Identification,
    path: str | Path,
    *,
    command: str,
    title: str | None = None,
    compare: Mapping[str, Curve] | None = None,
    more: Sequence[str] = (),
) -> Path:
    """Write the report of an identification, whole or not at all; see `render`.

    Raises:
        InvalidInput: the folder does not exist, or the evidence does not fit the model.
        MissingExtra: matplotlib is not installed.
    """
    from backdrive._files import write_whole

    return write_whole(path, render(result, command=command, title=title, compare=compare, more=more))
