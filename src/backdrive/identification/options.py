"""The options and logs of an identification: checked before any long computation, and recorded in the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from backdrive._arguments import (
    FLAG,
    FUNCTION,
    NAMES,
    NUMBER,
    PAIRS,
    PATH,
    SEED,
    WORD,
    check_arguments,
    either,
    instance,
    optional,
)
from backdrive.engine import DriveModel
from backdrive.errors import InvalidInput
from backdrive.identification.alignment import Start, with_plan
from backdrive.identification.timing import Timing
from backdrive.laws import Law
from backdrive.logs.log import Drive, Log
from backdrive.model import FrictionModel, Prior
from backdrive.plans import plan_to_dict

SLOW = 50.0  # sampling rate below which a result is suspect [Hz]
Interval = Literal["covariance", "profile", "bootstrap"]

#: Option -> methods that use it; other options apply to all methods.
APPLIES: dict[str, tuple[str, ...]] = {
    "law": ("motion", "constant-velocity", "dynamic"),
    "gravity": ("motion", "dynamic"),
    "literal": ("sweep",),
    "timing": ("sweep",),
    "payloads": ("sweep",),
    "cutoff": ("motion", "arm", "dynamic"),
    "joints": ("sweep", "constant-velocity", "motion", "ramp", "dynamic"),
    "urdf": ("arm",),
    "symmetric": ("sweep", "constant-velocity", "motion", "ramp", "arm", "dynamic"),
    "prior": ("sweep", "constant-velocity", "motion", "dynamic"),
    **dict.fromkeys(("delay", "bounds", "known", "drive", "loss", "interval", "step", "seed"), ("dynamic",)),
}


ARGUMENTS = {
    "law": optional(either(NAMES.words, NAMES, instance("a law", Law))),  # the choice refuses the latter
    "method": WORD,
    "start": optional(either("seconds, or 'auto'", NUMBER, WORD)),
    "joints": optional(NAMES),
    "urdf": optional(PATH),
    "symmetric": optional(FLAG),
    "gravity": optional(FLAG),
    "delay": FLAG,
    "loss": WORD,
    "interval": WORD,
    "cutoff": optional(NUMBER),
    "step": optional(NUMBER),
    "seed": SEED,
    "literal": FLAG,
    "timing": optional(WORD),
    "payloads": optional(PAIRS),
    "accept": NAMES,
    "repair": FLAG,
    "progress": optional(FUNCTION),
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """All options beside the logs; `identify` documents each."""

    law: str | Sequence[str] | None = None
    method: str = "auto"
    start: Start | None = None
    joints: Sequence[str] | None = None
    urdf: str | None = None
    symmetric: bool | None = None
    gravity: bool | None = None
    delay: bool = True
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    known: Mapping[str, float] = field(default_factory=dict)
    drive: DriveModel | Drive | None = None
    loss: str = "huber"
    interval: Interval = "covariance"
    cutoff: float | None = None
    step: float | None = None
    seed: int = 0
    prior: tuple[Prior, ...] = ()
    literal: bool = False
    timing: Timing | None = None
    payloads: Sequence[tuple[float, float]] | None = None
    accept: Sequence[str] = ()
    repair: bool = False
    progress: Callable[[str], None] | None = None

    def say(self, sentence: str) -> None:
        """Report the next step to the progress callback, if there is one."""
        if self.progress is not None:
            self.progress(sentence)

    def overrides(self) -> dict[str, Any]:
        """Return the options that differ from their defaults, by name."""
        empty: tuple[Any, ...] = (None, [], (), {})
        usual = Options()
        return {
            f.name: value
            for f in fields(self)
            if (value := getattr(self, f.name)) not in empty and value != getattr(usual, f.name)
        }

    def applicable(self, method: str) -> None:
        """Refuse options that a method would ignore.

        Raises:
            InvalidInput: there is such an option, or two contradict each other.
        """
        given = self.overrides()
        for name in given:
            if method not in APPLIES.get(name, (method,)):
                raise InvalidInput(
                    f"'{name}' does not apply to the method '{method}'.",
                    remedy=f"It is for {', '.join(APPLIES[name])}: leave it out, or choose another method.",
                )
        for other in ("literal", "symmetric"):
            if self.payloads and given.get(other):
                raise InvalidInput(
                    f"'{other}' does not go with a payload.",
                    remedy="Leave it out: both directions have a curve of their own.",
                )

    def check(self) -> None:
        """Refuse arguments that are invalid for any log.

        Raises:
            InvalidInput: an argument is invalid, or two contradict each other.
            UnknownName: no such loss or kind of interval.
        """
        check_arguments(ARGUMENTS, vars(self))
        for name, value, unit in (("cutoff", self.cutoff, "Hz"), ("step", self.step, "s")):
            if value is not None and not 0.0 < value < math.inf:
                raise InvalidInput(
                    f"{name} = {value} {unit}.", remedy="Give a positive number, or leave it out."
                )

    def record(self, method: str, plan: Any, held_out: Sequence[Log], **others: Any) -> dict[str, Any]:
        """Return the options that differ from their defaults, as plain values for the model.

        Args:
            method: the method used.
            plan: one for all logs, one per log, or None.
            held_out: held-out logs.
            others: further entries; None and empty values are left out.
        """
        options = {k: v for k, v in self.overrides().items() if k != "progress"} | {"method": method}
        for name in ("accept", "joints", "payloads", "law"):
            if isinstance(options.get(name), (list, tuple)):
                options[name] = [list(x) if isinstance(x, tuple) else x for x in options[name]]
        if self.bounds:
            options["bounds"] = {n: [float(x) for x in r[:2]] for n, r in self.bounds.items()}
        if self.prior:
            options["prior"] = [prior.source for prior in self.prior]
        if self.known:
            options["known"] = {n: float(x) for n, x in self.known.items()}
        if self.drive is not None:
            options["drive"] = describe_drive(self.drive)
        if method == "dynamic":
            options |= {"seed": self.seed, "loss": self.loss}
        if plan is not None:
            several = isinstance(plan, (list, tuple))
            options["plan"] = [plan_to_dict(p) for p in plan] if several else plan_to_dict(plan)
        options["held_out"] = [{"path": s.path, "sha256": s.sha256} for log in held_out for s in log.sources]
        empty: tuple[Any, ...] = (None, [], {})
        return {k: v for k, v in (options | others).items() if v not in empty}


def describe_drive(drive: DriveModel | Drive) -> dict[str, Any]:
    """Return the parameters of a drive that differ from their defaults, by name, with its controller and actuator."""
    if isinstance(drive, Drive):
        return {"law": drive.law, "gains": dict(drive.gains)}
    usual = type(drive)()
    values = {f.name: getattr(drive, f.name) for f in fields(drive)}
    always = ("controller", "actuator")
    return {n: v for n, v in values.items() if n in always or v != getattr(usual, n)}


def settings_of(model: FrictionModel, joint: str) -> dict[str, Any]:
    """Return the settings of a search for one joint (low pass, integration step, drive); empty without a search."""
    every = model.options.get("settings", model.options.get("joints"))  # older files: `joints`
    own = every.get(joint) if isinstance(every, dict) else None
    return own if isinstance(own, dict) else {}


def moments_without_drive(logs: Sequence[Log]) -> list[str]:
    """Return sentences on logs in which the drive was off at times, which a fit given the drive's input does not account for."""
    return [
        f"{note} A fit takes the drive to be on throughout: cut those stretches out."
        for log in logs
        for note in log.notes
        if "torque_enable" in note and "off" in note
    ]


def in_order(log: Log, first: Log) -> Log:
    """Return a log with its joints in the order of the first log's.

    Raises:
        InvalidInput: its joints or their units differ.
    """
    if set(log.names) != set(first.names):
        raise InvalidInput(
            f"The logs hold different joints: {', '.join(first.names)} and {', '.join(log.names)}.",
            remedy="Identify them one by one, or name the joints alike (--names).",
        )
    log = log if log.names == first.names else log.select(first.names)
    for mine, theirs in zip(log.joints, first.joints, strict=False):
        if mine.unit != theirs.unit:
            raise InvalidInput(
                f"Joint '{mine.name}' is in {theirs.unit} in one log and in {mine.unit} in another.",
                remedy="Read all of them with the same --unit.",
            )
    return log


def coupling_of(logs: Sequence[Log], names: Sequence[str]) -> dict[str, Any]:
    """Return the model's entry for the coupling matrix that converted all logs from motors to joints; empty without one.

    Joints that are not identified keep their rows, since a conversion back to the motors needs the whole matrix.

    Args:
        logs: of the same joints.
        names: of the identified joints.

    Raises:
        InvalidInput: the coupling matrices of the logs differ.
    """
    matrices = {log.coupling for log in logs}
    if len(matrices) > 1:
        raise InvalidInput(
            "The logs are of differently coupled motors.", remedy="Read all of them with the same --coupling."
        )
    if matrices == {None}:
        return {}
    rows = (*names, *(name for name in logs[0].names if name not in names))
    return {
        "coupling": logs[0].select(rows).coupling,
        "coupled": rows if len(rows) > len(names) else (),
    }


def apart(logs: Sequence[Log], held_out: Sequence[Log]) -> None:
    """Refuse a held-out file that is also fitted, and a file that is fitted twice, except files joined to several logs."""
    fitted: dict[str, str] = {}
    spans: dict[str, list[tuple[float, float]]] = {}
    for log in logs:
        begin, end = (float(log.time[0]), float(log.time[-1])) if len(log) else (0.0, 0.0)
        for source in log.sources[:1]:
            if any(begin < e and b < end for b, e in spans.get(source.sha256, [])):
                raise InvalidInput(
                    f"{source.path} and {fitted[source.sha256]} are the same log.",
                    remedy="Name it once: a copy of a log adds no information.",
                )
            fitted[source.sha256] = source.path
            spans.setdefault(source.sha256, []).append((begin, end))
    for log in held_out:
        for source in log.sources[:1]:
            if source.sha256 in fitted:
                raise InvalidInput(
                    f"{source.path} is held out and also fitted ({fitted[source.sha256]}).",
                    remedy="Hold out a log that is not fitted; without any, blocks of the fitted ones are held out in turn.",
                )


def attach_plan(logs: Sequence[Log], plan: Any, start: Start | None = None) -> list[Log]:
    """Return the logs with their plans: one for all, one per log, or None for their own.

    `start` is the start of the plan in each log; see `alignment.with_plan`.

    Raises:
        InvalidInput: the number of several plans differs from that of the logs.
    """
    if plan is None and start is None:
        return list(logs)
    plans = list(plan) if isinstance(plan, (list, tuple)) else [plan] * len(logs)
    if plan is None:
        plans = [log.plan for log in logs]
    if len(plans) != len(logs):
        raise InvalidInput(
            f"{len(plans)} plans for {len(logs)} logs.",
            remedy="Give one plan for all logs, or one for each in their order.",
        )
    for one in plans:
        if one is not None and not hasattr(one, "kind"):
            raise InvalidInput(
                f"plan is {one!r:.40}.",
                remedy="Give an object of `backdrive.plans`; `load_plan` reads a file.",
            )
    if start is not None:
        return [with_plan(log, one, start) for log, one in zip(logs, plans, strict=False)]
    return [log.replace(plan=one) for log, one in zip(logs, plans, strict=False)]


def slow_clock(logs: Sequence[Log]) -> list[str]:
    """Return sentences on logs whose sampling is too slow for differentiation, or whose time has another unit."""
    rates = [1.0 / log.period for log in logs if log.period > 0]
    if not rates or min(rates) >= SLOW:
        return []
    return [
        f"A log has {min(rates):.3g} samples a second: below {SLOW:g} Hz only slow motion is trustworthy. If its time is in "
        "milliseconds, read it with --map t=0.001*COLUMN."
    ]


def external_torque_notes(logs: Sequence[Log], method: str) -> list[str]:
    """Return sentences on known torques in the logs that the method does not use."""
    if method == "motion" or all(log.model_torque is None for log in logs):
        return []
    return [
        f"The method '{method}' does not use the torque known from elsewhere (tau_model); subtract it from the torque "
        '(--map "tau=COLUMN-MODEL"), or use --method motion.'
    ]


def move_together(logs: Sequence[Log], names: Sequence[str]) -> bool:
    """Return whether joints move at the same time and the logs hold no model torque of their coupling."""
    together = 0
    for log in logs:
        if len(names) < 2 or log.model_torque is not None or len(log) < 2:
            continue
        part = log.select(names)
        speed = np.abs(np.gradient(part.position, axis=0) if part.position is not None else part.velocity)
        busy = speed > 0.05 * np.nanpercentile(speed, 99, axis=0)
        together += int(np.mean(busy.sum(axis=1) > 1) > 0.2)
    return together > 0
