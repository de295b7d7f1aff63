"""What a person may ask of an identification, checked before anything long begins, and remembered in the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal

from backdrive.errors import InvalidInput
from backdrive.identification.timing import Timing
from backdrive.logs.log import Drive, Log
from backdrive.plans import plan_to_dict

if TYPE_CHECKING:
    from backdrive.engine import DriveModel
    from backdrive.model import FrictionModel

Interval = Literal["covariance", "profile", "bootstrap"]

#: Option -> the methods that it is for; what is not here is for all.
APPLIES: dict[str, tuple[str, ...]] = {
    "law": ("motion", "constant-velocity", "dynamic"),
    "gravity": ("motion", "dynamic"),
    "literal": ("sweep",),
    "timing": ("sweep",),
    "payloads": ("sweep",),
    "cutoff": ("motion", "arm", "dynamic"),
    "joints": ("sweep", "constant-velocity", "motion", "ramp", "dynamic"),
    "urdf": ("arm",),
    "symmetric": ("sweep", "constant-velocity", "motion", "ramp", "arm"),  # else the law's name says it
    **dict.fromkeys(("delay", "bounds", "known", "drive", "loss", "interval", "step", "seed"), ("dynamic",)),
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Everything that may be asked beside the logs; `identify` tells the meaning of each."""

    law: str | Sequence[str] | None = None
    method: str = "auto"
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
    literal: bool = False
    timing: Timing | None = None
    payloads: Sequence[tuple[float, float]] | None = None
    accept: Sequence[str] = ()
    repair: bool = False
    progress: Callable[[str], None] | None = None

    def say(self, sentence: str) -> None:
        """Tell whoever listens what begins now."""
        if self.progress is not None:
            self.progress(sentence)

    def ticker(self, joint: str) -> Callable[[str, int, float], None]:
        """Return what a search calls: a sentence every fifth step."""
        return lambda stage, i, cost: self.say(f"{joint}: fitting {stage}, step {i}") if i % 5 == 0 else None

    def given(self) -> dict[str, Any]:
        """Return what differs from the default, by name."""
        empty: tuple[Any, ...] = (None, [], (), {})
        usual = Options()
        return {
            f.name: value
            for f in fields(self)
            if (value := getattr(self, f.name)) not in empty and value != getattr(usual, f.name)
        }

    def applicable(self, method: str) -> None:
        """Refuse an option that a method would ignore.

        Raises:
            InvalidInput: there is one, or two contradict each other.
        """
        given = self.given()
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
        """Refuse arguments that no log could make sense of.

        Raises:
            InvalidInput: one of them makes no sense, or two contradict each other.
            UnknownName: no such loss or kind of interval.
        """
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or self.seed < 0:
            raise InvalidInput(f"seed = {self.seed!r}.", remedy="Give a whole number, 0 or above.")
        for name, value, unit in (("cutoff", self.cutoff, "Hz"), ("step", self.step, "s")):
            if value is not None and not 0.0 < value < math.inf:
                raise InvalidInput(
                    f"{name} = {value} {unit}.", remedy="Give a positive number, or leave it out."
                )

    def remembered(self, method: str, plan: Any, held_out: Sequence[Log], **others: Any) -> dict[str, Any]:
        """Return what was asked, as plain values for a model's options; what is the default is left out.

        Args:
            method: that ran.
            plan: one for all logs, one a log, or None.
            held_out: logs that were judged on.
            others: beside it; what is None or empty is left out.
        """
        options = {k: v for k, v in self.given().items() if k != "progress"} | {"method": method}
        for name in ("accept", "joints", "payloads", "law"):
            if isinstance(options.get(name), (list, tuple)):
                options[name] = [list(x) if isinstance(x, tuple) else x for x in options[name]]
        if self.bounds:
            options["bounds"] = {n: [float(x) for x in r[:2]] for n, r in self.bounds.items()}
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
    """Return the numbers of a drive by name that are not the usual ones, its controller and actuator among them."""
    if isinstance(drive, Drive):
        return {"law": drive.law, "gains": dict(drive.gains)}
    usual = type(drive)()
    values = {f.name: getattr(drive, f.name) for f in fields(drive)}
    always = ("controller", "actuator")
    return {n: v for n, v in values.items() if n in always or v != getattr(usual, n)}


def settings_of(model: FrictionModel, joint: str) -> dict[str, Any]:
    """Return what a search chose for one joint (low pass, integration step, drive), empty where there was none."""
    every = model.options.get("settings", model.options.get("joints"))  # older files: `joints`
    own = every.get(joint) if isinstance(every, dict) else None
    return own if isinstance(own, dict) else {}


def moments_without_drive(logs: Sequence[Log]) -> list[str]:
    """Say where a log has moments without a drive, which a fit through its input would take for driven ones."""
    return [
        f"{note} A fit takes the drive to be on throughout: cut those stretches out."
        for log in logs
        for note in log.notes
        if "torque_enable" in note and "off" in note
    ]
