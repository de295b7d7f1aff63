"""The choice of the repairs of a log that are kept: those that lower the held-out error, and those without which the log is
refused.

So a false finding cannot spoil a good log. Repairs of wrong or late samples are tested one at a time: the joints concerned
are identified with and without the repair, with all other repairs made. A residual cannot show a wrong sign, unit, number
overflow or clock that runs back. Those repairs follow from the channels themselves and are always made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from backdrive.errors import BackdriveError, UnhealthyLog
from backdrive.logs import health
from backdrive.logs.log import Log

#: Checks whose repairs can be tested on held-out blocks.
COMPARED = ("stuck", "outlier", "time-slip")
TIE = 0.02  # share by which residuals with and without a repair must differ to tell them apart [-]


def healthy(log: Log, accept: Sequence[str], repair: bool, warnings: list[str]) -> Log:
    """Pass a log through the health gate; suspect findings are added to the warnings, and an error names the file.

    Args:
        log: any.
        accept: names of checks whose findings are taken as they are.
        repair: make the safe repairs that help; see `useless`.
        warnings: sentences are added to it.

    Raises:
        UnhealthyLog: a finding that spoils is neither accepted nor repaired.
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


def apply_repairs(log: Log, accept: Sequence[str] = ()) -> tuple[Log, list[str]]:
    """Return a log with the repairs that help, even if it would still be refused, and the reasons why other repairs were
    undone.
    """
    undone = useless(log, accept)
    return health.mend(log, [*accept, *undone]), list(undone.values())


def useless(log: Log, accept: Sequence[str] = ()) -> dict[str, str]:
    """Return the repairs that do not help, by the name of their check, each with a sentence.

    A repair helps where it lowers the residual on unseen blocks. One that neither lowers nor raises it is made where the log
    would be refused without. In logs without torque nothing is compared.

    Args:
        log: any.
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
    """Return the mean residual of joints on unseen blocks [%]; infinity where one cannot be identified."""
    from backdrive.identification.motion import identify_motion

    try:
        qualities = [identify_motion([log], joint)[0].held_out for joint in joints]
    except BackdriveError:
        return math.inf
    residuals = [math.inf if q is None or math.isnan(q.residual) else q.residual for q in qualities]
    return sum(residuals) / len(residuals)


def _without_acceptance(log: Log, undone: dict[str, str]) -> Log:
    """Return a log without the notes that a person accepted what was not repaired."""
    starts = tuple(f"Accepted [{name}]" for name in undone)
    return (
        log.replace(notes=tuple(note for note in log.notes if not note.startswith(starts))) if undone else log
    )
