"""Settings of one joint of a torque loop: compensator, estimator and limits."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from backdrive.control import envelope, guard, readings
from backdrive.control.compensators.compensator import Compensator
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.level import Adaptation
from backdrive.control.table import (
    ANCHOR,
    AWAY,
    BEFORE,
    DUE,
    ELSEWHERE,
    ESTIMATES,
    FADE,
    GROWS,
    HALF_SPAN,
    HOLD,
    LATCHING,
    LEARNS,
    LEVEL,
    LIMIT,
    NEWER,
    NOMINAL,
    OLDER,
    PATIENCE,
    RAMP,
    RATE,
    SLACK,
    SPAN,
    TABLE,
    TEMPERATURE,
    TOP,
    UPPER,
)  # fmt: skip
from backdrive.engine.series import stack_rows
from backdrive.errors import InvalidInput, LimitWarning
from backdrive.laws import REFERENCE, Law
from backdrive.parameters import ABOVE_ZERO, BIG, NOT_NEGATIVE, Bound, WithBounds, check

MOVED = 2.5  # encoder steps from the position of rest beyond which a joint has moved; noise of one step does not count
LATCH_TIME = 0.15  # from the limit to zero when latched [s]
BRISK, LEAST_BRISK = 1000.0, 50.0  # default rate relative to F, and its least allowed value [1/s]
LARGEST = 1.5  # largest limit relative to R F(top speed) with which a runaway is stopped in time [-]
USUAL = 1.25  # default of the same [-]


def friction_of(law: Law, top_speed: float) -> tuple[float, float]:
    """Return F, the friction at rest of a law, and its friction at a speed, in the direction of less friction.

    For a law without friction at rest, F is the largest friction from 1e-4 of the speed on.

    Args:
        law: of friction.
        top_speed: the speed [rad/s or m/s].

    Returns:
        F and the friction at this speed [N.m or N].
    """
    speeds = top_speed * np.geomspace(1e-4, 1.0, 41)
    torque = np.abs(law.torque(np.concatenate([speeds, -speeds])))
    rest = 0.0 if law.rate.SMOOTH else max(law.coulomb())
    return rest or float(torque.max()), float(min(torque[40], torque[81]))


def torque_limit(compensator: Compensator, top_speed: float) -> float:
    """Return the default torque limit: 1.25 R F(v_top), increased by the dither to at most 1.5 R F(v_top).

    Args:
        compensator: compensator with friction law and share R.
        top_speed: v_top [rad/s or m/s].

    Returns:
        Limit [N.m or N]: it keeps the loop from driving a joint for long if its friction is at least half of the law's.
    """
    rest, fast = friction_of(compensator.friction.law, top_speed)
    waves = 0.0 if compensator.dither is None else compensator.dither.share * rest
    usual = USUAL * compensator.share * fast
    return min(max(usual, compensator.share * rest + waves), LARGEST * compensator.share * fast)


@dataclass(frozen=True, kw_only=True)
class JointLoop(WithBounds):
    """Settings of one joint of a torque loop: compensator, estimator and limits.

    Attributes:
        compensator: of friction.
        external: estimator of the external force; None for none.
        adaptation: of the friction level, for both compensation and estimate; None: it stays 1.
        limit: of the compensator's output [N.m or N]; `torque_limit` returns a default.
        top_speed: speed above which the joint counts as a runaway, from the robot's description or the user, never the
            fastest of a log [rad/s or m/s].
        encoder_count: step of the encoder [rad or m].
        rate: normal rate of the output [N.m/s or N/s]; None: the larger of limit/0.15 s and 1000 F/s.
        ramp: time from zero to the limit after the start, a fault or an acknowledgement, and back after `stop` [s].
        hold: time after which the compensating torque of a standing joint has fallen below 5 % [s].
        fade: rate at which the output decays while readings are rejected [1/s].
        patience: fault time after which the joint is latched; after half of it, a jump is accepted as the encoder's new zero
            [s].

    Raises:
        InvalidInput: a number lies outside the envelope (`control.envelope`), more than the whole friction would be compensated,
            or the encoder is too coarse to see the top speed.
    """

    BOUNDS: ClassVar = {
        "limit": envelope.LIMIT,
        "top_speed": envelope.TOP_SPEED,
        "encoder_count": envelope.COUNT,
        "ramp": envelope.RAMP,
        "hold": envelope.HOLD,
        "fade": envelope.FADE,
        "patience": envelope.PATIENCE,
    }

    compensator: Compensator = field(default_factory=Compensator)
    external: ExternalForce | None = None
    adaptation: Adaptation | None = None
    limit: float
    top_speed: float
    encoder_count: float
    rate: float | None = None
    ramp: float = 0.5
    hold: float = 0.5
    fade: float = 50.0
    patience: float = 0.1

    def __post_init__(self):
        self._check_adaptation()
        super().__post_init__()
        numbers = {"share": self.compensator.share * max(1.0, self._highest()), "friction": self.friction[0]}
        if self.external is not None:
            numbers["inertia"] = self.external.inertia
        check("JointLoop", envelope.OF_PARTS, numbers)
        if self.compensator.share > 0.0:
            stiffness = getattr(self.compensator.friction.law.element, "stiffness", 0.0)
            envelope.check_contact("JointLoop", stiffness, self.encoder_count, self.friction[0])
        self._check_resolution()
        least = max(self.limit / LATCH_TIME, LEAST_BRISK * self.friction[0])
        if self.rate is not None:  # a slower output is noticeable to the hand and stops too late
            check("JointLoop", {"rate": Bound(least, BIG, "N.m/s or N/s")}, {"rate": self.rate})
        most = LARGEST * self.compensator.share * self.friction[1]
        if most > 0.0 and self.limit > most * (1.0 + 1e-9):
            usual = torque_limit(self.compensator, self.top_speed)
            warnings.warn(
                f"JointLoop: limit = {self.limit:g} exceeds 1.5 R F(top speed) = {most:.4g} N.m or N: if the "
                f"model's friction is much too large, the watch cannot stop the joint in time. `torque_limit` gives "
                f"{usual:.4g}.",
                LimitWarning,
                stacklevel=3,
            )

    def _check_adaptation(self) -> None:
        if self.adaptation is None:
            return
        if self.external is None:
            raise InvalidInput(
                "The level of friction is learned from the estimated external force.",
                remedy="Give the loop an `ExternalForce`.",
            )
        if isinstance(self.compensator.extra, (BristleObserver, DisturbanceObserver)):
            raise InvalidInput(
                f"{type(self.compensator.extra).__name__} adapts by itself.",
                remedy="Give the loop only one of the two.",
            )
        self.adaptation.row(self.external.friction.law)

    def _highest(self) -> float:
        """Return the largest factor on the friction that adaptation can reach [-]."""
        extra = self.compensator.extra
        if isinstance(extra, BristleObserver) and extra.adaptation > 0.0:
            return extra.highest
        return self.adaptation.upper if self.adaptation else 1.0

    def _check_resolution(self) -> None:
        """Refuse an encoder if one step in the shortest window of speeds is more than a tenth of the top speed."""
        least = self.encoder_count / (envelope.COARSEST * guard.WINDOW)
        if least > self.top_speed * (1.0 + 1e-9):
            raise InvalidInput(
                f"JointLoop: one encoder step of {self.encoder_count:g} in {1e3 * guard.WINDOW:g} ms is more than a tenth of the "
                f"top speed of {self.top_speed:g}: the encoder is too coarse to detect a runaway.",
                remedy=f"Give a top speed of {least:.4g} or more, or use a finer encoder.",
            )

    @cached_property
    def friction(self) -> tuple[float, float]:
        """F at rest of the compensator's law, and its friction at the top speed [N.m or N]."""
        return friction_of(self.compensator.friction.law, min(self.top_speed, envelope.TOP_SPEED[1]))

    @property
    def normal_rate(self) -> float:
        """Rate that the output never exceeds [N.m/s or N/s]."""
        return max(self.limit / LATCH_TIME, BRISK * self.friction[0]) if self.rate is None else self.rate

    @property
    def slow_rate(self) -> float:
        """Rate at which the output grows after a start or a fault, and falls after a stop [N.m/s or N/s]."""
        return self.limit / self.ramp

    @property
    def latch_rate(self) -> float:
        """Rate at which the output of a latched joint falls [N.m/s or N/s]."""
        return self.limit / LATCH_TIME

    def guards(self) -> dict[int, float]:
        """Return the settings by row of the table."""
        return {
            TOP: self.top_speed,
            LIMIT: self.limit,
            RATE: self.normal_rate,
            RAMP: self.slow_rate,
            LATCHING: self.latch_rate,
            HOLD: self.hold,
            FADE: self.fade,
            PATIENCE: self.patience,
            AWAY: MOVED * self.encoder_count,
        }


@dataclass(frozen=True, kw_only=True)
class BareLoop(JointLoop):
    """Compensator and estimator without guards, for simulation only. A `Loop` refuses it.

    Attributes:
        limit: as in a `JointLoop`; here each guard is off unless it is given.
        top_speed: likewise.
        encoder_count: likewise.
        ramp: likewise; 0: the output may jump to the limit.
        hold: likewise.
        patience: likewise.
    """

    BOUNDS: ClassVar = dict.fromkeys(
        ("limit", "top_speed", "fade", "patience", "hold"), ABOVE_ZERO
    ) | dict.fromkeys(("ramp", "encoder_count"), NOT_NEGATIVE)

    limit: float = np.inf
    top_speed: float = np.inf
    encoder_count: float = 0.0
    ramp: float = 0.0
    hold: float = np.inf
    patience: float = np.inf

    def __post_init__(self):
        self._check_adaptation()
        WithBounds.__post_init__(self)

    @property
    def normal_rate(self) -> float:
        """Rate that the output never exceeds, infinite where none is given [N.m/s or N/s]."""
        return np.inf if self.rate is None else self.rate

    @property
    def slow_rate(self) -> float:
        """Rate at which the output grows after a start or a fault, infinite for no ramp [N.m/s or N/s]."""
        return self.limit / self.ramp if self.ramp > 0.0 else np.inf


def concatenate(parts: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the arrays of `rows` (without the table) as one array, (J, n), and five places in it, (5,).

    The places are the starts of the arrays whose length depends on the law, and the end. They are one array because each
    further argument of a tick would take as much time as a law.
    """
    C, P, X, S, CE, PE, XE, SE = parts
    lengths = [sum(part.shape[1] for part in (C, S, CE, SE)), *(part.shape[1] for part in (P, X, PE, XE))]
    return np.concatenate([C, S, CE, SE, P, X, PE, XE], axis=1), np.cumsum(lengths)


def rows(joints: Sequence[JointLoop], positions: np.ndarray, dt: float) -> tuple[np.ndarray, ...]:
    """Return what `loop.tick` reads and writes for joints at rest: C, P, X, S, CE, PE, XE, SE and the table.

    Args:
        joints: settings of each joint.
        positions: where they rest [rad or m], (J,).
        dt: period [s].
    """
    J = len(joints)
    estimators = [j.external or ExternalForce(inertia=1.0) for j in joints]
    by_joint = np.zeros((J, TABLE))  # the numbers of a joint lie together
    table = by_joint.T
    table[NOMINAL], table[TEMPERATURE], table[LEVEL] = dt, REFERENCE, 1.0
    table[SPAN], table[HALF_SPAN] = guard.spans(dt)
    table[DUE] = table[HALF_SPAN]
    for row in (BEFORE, ELSEWHERE, OLDER, NEWER, ANCHOR):
        table[row] = positions
    for k, (joint, estimator) in enumerate(zip(joints, estimators, strict=True)):
        for row, value in joint.guards().items():
            table[row, k] = value
        table[SLACK, k] = readings.slack(joint.top_speed, joint.encoder_count, dt)
        table[ESTIMATES, k] = float(joint.external is not None)
        laws = (joint.compensator.friction.law, estimator.friction.law)
        table[GROWS, k] = float(any(law.growth is not None for law in laws))
        if joint.adaptation is not None:
            table[LEARNS : UPPER + 1, k] = joint.adaptation.row(estimator.friction.law)
            table[LEVEL, k] = joint.adaptation.start
    of_parts: list[Any] = []
    for parts in ([j.compensator for j in joints], estimators):
        laws = [part.friction.law for part in parts]
        P, X = stack_rows([law.row() for law in laws]), stack_rows([law.state() for law in laws])
        C = np.array([part.row(dt) for part in parts])
        S = np.array([part.start(float(q)) for part, q in zip(parts, positions, strict=True)])
        of_parts += [C, P, X, S]
    return (*of_parts, by_joint)
