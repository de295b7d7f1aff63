"""A population as a document: the statistics of a type of robot, random robots drawn from it, and its use as a prior."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np

from backdrive._files import read_whole, write_whole
from backdrive.errors import InvalidInput, ModelFileError, UnknownName

if TYPE_CHECKING:
    from backdrive.model import FrictionModel, Prior

FORMAT, SCHEMA = "backdrive-population", 2
OLDER = 1  # older schema, without temperatures: its fields all exist in the present one
MOST = 256 << 20  # of a file [B]
MOST_LOGS = 100_000  # that are kept by digest; one of more weighs nothing
Pair = tuple[float, float]


class Member(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One joint of one type.

    Attributes:
        type: of the robots; empty if unknown.
        joint: its name.
        unit: `rad` or `m`.
        robots: number of robots.
        left_out: robots that are unlike the others.
        top_speed: up to which it holds [rad/s or m/s].
        mean: of the logarithms of constant [N.m or N] and viscous part [N.m.s/rad or N.s/m].
        between: covariance of the logarithms from robot to robot, (2, 2).
        within: covariance of a robot's logarithms from day to day, (2, 2).
        temperature: at which the mean holds [degC]; None: unknown.
        warmth: change of the logarithms with temperature [1/degC].
    """

    type: str
    joint: str
    unit: Literal["rad", "m"]
    robots: Annotated[int, msgspec.Meta(ge=1)]
    left_out: tuple[str, ...]
    top_speed: Annotated[float, msgspec.Meta(gt=0)]
    mean: Pair
    between: tuple[Pair, Pair]
    within: tuple[Pair, Pair]
    temperature: float | None = None
    warmth: Pair = (0.0, 0.0)

    def prior(self, logs: tuple[str, ...] = ()) -> Prior:
        """Return what is known of a further robot before its first log: the mean robot, and the spread between robots and days.

        The error of the mean is part of the spread. Beyond constant and viscous part, such as on the difference of both
        directions, the population says nothing.

        Args:
            logs: of the population, by digest.
        """
        from backdrive.model.prior import Prior, both_ways

        velocity, weights = both_ways(self.top_speed)
        mean, force = np.exp(self.mean), {"rad": "N.m", "m": "N"}[self.unit]
        spread = np.array(self.between) * (1.0 + 1.0 / self.robots) + np.array(self.within)
        return Prior(
            joint=self.joint,
            unit=self.unit,
            source=f"population of {self.robots} robots" + (f" of type {self.type}" if self.type else ""),
            names=("constant", "viscous"),
            units=(force, f"{force}.s/{self.unit}"),
            velocity=velocity,
            weights=weights,
            mean=mean,
            covariance=spread * np.outer(mean, mean),
            robots=self.robots,
            slopes=(False, True),
            temperature=self.temperature,
            warmth=self.warmth,
            logs=logs,
        )

    def posterior(
        self, constant: float, viscous: float, covariance: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return constant and viscous part of a robot after one log, with the population as prior, (2,), and covariance, (2,
        2).

        Args:
            constant: of the log [N.m or N].
            viscous: of the log [N.m.s/rad or N.s/m].
            covariance: of both, (2, 2).

        Raises:
            InvalidInput: a number is not positive, or the covariance is none.
        """
        from backdrive.identification.conjugate import conjugate

        value, C = np.array([constant, viscous], dtype=float), np.asarray(covariance, dtype=float)
        if not (
            np.all(value > 0)
            and C.shape == (2, 2)
            and np.all(np.isfinite(C))
            and np.all(np.linalg.eigvalsh(C) >= 0)
        ):
            raise InvalidInput(
                f"constant = {constant}, viscous = {viscous}, covariance = {C.tolist()}.",
                remedy="Give positive numbers and their covariance.",
            )
        scale = np.diag(1.0 / value)
        noise = scale @ C @ scale.T + np.array(self.within)
        y, eye = np.log(value), np.eye(2)
        after = conjugate(np.array(self.mean), np.array(self.between), eye, np.array(self.mean), y, noise)
        back = np.diag(np.exp(after.mean))
        return np.exp(after.mean), back @ after.covariance @ back


@dataclass(frozen=True, kw_only=True)
class Population:
    """Types of robots and their joints.

    Attributes:
        members: one a type and joint.
        logs: first digits of the SHA-256 of its log files, so that none of them is combined with it; empty if there are more
            than 100,000.
    """

    members: tuple[Member, ...]
    logs: tuple[str, ...] = ()

    def of(self, type: str = "") -> list[Member]:
        """Return the joints of a type.

        Raises:
            UnknownName: there is no such type.
        """
        kinds = sorted({one.type for one in self.members})
        if type not in kinds:
            raise UnknownName(
                f"There is no type '{type}'.", remedy=f"There are: {', '.join(map(repr, kinds))}."
            )
        return [one for one in self.members if one.type == type]

    def priors(self, type: str | None = None) -> tuple[Prior, ...]:
        """Return what is known of a further robot of a type before its first log, one entry a joint, for `identify(prior=)`.

        Args:
            type: of the robot; None: the only one.

        Raises:
            InvalidInput: there are several types and none is given.
            UnknownName: there is no such type.
        """
        kinds = sorted({one.type for one in self.members})
        if type is None and len(kinds) > 1:
            raise InvalidInput(
                f"The population has {len(kinds)} types: {', '.join(map(repr, kinds))}.",
                remedy="Name that of the robot: --prior-type TYPE, or population.priors(type).",
            )
        return tuple(one.prior(self.logs) for one in self.of(kinds[0] if type is None else type))

    def model(self, type: str = "") -> FrictionModel:
        """Return the mean robot of a type; standard errors and covariance are the spread between robots."""
        members = self.of(type)
        return _model(members, [np.array(one.mean) for one in members])

    def sample(self, count: int, *, type: str = "", seed: int = 0) -> list[FrictionModel]:
        """Return random robots of a type, drawn from the population.

        Args:
            count: number of robots.
            type: of them.
            seed: of the draws.
        """
        members, draws = self.of(type), np.random.default_rng(seed)
        return [
            _model(
                members, [draws.multivariate_normal(one.mean, one.between, method="eigh") for one in members]
            )
            for _ in range(count)
        ]

    def save(self, path: str | Path) -> None:
        """Write it as JSON, whole or not at all."""
        document = {"format": FORMAT, "schema": SCHEMA, "members": self.members, "logs": self.logs}
        write_whole(path, msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n")

    @classmethod
    def load(cls, path: str | Path) -> Population:
        """Read it.

        Raises:
            ModelFileError: the file is absent, damaged or of a newer schema.
        """
        text = read_whole(path, MOST, error=ModelFileError)
        try:
            document = msgspec.json.decode(text, type=_Document)
        except (msgspec.MsgspecError, UnicodeDecodeError) as error:
            raise ModelFileError(
                f"{path} is no population ({error}).", remedy="Make it with `backdrive fleet merge`."
            ) from error
        if document.format != FORMAT or document.schema not in (OLDER, SCHEMA):
            raise ModelFileError(
                f"{path} is {document.format} of schema {document.schema}, not {FORMAT} of {OLDER} or {SCHEMA}.",
                remedy="Update backdrive, or merge again.",
            )
        return cls(members=document.members, logs=document.logs)


def is_population(path: str | Path) -> bool:
    """Return whether a file says of itself that it is a population.

    Raises:
        ModelFileError: it cannot be read.
    """
    try:
        return msgspec.json.decode(read_whole(path, MOST, error=ModelFileError), type=_Head).format == FORMAT
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return False


class _Head(msgspec.Struct):
    format: str = ""


class _Document(msgspec.Struct, forbid_unknown_fields=True):
    format: str
    schema: int
    members: tuple[Member, ...]
    logs: tuple[str, ...] = ()


def _model(members: list[Member], logarithms: list[np.ndarray]) -> FrictionModel:
    from backdrive.laws import CoulombViscous, Law
    from backdrive.logs.joint import Joint
    from backdrive.model import FrictionModel, JointFriction
    from backdrive.model.covariance import Covariance
    from backdrive.model.joint_friction import Validity

    joints = []
    for one, logarithm in zip(members, logarithms, strict=True):
        constant, viscous = (float(x) for x in np.exp(logarithm))
        scale = np.diag([constant, viscous])
        between = scale @ np.array(one.between) @ scale
        spread = np.sqrt(np.diag(between))
        rate = CoulombViscous(
            coulomb_positive=constant,
            coulomb_negative=constant,
            viscous_positive=viscous,
            viscous_negative=viscous,
        )
        names = {"coulomb": spread[0], "viscous": spread[1]}
        rows = [f"{name}_{way}" for way in ("positive", "negative") for name in names]
        joints.append(
            JointFriction(
                joint=Joint(name=one.joint, unit=one.unit),
                law=Law(rate=rate),
                standard_errors={
                    f"{n}_{way}": float(v) for n, v in names.items() for way in ("positive", "negative")
                },
                covariance=Covariance.of(rows, np.tile(between, (2, 2))),  # both directions are the same
                validity=Validity(velocity=(-one.top_speed, one.top_speed)),
                method=f"population of {one.robots} robots",
            )
        )
    return FrictionModel(joints=tuple(joints))
