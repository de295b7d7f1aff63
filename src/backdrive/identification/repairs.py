"""The choice of a log's repairs: those that lower the held-out error, and those without which the log would be refused.

A false finding thus cannot spoil a good log. Repairs of wrong or late samples are tested one at a time. The affected joints are
identified with and without the repair, with all other repairs made. A residual does not reveal a wrong sign or unit, an
overflow, or a clock that runs backwards. Those repairs follow from the channels themselves and are always made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from backdrive.errors import BackdriveError, UnhealthyLog
from backdrive.logs import health
from backdrive.logs.log import Log

#: Checks whose repairs can be tested on held-out blocks.
COMPARED = ("stuck", "outlier", "time-slip")
TIE = 0.02  # least relative difference of the residuals with and without a repair that counts [-]


def healthy(log: Log, accept: Sequence[str], repair: bool, warnings: list[str]) -> Log:
    """Check a log's health and return it, repaired if asked for; suspect findings are added to the warnings.

    Args:
        log: any log.
        accept: names of checks whose findings are accepted.
        repair: make the safe repairs that help; see `useless`.
        warnings: list to which sentences are added.

    Raises:
        UnhealthyLog: a finding that would spoil the result is neither accepted nor repaired; the error names the file.
        UnknownName: a name in `accept` is not a check.
    """
    where = f"{log.sources[0].path}: " if log.sources else ""
    undone = useless(log, accept) if repair else {}
    try:
        mended, suspect = health.screen(log, accept=[*accept, *undone], repair=repair)
    except UnhealthyLog as error:
        if not where:
            raise
        raise UnhealthyLog(f"{where}{error.message}", remedy=error.remedy, **error.data) from error
    for f in suspect:
        if not any(f"[{f.name}] " in before and (f.joint or "") in before for before in warnings):
            warnings.append(f"{where}[{f.name}] {f.sentence}")
    warnings += [f"{where}{sentence}" for sentence in undone.values()]
    return _without_acceptance(mended, undone)


def apply_repairs(log: Log, accept: Sequence[str] = ()) -> tuple[Log, dict[str, str]]:
    """Return a log with the repairs that help, even if it would still be refused, and `useless`: the repairs undone."""
    undone = useless(log, accept)
    return health.mend(log, [*accept, *undone]), undone


def useless(log: Log, accept: Sequence[str] = ()) -> dict[str, str]:
    """Return a sentence for each repair that does not help, by the name of its check.

    A repair helps if it lowers the residual on held-out blocks. A repair that hardly changes the residual is kept if the log
    would be refused without it. Logs without torque are not tested.

    Args:
        log: any log.
        accept: names of checks whose findings are not repaired.
    """
    if log.torque is None:
        return {}
    kinds: dict[str, list[health.Finding]] = {}
    for finding in health.check(log):
        if finding.repairable and finding.name in COMPARED and finding.name not in accept:
            kinds.setdefault(finding.name, []).append(finding)
    result = {}
    for name, findings in kinds.items():
        joints = list(dict.fromkeys(f.joint for f in findings if f.joint is not None)) or log.names
        others = _unseen(health.mend(log, [*accept, name]), joints)
        if not math.isfinite(others):
            continue
        own = _unseen(health.mend(log, accept), joints)
        spoils = any(f.severity == "spoils" for f in findings)
        if own < others * (1.0 - TIE) or (spoils and own <= others * (1.0 + TIE)):
            continue
        left = (
            f"with it, {own:.3g} % of held-out torque stays unexplained"
            if math.isfinite(own)
            else "with it, friction cannot be identified"
        )
        result[name] = (
            f"[{name}] {findings[0].sentence} The repair was undone, for it does not help: {left}; without it, "
            f"{others:.3g} %."
        )
    return result


def _unseen(log: Log, joints: Sequence[str]) -> float:
    """Return the mean residual of joints on held-out blocks [%]; infinity if one cannot be identified."""
    from backdrive.identification.motion import identify_motion

    try:
        qualities = [identify_motion([log], joint)[0].held_out for joint in joints]
    except BackdriveError:
        return math.inf
    residuals = [math.inf if q is None or math.isnan(q.residual) else q.residual for q in qualities]
    return sum(residuals) / len(residuals)


def _without_acceptance(log: Log, undone: dict[str, str]) -> Log:
    """Return a log without notes on acceptance for findings whose repair was undone."""
    starts = tuple(f"Accepted [{name}]" for name in undone)
    return (
        log.replace(notes=tuple(note for note in log.notes if not note.startswith(starts))) if undone else log
    )
