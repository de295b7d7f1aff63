"""The result of an identification: the model, and the evidence for the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive._upper import Display, check_page, upper
from backdrive.errors import InvalidInput
from backdrive.identification.residual import Residual
from backdrive.model import Bands, FrictionModel

if TYPE_CHECKING:
    from backdrive.identification.arm_forecast import StandardError
    from backdrive.identification.dynamic.choice import Choice


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Measured and predicted samples, thinned to a few thousand for pictures.

    Attributes:
        time: instants [s], (n,).
        position: joint position [rad or m], (n,); NaN where the log has none.
        velocity: joint velocity [rad/s or m/s], (n,).
        torque: measured actuator torque [N.m or N], (n,).
        friction: measured torque minus all identified terms but friction [N.m or N], (n,).
        predicted: the model's total torque [N.m or N], (n,).
        fitted: True for fitted samples, False for held-out ones, (n,).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    friction: np.ndarray
    predicted: np.ndarray
    fitted: np.ndarray

    @property
    def residual(self) -> np.ndarray:
        """Measured minus predicted torque [N.m or N], (n,)."""
        return self.torque - self.predicted


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A friction curve with its confidence band.

    Attributes:
        velocity: sorted, both directions [rad/s or m/s], (m,).
        torque: friction [N.m or N], (m,).
        standard_error: of `torque` [N.m or N], (m,); NaN if unknown.
    """

    velocity: np.ndarray
    torque: np.ndarray
    standard_error: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class JointEvidence:
    """The evidence for one joint's result.

    Attributes:
        joint: its name.
        samples: measured and predicted samples.
        curve: the friction curve with its band.
        verdict: the result in one or two sentences for a person.
        presliding: None, or displacement [rad or m] and torque [N.m or N] of a ramp, (n, 2).
        bands: deviation of measured from predicted torque, by state of motion.
        long_run: standard deviation of the torque residual's mean over one second [N.m or N].
        residual: the torque residual in short means; None if the method has none.
        precision: expected and achieved standard errors of the joint's friction and its link's bodies; method `arm` only.
        unplaced: amplitude of gravity that was fitted along an integrated velocity and is no part of the model [N.m]; 0 if none.
        controller_step: (h, K_p h/2, K_d h/2): step at which a simulated position controller acted [s], which nobody gave, and the
            damping [N.m.s/rad or N.s/m] and inertia [kg.m^2 or kg] that this takes from a joint whose controller always acts on an
            input that is late by h/2 at least; None without a controller.
    """

    joint: str
    samples: Samples
    curve: Curve
    verdict: str
    presliding: np.ndarray | None = None
    bands: Bands | None = None
    long_run: float | None = None
    residual: Residual | None = None
    precision: tuple[StandardError, ...] = ()
    unplaced: float = 0.0
    controller_step: tuple[float, float, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Identification(Display):
    """The outcome of `identify`.

    Attributes:
        model: the friction model.
        evidence: one entry per joint, in the model's order.
        method: the method used.
        reason: reason for the method, in a sentence.
        warnings: what makes the whole result suspect, in sentences.
        notes: changes of the data by readers and repairs, in sentences.
        choices: laws tried by a search, one entry per joint, in the model's order.
        intervals: 95 % intervals of all parameters estimated by a search, by joint and name [SI].
        stopped: a person interrupted the search; this is the best result so far.
    """

    model: FrictionModel
    evidence: tuple[JointEvidence, ...]
    method: str
    reason: str
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    choices: tuple[Choice, ...] = ()
    intervals: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    stopped: bool = False

    def __repr__(self) -> str:
        return f"<Identification of {', '.join(self.model.names)} by {self.method}>"

    def report(self, path: str | Path, *, command: str = "", title: str | None = None) -> Path:
        """Write the report: one HTML file with curves, residuals, warnings and the origin of the data.

        Args:
            path: of the file.
            command: the command that produced the result, to be copied.
            title: of the report.

        Raises:
            InvalidInput: `path` names no file, or one that is no HTML page.
            MissingExtra: matplotlib is not installed.
            WriteError: the file cannot be written.
        """
        check_page(path)
        command = command or f"identify(..., method={self.method!r})  # in Python"
        return upper("report", "write_report")(self, path, command=command, title=title)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values: the document of the model file, with method, reason, verdicts, warnings and notes."""
        from backdrive.identification.quality import grade

        return {
            "model": self.model.to_dict(),
            "method": self.method,
            "reason": self.reason,
            "verdicts": {f.joint.name: grade(f).word for f in self.model.joints},
            "warnings": list(self.warnings),
            "notes": list(self.notes),
        }

    def choice(self, joint: str | int = 0) -> Choice:
        """Return the choice between laws of one joint, by name or position.

        Raises:
            UnknownName: there is no such joint.
            InvalidInput: the method was not a search.
        """
        name = self.model.joint(joint).joint.name
        for choice in self.choices:
            if choice.joint == name:
                return choice
        raise InvalidInput(
            f"No laws were searched for joint '{name}' (method {self.method}).",
            remedy="Identify with law='auto', or with the laws to choose between.",
        )
