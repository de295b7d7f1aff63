"""What was chosen for a joint, why, and how far it is from breaking; and its file, a small JSON that a robot's program can load."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from backdrive._files import write_whole
from backdrive.compensate import Compensator, Dither, alg_fc, alg_fc2, nothing
from backdrive.control import Admittance, JointLoop
from backdrive.errors import BackdriveError, InvalidInput, ModelFileError
from backdrive.estimate.external import ExternalForce
from backdrive.estimate.friction import alg_fe
from backdrive.estimate.sliding_mode import MotionFilter
from backdrive.laws import rate_law
from backdrive.laws.base import Rate

FORMAT, SCHEMA = "backdrive-tuning", 1
MAX_BYTES = 5_000_000


@dataclass(frozen=True, kw_only=True)
class Number:
    """A parameter, and what speaks for it.

    Attributes:
        symbol: as the thesis prints it.
        value: SI.
        unit: of it.
        reason: one sentence.
        bound: what it respects, one sentence.
        limit: that bound as a number [unit]; NaN where it is none.
    """

    symbol: str
    value: float
    unit: str
    reason: str
    bound: str = ""
    limit: float = math.nan


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """The parameters of one joint.

    Attributes:
        joint: its name.
        unit: `rad` or `m`.
        goal: what they were chosen for.
        rate: rate law that is run.
        inertia: of the joint [kg.m^2 or kg].
        interval: sampling time that they are for [s].
        numbers: by name.
        scores: what the proposal, no compensation and the thesis' numbers achieve, and whether each is safe.
        margins: how far the proposal is from breaking, by name with unit.
        region: the safe region for the figure; empty where it was not asked for.
        notes: what was assumed, in sentences.
        seed: of the search.
    """

    joint: str
    unit: str
    goal: str
    rate: Rate
    inertia: float
    interval: float
    numbers: Mapping[str, Number]
    scores: Mapping[str, Any]
    margins: Mapping[str, Any]
    region: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    seed: int = 0

    def __getitem__(self, name: str) -> float:
        return self.numbers[name].value

    def compensator(self, *, dither: bool = True, switching: bool = False) -> Compensator:
        """Return the friction compensator; one that gives nothing where the goal is an estimate.

        Args:
            dither: with the proposed dither at rest, where there is any.
            switching: algFC2, whose decay rate goes up in motion, instead of algFC.
        """
        if self.goal in ("estimate", "admit"):
            return nothing()
        sine = None
        if dither and self["dither_share"] > 0.0:
            sine = Dither(share=self["dither_share"], frequency=self["dither_frequency"], mode="reset")
        if not switching:
            return alg_fc(self.rate, self["stiffness"], self["decay_rate"], sine, self["share"])
        return alg_fc2(
            self.rate,
            self["stiffness"],
            self["threshold"],
            self["decay_rate"],
            self["fast_decay"],
            self["switch_rate"],
            sine,
            self["share"],
        )

    def external(self) -> ExternalForce:
        """Return the estimator of the external force."""
        return ExternalForce(
            inertia=self.inertia,
            friction=alg_fe(self.rate, self["stiffness"], self["decay_rate"]),
            filter=MotionFilter(
                gain=self["filter_gain"],
                ratio=self["filter_ratio"],
                second_gain=self["second_filter_gain"],
                second_ratio=self["filter_ratio"],
            ),
        )

    def admittance(self) -> Admittance:
        """Return the admittance controller."""
        return Admittance(
            inertia=self["admittance_inertia"],
            viscosity=self["admittance_viscosity"],
            proportional=self["position_gain"],
            derivative=self["velocity_gain"],
        )

    def loop(self) -> JointLoop:
        """Return what runs on the joint in a torque loop."""
        return JointLoop(compensator=self.compensator(), external=self.external())


def plain(tuning: Tuning) -> dict[str, Any]:
    """Return a tuning as numbers and words alone."""
    found = {name: getattr(tuning, name) for name in ("joint", "unit", "goal", "inertia", "interval", "seed")}
    found["rate"] = {"name": tuning.rate.NAME, "parameters": tuning.rate.values()}
    found["numbers"] = {name: asdict(number) for name, number in tuning.numbers.items()}
    for name in ("scores", "margins", "region"):
        found[name] = dict(getattr(tuning, name))
    found["notes"] = list(tuning.notes)
    return _finite(found)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if hasattr(value, "tolist"):
        return _finite(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def save_tunings(tunings: Sequence[Tuning], path: str | Path) -> Path:
    """Write tunings to a JSON file, whole or not at all."""
    document = {"format": FORMAT, "schema": SCHEMA, "joints": [plain(t) for t in tunings]}
    return write_whole(path, json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def load_tunings(path: str | Path) -> tuple[Tuning, ...]:
    """Read tunings from a JSON file.

    Raises:
        ModelFileError: the file is absent, damaged or of another kind; the message says where.
    """
    path = Path(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ModelFileError(
                f"{path} is larger than {MAX_BYTES} bytes.", remedy="A tuning is a few kilobytes."
            )
        document = json.loads(path.read_bytes())
    except OSError as error:
        raise ModelFileError(f"Cannot read {path}: {error.strerror}.", remedy="Check the path.") from error
    except (ValueError, RecursionError) as error:
        raise ModelFileError(f"{path} is damaged: {error}.", remedy="Run `backdrive tune` again.") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ModelFileError(
            f"{path} is JSON, but not a tuning.", remedy="Name a file made by `backdrive tune -o`."
        )
    if document.get("schema") != SCHEMA:
        raise ModelFileError(
            f"{path}: $.schema is {document.get('schema')!r}, this version reads {SCHEMA}.",
            remedy="Upgrade backdrive, or tune again.",
        )
    found = []
    for i, joint in enumerate(document.get("joints") or [None]):
        try:
            found.append(_joint(joint))
        except BackdriveError as error:
            raise ModelFileError(f"{path}: $.joints[{i}]: {error.message}", remedy=error.remedy) from error
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ModelFileError(
                f"{path}: $.joints[{i}] is damaged: {type(error).__name__}: {error}.",
                remedy="Run `backdrive tune` again.",
            ) from error
    return tuple(found)


def _joint(joint: Any) -> Tuning:
    numbers = {}
    for name, number in joint["numbers"].items():
        value = number["value"]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise InvalidInput(f"'{name}' is {value!r}.", remedy="It must be one finite number.")
        limit = number.get("limit")
        numbers[name] = Number(
            **{**number, "value": float(value), "limit": math.nan if limit is None else limit}
        )
    rate = joint["rate"]
    values = {k: tuple(v) if isinstance(v, list) else v for k, v in rate["parameters"].items()}
    tuning = Tuning(
        joint=str(joint["joint"]),
        unit=joint["unit"],
        goal=joint["goal"],
        rate=rate_law(rate["name"])(**values),
        inertia=float(joint["inertia"]),
        interval=float(joint["interval"]),
        numbers=numbers,
        scores=joint.get("scores", {}),
        margins=joint.get("margins", {}),
        region=joint.get("region", {}),
        notes=tuple(joint.get("notes", ())),
        seed=int(joint.get("seed", 0)),
    )
    tuning.compensator()  # each looks at its numbers
    tuning.external()
    tuning.admittance()
    return tuning
