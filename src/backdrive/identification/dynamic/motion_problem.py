"""Motion given the drive's input: the residuals of a law, an axis and its drive by forward dynamics.

The joint with its drive is simulated under the recorded input, from the measured initial state of every log. The result is
compared with the measured motion. One call of the engine simulates all logs for a batch of parameter sets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

import numpy as np

from backdrive.engine import Axis, drives
from backdrive.engine import axis as axis_
from backdrive.engine.cores import spread
from backdrive.engine.forward import loop_of
from backdrive.engine.series import stack_rows
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.dynamic.motion_log import MotionLog
from backdrive.identification.dynamic.motion_terms import Range, assemble, column
from backdrive.identification.dynamic.problem import Problem
from backdrive.identification.dynamic.unknowns import LawShape, Scales, Unknown
from backdrive.laws import REFERENCE

FLEXIBLE = (
    "offset",
    "gravity_sin",
    "gravity_cos",
    "drive.delay",
)  # may be 0; their errors are compared with the range


class MotionProblem(Problem):
    """Residuals of measured motion by forward dynamics, for batches of candidates.

    Args:
        shape: shape of the law to fit.
        logs: of one axis.
        axis: the axis with its known parameters; its law is not used.
        free: ranges of the estimated parameters, by name (`motion_terms`). For parameters of the law without a range, it
            follows from the data.
        signal: the compared signal.
        substeps: number of integration steps per sample.
        scales: typical sizes, which determine the ranges; None: from the data.
        unit: of the axis, `rad` or `m`.
        workers: number of threads; None: one per core.

    Raises:
        InvalidInput: no logs, a velocity that was not recorded, or invalid ranges.
        NotIdentifiable: the axis never moves.
    """

    STEP: ClassVar[float] = 1e-4

    def __init__(
        self,
        shape: LawShape,
        logs: Sequence[MotionLog],
        axis: Axis,
        free: Mapping[str, Range] | None = None,
        *,
        signal: Literal["position", "velocity"] = "position",
        substeps: int = 1,
        scales: Scales | None = None,
        unit: str = "rad",
        workers: int | None = None,
    ):
        if not logs or signal not in ("position", "velocity") or substeps < 1:
            raise InvalidInput(
                f"{len(logs)} logs, signal = {signal!r}, substeps = {substeps}.",
                remedy="Give at least one log; compare `position` or `velocity`; substeps >= 1.",
            )
        lacking = [log.name for log in logs if signal == "velocity" and log.velocity is None]
        if lacking:
            raise InvalidInput(
                f"No velocity was recorded in {', '.join(lacking)}.", remedy="Compare the position instead."
            )
        if max(float(np.ptp(log.position)) for log in logs) == 0.0:
            raise NotIdentifiable(
                "The axis never moves, so its friction cannot be identified.",
                remedy="Record a motion with reversals.",
            )
        self.axis, self.free, self.unit = axis, dict(free or {}), unit
        self.signal: Literal["position", "velocity"] = signal
        self.substeps, self.workers = substeps, workers
        self.scales = scales_of(logs, axis, unit) if scales is None else scales
        courses = sorted({name for log in logs for name in log.shapes})
        self.terms = assemble(shape, self.scales, self.free, len(logs), courses)
        super().__init__(shape, self.terms.unknowns, self.terms.start)
        self.setters = [self._setter(u) for u in self.unknowns[self.terms.of_law :]]
        self.logs = list(logs)
        self._groups = self._group_logs()

    def on(self, logs: Sequence[MotionLog]) -> MotionProblem:
        """Return the same problem for other logs."""
        return MotionProblem(
            self.shape,
            logs,
            self.axis,
            self.free,
            signal=self.signal,
            substeps=self.substeps,
            scales=self.scales,
            unit=self.unit,
            workers=self.workers,
        )

    def _setter(self, u: Unknown) -> tuple[str, int, int, str]:
        """Return where an unknown enters the simulation: kind, column, log and name."""
        plain, _, place = u.name.partition("[")
        if plain.startswith("start."):
            return "start", 0 if plain == "start.position" else 1, int(place[:-1]), ""
        if plain == "drive.proportional_factor":
            return "factor", 0, 0, ""
        if plain.startswith("shape."):
            return "shape", 0, 0, plain[6:]
        if plain.startswith("drive."):
            return "drive", column(self.axis.drive, plain[6:], u.lower, u.upper), 0, ""
        return "axis", column(self.axis, plain, u.lower, u.upper), 0, ""

    def _group_logs(self):
        """Return groups of logs with equal sampling time; shorter logs are extended by their last values."""
        groups = []
        for dt in sorted({log.dt for log in self.logs}):
            which = [k for k, log in enumerate(self.logs) if log.dt == dt]
            logs = [self.logs[k] for k in which]
            n = max(len(log.position) for log in logs)

            def channel(name, default, logs=logs, n=n):
                if all(getattr(log, name) is None for log in logs):
                    return np.full((len(logs), 1), default)
                given = [getattr(log, name) for log in logs]
                return np.array(
                    [np.full(n, default) if g is None else np.pad(g, (0, n - len(g)), "edge") for g in given]
                )

            groups.append(
                {
                    "dt": dt,
                    "which": which,
                    "n": n,
                    "input": channel("drive_input", 0.0),
                    "supply": channel("supply", np.nan),
                    "enabled": channel("enabled", 1.0),
                    "temperature": channel("temperature", REFERENCE),
                    "start": np.array([[log.position[0], log.launch] for log in logs]),
                    "proportional": [log.proportional for log in logs],
                }
            )
        return groups

    def series(self, records: Sequence[MotionLog] | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the measured motion [rad, m, rad/s or m/s] and the samples that count, (n,) each."""
        return [
            (getattr(log, self.signal), log.counts) for log in (self.logs if records is None else records)
        ]

    def yardstick(self, unknown: Unknown) -> tuple[float, float]:
        """Return the smallest and the largest value that the error of an unknown is compared with [SI]."""
        loose = unknown.name in FLEXIBLE or unknown.name.startswith("start.")
        return 0.1 * (unknown.upper - unknown.lower) if loose else 0.0, np.inf

    def axis_of(self, values: Mapping[str, float]) -> Axis:
        """Return the axis with law and drive for given parameter values."""
        names = self.names[self.terms.of_law :]
        own = {n: values[n] for n in names if not n.startswith(("drive.", "start.", "shape."))}
        of_drive = {n[6:]: values[n] for n in names if n.startswith("drive.")}
        factor = of_drive.pop("proportional_factor", 1.0)
        drive = self.axis.drive.replace(**of_drive)
        return self.axis.replace(
            **own,
            law=self.shape.law(values),
            drive=drive.replace(proportional=drive.proportional * factor),
        )

    def predict(
        self,
        values: Sequence[Mapping[str, float]],
        records: Sequence[MotionLog] | None = None,
        *,
        friction: bool = False,
    ) -> list[np.ndarray]:
        """Return the motion that parameter sets predict for every log [rad, m, rad/s or m/s], each (B, n).

        Logs that were not fitted start from their measured initial states.
        """
        if records is not None:
            other = self.on(records)
            measured = {n: 0.0 for n in other.names if n.startswith("start.")}
            return other.predict([{**v, **measured} for v in values])
        B = len(values)
        J, D = np.tile(self.axis.row(), (B, 1)), np.tile(self.axis.drive.row(), (B, 1))
        factor, start = np.ones(B), np.zeros((B, len(self.logs), 2))
        sizes: dict[str, np.ndarray] = {}
        table = np.array([[v[n] for n in self.names[self.terms.of_law :]] for v in values]).reshape(B, -1)
        for (kind, at, log, name), numbers in zip(self.setters, table.T, strict=True):
            if kind == "axis":
                J[:, at] = numbers
            elif kind == "drive":
                D[:, at] = numbers
            elif kind == "factor":
                factor = numbers
            elif kind == "shape":
                sizes[name] = numbers
            else:
                start[:, log, at] = numbers
        rows: list[np.ndarray | None] = []
        nonsense, states, law = np.zeros(B, dtype=bool), 2, None
        for i, v in enumerate(values):
            try:
                law = self.shape.law(v)
                rows.append(law.row())
                states = max(states, law.state().size)
            except InvalidInput:
                nonsense[i] = True
                rows.append(None)
        if law is None:
            return [np.full((B, len(log.position)), np.nan) for log in self.logs]
        valid = law.row()  # in the place of those that no law has
        P = stack_rows([valid if row is None else row for row in rows])
        out: list[np.ndarray] = [np.empty(0)] * len(self.logs)
        for group in self._groups:
            motion = self._run(group, law, P, states, J, D, factor, start, sizes)
            for m, k in enumerate(group["which"]):
                out[k] = motion[m, :, : len(self.logs[k].position), 0 if self.signal == "position" else 1]
                out[k][nonsense] = np.nan
        return out

    def _run(self, group, law, P, states, J, D, factor, start, sizes):
        """Return the motions of a group, (M, B, n, 3). The sets of one log stand side by side: they move alike, in lockstep."""
        B, M, n = len(P), len(group["which"]), group["n"]
        gain = (
            np.array([[D[i, 2] if k is None else k for k in group["proportional"]] for i in range(B)])
            * factor[:, None]
        )
        D, J, P = (np.tile(x, (M, 1)) for x in (D, J, P))
        D[:, 2] = gain.T.ravel()
        at = (group["start"] + start[:, group["which"]]).swapaxes(0, 1).reshape(-1, 2)
        S = np.empty((B * M, axis_.STATES))
        S[:, 0] = S[:, 2] = at[:, 0]
        S[:, 1] = S[:, 3] = at[:, 1]
        S[:, 4] = J[:, 4] * np.sin(at[:, 0]) + J[:, 5] * np.cos(at[:, 0]) + J[:, 9]
        yields = J[:, 6] == 0.0
        S[yields, 2] -= S[yields, 4] / J[yields, 2]  # initial deflection: the transmission carries gravity
        rates, elements = np.full(B * M, law.rate.KIND), np.full(B * M, law.element.KIND)
        X, C, out = np.zeros((B * M, states)), np.zeros((B * M, drives.STATES)), np.empty((B * M, n, 3))
        which, r = np.repeat(np.arange(M), B), group["input"]
        supply, enabled, temp = group["supply"], group["enabled"], group["temperature"]
        if sizes:  # every lane has its own input
            r = np.repeat(r, B, axis=0)
            for name, size in sizes.items():
                r += (size[:, None] * self._course(name, group)[:, None]).reshape(B * M, n)
            supply, enabled, temp = (np.repeat(c, B, axis=0) for c in (supply, enabled, temp))
            which = np.arange(B * M)

        run, laws, steps = loop_of(rates, elements, P, 1), (rates, elements, P), (group["dt"], self.substeps)

        def work(first: int, last: int) -> None:
            run(first, last, J, D, *laws, X, S, C, which, r, supply, enabled, temp, *steps, out)

        spread(work, B * M, self.workers)
        return out.reshape(M, B, n, 3)

    def _course(self, name: str, group) -> np.ndarray:
        courses = [
            np.asarray(self.logs[k].shapes.get(name, np.zeros(1)), dtype=float) for k in group["which"]
        ]
        return np.array([np.pad(c, (0, group["n"] - len(c)), "edge") for c in courses])


def scales_of(logs: Sequence[MotionLog], axis: Axis, unit: str) -> Scales:
    """Return typical sizes from the motion and the drive. Friction is taken as a tenth of the drive's largest torque.

    Args:
        logs: of one axis.
        axis: with its drive.
        unit: of the axis, `rad` or `m`.
    """
    speed = max(float(np.abs(np.diff(log.position)).max()) / log.dt for log in logs)
    travel = max(float(np.ptp(log.position)) for log in logs)
    d = axis.drive
    most = float(max(np.abs(log.drive_input).max() for log in logs)) * abs(d.gain)
    output = min(d.limit, most) if d.controller == "open" else d.limit
    torque = output if d.actuator == "torque" else output * d.supply * d.torque_constant / d.resistance
    if not 0.0 < torque < np.inf:
        torque = max(abs(axis.gravity_sin) + abs(axis.gravity_cos), axis.inertia * speed / 0.1)
    return Scales(force=0.1 * torque, speed=max(speed, 1e-9), length=1e-3 * travel, unit=unit)
