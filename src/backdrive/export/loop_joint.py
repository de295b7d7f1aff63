"""One joint of a loop as arguments of the kernels."""

from __future__ import annotations

import numpy as np

from backdrive.control import joint_loop, table
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators.extras import DisturbanceObserver
from backdrive.control.estimators import external as external_
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.method import Method
from backdrive.control.joint_loop import JointLoop
from backdrive.export.values import INT, LONG, PLACE, REAL, Array, Table

FIELDS = sorted(
    ((value, name.lower()) for name, value in vars(table).items() if name.isupper() and name != "TABLE")
)
TIMES = {
    "time",
    "passed",
    "since",
    "settled",
    "faulty",
    "still",
    "newer_age",
    "older_by",
    "due",
    "nominal",
    "patience",
    "hold",
    "slid",
    "settle",
    "span",
    "half_span",
}
PLACES = {"before", "elsewhere", "older", "newer", "anchor", "zero"} | TIMES
WHOLE = dict.fromkeys(("begun", "pending", "fast", "cause", "stop"), INT) | {"calls": LONG}
SETTINGS = {"nominal", *(name for value, name in FIELDS if table.TOP <= value <= table.UPPER)}
INPUTS = ("error", "slope", "known", "motor", "load", "temperature")
OUTPUTS = ("torque", "external", "friction", "level", "calls", "cause")


class Joint:
    """One joint of a loop as arguments of the kernels.

    Args:
        joint: what runs on it.
        interval: period [s].
    """

    def __init__(self, joint: JointLoop, interval: float):
        c, p, x, s, ce, pe, xe, se, rows = joint_loop.rows([joint], np.zeros(1), interval)
        estimator = joint.external or ExternalForce(inertia=1.0)
        compensator = joint.compensator
        self.initial = {n: v[0] for n, v in (("x", x), ("s", s), ("xe", xe), ("se", se))}
        for name, law in (("x", compensator.friction.law), ("xe", estimator.friction.law)):
            self.initial[name] = self.initial[name][: max(law.element.states(), 1)]
        self.constants = {"c": c[0], "p": p[0], "ce": ce[0], "pe": pe[0]}
        self.own = {"p": int(c[0][compensator_.FRICTION + 2]), "pe": int(ce[0][external_.FRICTION + 2])}
        for name, at in self.own.items():
            if at:  # the rate of decay switches
                self.initial[f"{name}_own"] = self.constants[name][at : at + 1]
        places = {compensator_.S_DITHER + i for i in (0, 2, 3, 4)}  # times and positions
        if isinstance(compensator.extra, DisturbanceObserver):
            places |= {compensator_.S_EXTRA + i for i in _positions(compensator.extra.estimator())}
        self.places = {"s": places, "se": _positions(estimator)}
        idle: set[int] = set()  # parts of the compensator's state that are never read
        if compensator.friction.fast_decay is None:
            idle.add(0)
        if compensator.dither is None:
            idle |= set(range(compensator_.S_DITHER, compensator_.S_EXTRA))
        if compensator.extra is None:
            idle |= set(range(compensator_.S_EXTRA, compensator_.STATES))
        self.timed = compensator.dither is not None
        none = joint.external is None
        self.dead = {
            "s": idle,
            "se": set(range(external_.STATES)) if none else set(),
            "xe": set(range(len(self.initial["xe"]))) if none else set(),
        }
        self.rows = rows[0]

    def value(self, name: str) -> Array:
        """Return one of the arrays as an argument."""
        places = frozenset(self.places.get(name, ()))
        if name in self.constants:
            numbers = self.constants[name]
            own = self.own.get(name) or -1
            return Array(name, len(numbers), content=tuple(numbers.tolist()), own=own, writeable=False)
        return Array(name, len(self.initial[name]), places=places, dead=frozenset(self.dead.get(name, ())))

    def table(self) -> Table:
        """Return the joint's row of the table as an argument."""
        fields = (
            (name, kind_of(name), float(self.rows[row]) if name in SETTINGS else None) for row, name in FIELDS
        )
        return Table(tuple(fields), dead=frozenset() if self.timed else frozenset({"time"}))


def kind_of(field: str) -> str:
    """Return the kind of a field of the table."""
    return PLACE if field in PLACES else WHOLE.get(field, REAL)


def _positions(estimator: ExternalForce) -> set[int]:
    """Return the places of the states of an estimator that are positions."""
    method: Method = external_.KNOWN[estimator.method]
    return {0, *({external_.OBSERVER} if method.places else ())}
