"""The report: one self-contained HTML file with the result, the evidence for it, and the warnings.

It names no network address, runs no script, and escapes every name that came from a file. The same result gives the same
bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from backdrive.errors import InvalidInput
from backdrive.identification.result import Curve, Identification
from backdrive.report.sheet import POLICY as POLICY


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
        command: the command line that made the result; the report prints it for copying.
        title: of the report; by default it names the joint or the number of joints.
        compare: joint name -> a true curve; it is drawn, and its distance from the identified curve is stated.
        more: further sections, as functions of `report` return them.

    Raises:
        InvalidInput: the evidence does not belong to the model's joints, or `compare` names another joint.
        MissingExtra: matplotlib is not installed.
    """
    from backdrive.report import page, sheet
    from backdrive.report.joint import joint_section
    from backdrive.report.pictures.canvas import house_style

    names = result.model.names
    if tuple(e.joint for e in result.evidence) != names:
        raise InvalidInput(
            f"The evidence belongs to joints {[e.joint for e in result.evidence]}, the model to joints "
            f"{list(names)}.",
            remedy="Give one evidence for each joint, in the model's order.",
        )
    truths = dict(compare or {})
    if strange := sorted(set(truths) - set(names)):
        raise InvalidInput(f"`compare` names {strange}.", remedy=f"The joints are {list(names)}.")
    choices = {choice.joint: choice for choice in result.choices}
    title = title or (f"Friction of {names[0]}" if len(names) == 1 else f"Friction of {len(names)} joints")
    with house_style():
        sections = [
            joint_section(
                friction, evidence, truths.get(friction.joint.name), i, choices.get(friction.joint.name)
            )
            for i, (friction, evidence) in enumerate(
                zip(result.model.joints, result.evidence, strict=False), start=1
            )
        ]
    first, last = [page.header(result, title), page.summary(result)], page.provenance(result, command)
    return sheet.page(title, "\n".join([*first, *sections, *more, last]))


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
