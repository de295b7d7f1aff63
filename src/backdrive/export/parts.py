"""Single parts as a C header, for a controller with its own loop: law, compensator, estimator, filter, admittance."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from backdrive.control import admittance as admittance_
from backdrive.control.admittance import Admittance
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators.compensator import Compensator
from backdrive.control.estimators import external as external_
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators import sliding_mode
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.export import prelude
from backdrive.export.labels import law_labels
from backdrive.export.program import Program
from backdrive.export.statements import c_name
from backdrive.export.values import BOOL, PLACE, REAL, Array, Const, Scalar, Several, Spelling, Value, number
from backdrive.laws import Law, kernels

LOAD = (("motor", REAL), ("external", REAL))
WORDS = {
    "q": "encoder [rad or m]",
    "dp": "its increment since the tick before [rad or m]",
    "dt": "time since then [s]",
    "t": "time [s]",
    "error": "reference minus position [rad or m]",
    "slope": "its rate [rad/s or m/s]",
    "u": "torque that acted since the tick before [N.m or N]",
    "known": "torque of gravity and of other joints that the part does not model [N.m or N]",
    "load_motor": "motor-side torque [N.m or N]",
    "load_external": "external torque [N.m or N]",
    "temp": "temperature [degC]",
    "level": "factor on the friction [-]",
    "idle": "1: the extra torque is off",
    "tau_e": "estimated external force [N.m or N]",
}


@dataclass(frozen=True, kw_only=True)
class Part:
    """A kernel with its arguments and its state.

    Attributes:
        kernel: of one tick.
        arguments: of it, in order: a number, the name of an array, or the name of an input.
        inputs: name -> kind; `load` is a pair.
        constants: arrays that stay, by name.
        states: arrays that change, by name, at rest at 0.
        places: which of their numbers are positions or times, by name.
        own: place of what changes in an array of constants, by its name; the state holds it as NAME_own.
        title: of the step.
        law: whose row is the constant `p`, None where there is none.
    """

    kernel: Callable
    arguments: tuple[int | str, ...]
    inputs: dict[str, str]
    constants: dict[str, np.ndarray] = field(default_factory=dict)
    states: dict[str, np.ndarray] = field(default_factory=dict)
    places: dict[str, frozenset[int]] = field(default_factory=dict)
    own: dict[str, int] = field(default_factory=dict)
    title: str = ""
    law: Law | None = None

    def value(self, argument: int | str) -> Value:
        """Return an argument of the kernel."""
        if isinstance(argument, int):
            return Const(argument)
        if argument in self.constants:
            numbers = tuple(self.constants[argument].tolist())
            return Array(
                argument, len(numbers), content=numbers, own=self.own.get(argument, -1), writeable=False
            )
        if argument in self.states:
            places = self.places.get(argument, frozenset())
            return Array(argument, len(self.states[argument]), places=places)
        if argument == "load":
            return Several((Scalar("load_0", REAL), Scalar("load_1", REAL)))
        return Scalar(argument, self.inputs[argument])


def _friction_arrays(friction: FrictionEstimator, p: str, x: str) -> tuple[dict, dict, dict]:
    """Return constants, states and what changes of a friction estimator's arrays."""
    law = friction.law
    states = {x: np.zeros(max(law.element.states(), 1))}
    if friction.fast_decay is None:
        return {p: law.row()}, states, {}
    at = int(friction.row()[2])
    return {p: law.row()}, states | {f"{p}_own": law.row()[at : at + 1]}, {p: at}


def of_law(law: Law) -> Part:
    """Return the friction torque of a law, tick by tick."""
    return Part(
        kernel=kernels.step,
        arguments=(law.rate.KIND, law.element.KIND, "p", "x", "dp", "dt", "load", "temp"),
        inputs={"dp": REAL, "dt": REAL, "load": REAL, "temp": REAL},
        constants={"p": law.row()},
        states={"x": np.zeros(max(law.element.states(), 1))},
        title=f"Friction torque of one tick [N.m or N]: {law.name}.",
        law=law,
    )


def of_friction(friction: FrictionEstimator) -> Part:
    """Return a friction estimator."""
    constants, states, own = _friction_arrays(friction, "p", "x")
    return Part(
        kernel=friction_.tick,
        arguments=("c", 0, "p", "x", "s", 0, "dp", "dt", "load", "temp"),
        inputs={"dp": REAL, "dt": REAL, "load": REAL, "temp": REAL},
        constants={"c": friction.row()} | constants,
        states=states | {"s": np.zeros(1)},
        own=own,
        title="Estimated friction torque of one tick [N.m or N].",
        law=friction.law,
    )


def of_compensator(compensator: Compensator, interval: float) -> Part:
    """Return a friction compensator."""
    constants, states, own = _friction_arrays(compensator.friction, "p", "x")
    places = {compensator_.S_DITHER + i for i in (0, 2, 3, 4)}
    return Part(
        kernel=compensator_.tick,
        arguments=(
            "c",
            0,
            "p",
            "x",
            "s",
            0,
            "q",
            "dp",
            "dt",
            "t",
            "error",
            "slope",
            "u",
            "load",
            "temp",
            "idle",
        ),
        inputs={"q": PLACE, "dp": REAL, "dt": REAL, "t": PLACE}
        | dict.fromkeys(("error", "slope", "u", "load", "temp"), REAL)
        | {"idle": BOOL},
        constants={"c": compensator.row(interval)} | constants,
        states=states | {"s": compensator.start(0.0)},
        places={"s": frozenset(places)},
        own=own,
        title="Torque to add in one tick, in two parts: compensation, and dither [N.m or N].",
        law=compensator.friction.law,
    )


def of_external(external: ExternalForce, interval: float) -> Part:
    """Return an estimator of the external force."""
    constants, states, own = _friction_arrays(external.friction, "p", "x")
    method = external_.KNOWN[external.method]
    return Part(
        kernel=external_.tick,
        arguments=("c", 0, "p", "x", "s", 0, "q", "dp", "dt", "u", "known", "load", "temp", "level"),
        inputs={"q": PLACE} | dict.fromkeys(("dp", "dt", "u", "known", "load", "temp", "level"), REAL),
        constants={"c": external.row(interval)} | constants,
        states=states | {"s": external.start(0.0)},
        places={"s": frozenset({0, *({external_.OBSERVER} if method.places else ())})},
        own=own,
        title="External force and friction of one tick [N.m or N].",
        law=external.friction.law,
    )


def of_filter(filter: MotionFilter) -> Part:
    """Return a filter from encoder to velocity and acceleration."""
    return Part(
        kernel=sliding_mode.motion,
        arguments=("c", 0, "u", 0, "q", "dp", "dt"),
        inputs={"q": PLACE, "dp": REAL, "dt": REAL},
        constants={"c": filter.row()},
        states={"u": np.zeros(sliding_mode.STATES)},
        places={"u": frozenset({0})},
        title="Velocity and acceleration of one tick [rad/s, rad/s^2 or m/s, m/s^2].",
    )


def of_admittance(admittance: Admittance) -> Part:
    """Return an admittance controller."""
    return Part(
        kernel=admittance_.tick,
        arguments=("c", 0, "s", 0, "tau_e", "q", "dt"),
        inputs={"tau_e": REAL, "q": PLACE, "dt": REAL},
        constants={"c": admittance.row()},
        states={"s": admittance.start(0.0)},
        places={"s": frozenset({0, 2})},
        title="Torque of one tick [N.m or N].",
    )


class PartsHeader:
    """The header of several parts.

    Args:
        parts: by name.
        prefix: of every name.
        single: reals are floats.
    """

    def __init__(self, parts: dict[str, Part], prefix: str, single: bool):
        self.parts, self.prefix, self.single = parts, prefix, single
        self.program = Program(prefix, Spelling(single))
        self.steps = {
            name: self.program.translate(part.kernel, [part.value(a) for a in part.arguments])
            for name, part in parts.items()
        }

    def text(self) -> str:
        """Return the whole of the header but its frame."""
        functions = self.program.reachable(list(self.steps.values()))
        parts = [
            prelude.helpers(self.program, functions),
            prelude.tables(self.program, functions),
            *[f.text() for f in functions],
            *[self._part(name) for name in self.parts],
        ]
        return "\n\n".join(part.rstrip() for part in parts if part.strip()) + "\n"

    def signature(self, name: str) -> list[tuple[str, str]]:
        """Return type and name of the inputs of a part's step."""
        spelling, result = Spelling(self.single), []
        for n, kind in self.parts[name].inputs.items():
            if n == "load":
                result += [(spelling.type_name(k), f"load_{m}") for m, k in LOAD]
            else:
                result.append((spelling.type_name(kind), n))
        return result

    def _part(self, name: str) -> str:
        part, step, full = self.parts[name], self.steps[name], f"{self.prefix}_{name}"
        real = "float" if self.single else "double"
        used = {n for _, n in step.parameters}
        kernel = getattr(part.kernel, "py_func", part.kernel)
        called = dict(
            zip(inspect.signature(kernel).parameters, part.arguments, strict=False)
        )  # parameter -> argument
        called = {c_name(n): str(a) for n, a in called.items()} | {
            "load_0": "load_motor",
            "load_1": "load_external",
        }
        used = {called.get(n, n) for n in used}
        arrays: list[tuple[str, str, list[float], str]] = []
        for n, numbers in part.states.items():
            at = [float(numbers[i]) for i in sorted(part.places.get(n, ()))]
            arrays += [(n, real, numbers.tolist(), REAL), (f"{n}_at", "double", at, PLACE)]
        arrays = [a for a in arrays if a[0] in used]
        fields = "".join(f"  {t} {n}[{len(v)}];\n" for n, t, v, _ in arrays) or "  int none;\n"
        cells = (
            ", ".join("{" + ", ".join(number(x, k, self.single) for x in v) + "}" for _, _, v, k in arrays)
            or "0"
        )
        labels = law_labels(part.law) if part.law else ()
        constants = "".join(
            prelude.table(f"{full}_{n}", v, REAL, self.single, labels if n == "p" else ()) + "\n\n"
            for n, v in part.constants.items()
            if n in used
        )
        inputs = self.signature(name)
        places = {a[0]: f"s->{a[0]}" for a in arrays} | {n: f"{full}_{n}" for n in part.constants}
        call = ", ".join(places.get(n, called.get(n, n)) for _, n in step.parameters)
        unused = "".join(f"  (void){n};\n" for _, n in inputs if n not in used) + (
            "" if arrays else "  (void)s;\n"
        )
        words = ", ".join(f"{n}: {WORDS[n]}" for _, n in inputs)
        return (
            f"/* What {name} remembers: yours to keep. */\ntypedef struct {{\n{fields}}} {full}_state;\n\n{constants}"
            f"/* Return to rest at a position [rad or m]. */\n"
            f"static inline void {full}_reset({full}_state *s, double position) {{\n"
            f"  static const {full}_state at_rest = {{{cells}}};\n  *s = at_rest;\n{self._move(part, arrays)}}}\n\n"
            f"/* {part.title} {words}. */\n"
            f"static inline {step.result} {full}_step({full}_state *s, {', '.join(f'{t} {n}' for t, n in inputs)}) {{\n"
            f"{unused}  return {step.name}({call});\n}}"
        )

    def _move(self, part: Part, arrays: Sequence[tuple[str, str, list[float], str]]) -> str:
        """Return code that shifts the positions of a part at rest; times stay 0."""
        lines = []
        for n, indices in part.places.items():
            for rank, i in enumerate(sorted(indices)):
                if i in positions_at(part, n):
                    names = {a[0] for a in arrays}
                    place = f"{n}_at[{rank}]" if self.single else f"{n}[{i}]"
                    if place.split("[", maxsplit=1)[0] in names:
                        lines.append(f"  s->{place} = position;\n")
        return "".join(lines) or "  (void)position;\n"


def positions_at(part: Part, name: str) -> set[int]:
    """Return which numbers of a state are positions, not times."""
    if part.kernel is compensator_.tick:
        return {compensator_.S_DITHER + 3, compensator_.S_DITHER + 4}
    return set(part.places.get(name, ()))
