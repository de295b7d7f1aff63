"""The options of an identification: checked before any long computation, and recorded in the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

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
from backdrive.identification.alignment import Start
from backdrive.identification.timing import Timing
from backdrive.identification.user_delay import user_delay
from backdrive.laws import Law
from backdrive.logs.log import Drive, Log
from backdrive.model import FrictionModel, Prior
from backdrive.plans import plan_to_dict

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
    "known": ("motion", "sweep", "arm", "dynamic"),
    **dict.fromkeys(("delay", "bounds", "drive", "loss", "interval", "step", "seed"), ("dynamic",)),
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
        if self.user_delay(method) is not None and self.timing is not None:
            raise InvalidInput(
                "Both the timing of the torque and its delay are known.",
                remedy="Give one: --torque-timing sample is --known delay=0.",
            )
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

    def user_delay(self, method: str) -> float | None:
        """Return the delay of the torque that the user knows [s], for any method; None without one."""
        delay = user_delay(self.known, method)
        return self.known.get("delay") if method == "dynamic" else delay

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
