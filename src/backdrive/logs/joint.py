"""Metadata of a log: its joints, the drive and the source files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from backdrive._arguments import NUMBER, TABLE, WORD, check_arguments, optional
from backdrive._documents import as_list
from backdrive.errors import InvalidInput

ARGUMENTS = {
    "name": WORD,
    "unit": WORD,
    "torque_side": WORD,
    "gear_ratio": NUMBER,
    "encoder_counts": optional(NUMBER),
}
DRIVE_LAWS = ("torque", "velocity", "position", "voltage", "duty")


@dataclass(frozen=True, kw_only=True)
class Joint:
    """Metadata of one joint.

    Attributes:
        name: as in the robot's description.
        unit: `rad` (torque in N.m) or `m` (force in N).
        torque_side: side of the gear that the torque channel is measured on.
        gear_ratio: motor turns per joint turn [1]; with `torque_side="motor"`, joint torque = ratio * torque.
        encoder_counts: counts per rad or per m at the joint [1/rad or 1/m], if known.
        named: the name is from the data or the user; False: it is a default name. None: unknown.
    """

    name: str
    unit: Literal["rad", "m"] = "rad"
    torque_side: Literal["joint", "motor"] = "joint"
    gear_ratio: float = 1.0
    encoder_counts: float | None = None
    named: bool | None = field(default=None, compare=False)

    def __post_init__(self):
        check_arguments(ARGUMENTS, vars(self))
        if self.unit not in ("rad", "m"):
            raise InvalidInput(
                f"Joint '{self.name}': the unit is '{self.unit}'.", remedy="It must be rad or m."
            )
        if not 0.0 < abs(self.gear_ratio) < np.inf:
            raise InvalidInput(
                f"Joint '{self.name}': the gear ratio is {self.gear_ratio}.",
                remedy="Give motor turns per joint turn.",
            )
        if self.encoder_counts is not None and not 0.0 < self.encoder_counts < np.inf:
            raise InvalidInput(
                f"Joint '{self.name}': {self.encoder_counts} encoder counts per {self.unit}.",
                remedy="Give a positive number.",
            )

    @property
    def torque_unit(self) -> str:
        """N.m for a rotary joint, N for a linear one."""
        return "N.m" if self.unit == "rad" else "N"


@dataclass(frozen=True, kw_only=True)
class Drive:
    """The law by which `drive_input` moves the joint.

    Attributes:
        law: `torque`, `velocity`, `position`, `voltage` or `duty`.
        gains: by name, SI units [-].
    """

    law: Literal["torque", "velocity", "position", "voltage", "duty"]
    gains: Mapping[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self):
        check_arguments({"law": WORD, "gains": TABLE}, vars(self))
        if self.law not in DRIVE_LAWS:
            raise InvalidInput(
                f"A drive's law is {self.law!r}.", remedy=f"Give one of {', '.join(DRIVE_LAWS)}."
            )
        for name, gain in self.gains.items():
            check_arguments({name: NUMBER}, {name: gain})


@dataclass(frozen=True, kw_only=True)
class Source:
    """The file a log came from.

    Attributes:
        path: as the person named it.
        sha256: digest of the file's bytes.
    """

    path: str
    sha256: str


def as_joints(joints: Sequence[Joint | str] | Joint | str) -> tuple[Joint, ...]:
    """Return joints; a name stands for a rotary one.

    Raises:
        InvalidInput: something is neither a joint nor a name.
    """
    several = (joints,) if isinstance(joints, (str, Joint)) else tuple(as_list(joints))
    # a person gives them
    if wrong := [joint for joint in several if not isinstance(joint, (str, Joint)) or joint == ""]:  # pyright: ignore[reportUnnecessaryIsInstance]
        raise InvalidInput(f"A joint is {wrong[0]!r}.", remedy="Give names, or Joint(name=...).")
    return tuple(Joint(name=joint, named=True) if isinstance(joint, str) else joint for joint in several)


def check_coupling(coupling: Sequence[Sequence[float]] | np.ndarray, size: int) -> np.ndarray:
    """Return C of q_joint = C q_motor as an array, (J, J).

    Args:
        coupling: rows in the order of the joints.
        size: number of joints J.

    Raises:
        InvalidInput: it is not an invertible matrix of the joints' size.
    """
    try:
        matrix = np.array(coupling, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape == (size, size) and np.all(np.isfinite(matrix)):
        scale = np.abs(matrix).max(initial=0.0)
        if scale > 0 and np.linalg.matrix_rank(matrix / scale) == size:
            return matrix
    shape = "x".join(map(str, matrix.shape)) if matrix.ndim == 2 else "no matrix"
    raise InvalidInput(
        f"The coupling of {size} joints is no invertible matrix of {size} rows and columns ({shape}).",
        remedy="Give C of q_joint = C q_motor, a row for each joint and a column for each motor.",
    )


def coupling_between(
    coupling: Sequence[Sequence[float]], names: Sequence[str], joints: Sequence[str]
) -> np.ndarray:
    """Return C of q_joint = C q_motor for joints in another order, each with the motor that mainly moves it, (J, J).

    Args:
        coupling: rows of the joints `names`, columns of motors.
        names: of the rows.
        joints: of the rows and columns wanted, some or all of them.

    Raises:
        InvalidInput: a motor drives one of these joints and another one, too.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    matrix = np.array(coupling, dtype=np.float64)
    share = np.log(np.maximum(np.abs(matrix), 1e-12)) + 1e-6 * np.eye(len(matrix))
    motor = min_weight_full_bipartite_matching(csr_array(share.max() + 1.0 - share))[1]
    rows = [list(names).index(joint) for joint in joints]
    rest = [i for i in range(len(matrix)) if i not in rows]
    if np.any(matrix[np.ix_(rest, motor[rows])]) or np.any(matrix[np.ix_(rows, motor[rest])]):
        raise InvalidInput(
            f"The coupling ties joints of the robot to {', '.join(names[i] for i in rest)}.",
            remedy="Name a robot description with all coupled joints.",
        )
    return matrix[np.ix_(rows, motor[rows])]


def digest(path: str | Path) -> str:
    """Return the sha256 of a file's bytes, as hexadecimal text."""
    import hashlib

    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
