"""A population as a document: the statistics of a type of robot, random robots drawn from it, and its use as a prior."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from backdrive._files import read_whole, write_whole
from backdrive.errors import InvalidInput, ModelFileError, UnknownName

if TYPE_CHECKING:
    from backdrive.model import FrictionModel

FORMAT, SCHEMA = "backdrive-population", 1
MOST = 256 << 20  # of a file [B]
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
    """

    type: str
    joint: str
    unit: str
    robots: int
    left_out: tuple[str, ...]
    top_speed: float
    mean: Pair
    between: tuple[Pair, Pair]
    within: tuple[Pair, Pair]

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
        gain = np.array(self.between) @ np.linalg.inv(np.array(self.between) + noise + 1e-15 * np.eye(2))
        mean = np.array(self.mean) + gain @ (np.log(value) - np.array(self.mean))
        left = (np.eye(2) - gain) @ np.array(self.between)
        back = np.diag(np.exp(mean))
        return np.exp(mean), back @ left @ back


@dataclass(frozen=True, kw_only=True)
class Population:
    """Types of robots and their joints.

    Attributes:
        members: one a type and joint.
    """

    members: tuple[Member, ...]

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
        document = {"format": FORMAT, "schema": SCHEMA, "members": self.members}
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
        if document.format != FORMAT or document.schema != SCHEMA:
            raise ModelFileError(
                f"{path} is {document.format} of schema {document.schema}, not {FORMAT} of {SCHEMA}.",
                remedy="Update backdrive, or merge again.",
            )
        return cls(members=document.members)


class _Document(msgspec.Struct, forbid_unknown_fields=True):
    format: str
    schema: int
    members: tuple[Member, ...]


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
                joint=Joint(name=one.joint, unit=one.unit),  # type: ignore[arg-type]
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
