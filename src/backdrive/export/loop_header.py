"""The torque loop with all its guards as a C header: the same tick as in Python, for all its joints."""

from __future__ import annotations

import re
from collections.abc import Sequence

from backdrive.control import guard, loop_kernel, readings
from backdrive.control.joint_loop import JointLoop
from backdrive.export import prelude
from backdrive.export.function import Function
from backdrive.export.labels import law_labels
from backdrive.export.loop_joint import FIELDS, SETTINGS, Joint, kind_of
from backdrive.export.program import Program
from backdrive.export.selftest import selftest
from backdrive.export.values import PLACE, REAL, Const, Scalar, Spelling, number
from backdrive.status import STATUSES, Status

INPUTS = ("error", "slope", "known", "motor", "load", "temperature")
OUTPUTS = ("torque", "external", "friction", "level", "calls", "cause")
WORDS = {
    "error": "reference minus position [rad or m], to be written before a step",
    "slope": "rate of it [rad/s or m/s], to be written before a step",
    "known": "gravity and coupling torque of other joints [N.m or N], to be written before a step",
    "motor": "motor-side torque for laws that depend on load [N.m or N], to be written before a step",
    "load": "external torque for the same [N.m or N], to be written before a step",
    "temperature": "for laws that depend on it [degC], to be written before a step",
    "torque": "to add to what drives the joint [N.m or N]",
    "external": "estimated external force [N.m or N]",
    "friction": "estimated [N.m or N]",
    "level": "of the friction, learned [-]",
    "calls": "number of steps so far; a watchdog sees from it that the loop has stopped",
    "cause": "status that has latched the joint, 0 where it is not latched",
    "applied": "torque that acted since the tick before [N.m or N]",
    "passed": "time that this tick counts for [s]",
    "since": "time since the last accepted reading [s]",
    "time": "since the start [s]",
    "begun": "1 once there was a reading",
    "before": "last accepted position [rad or m]",
    "elsewhere": "position after a jump [rad or m]",
    "leap": "speed of the jump [rad/s or m/s]",
    "settled": "for how long readings have stayed there [s]",
    "pending": "1 after a jump, until it is decided",
    "zero": "total shift of the encoder's zero [rad or m]",
    "faulty": "time with faults, as far as it has not been forgotten [s]",
    "older": "position at the beginning of the window of speeds [rad or m]",
    "newer": "position in the middle of it [rad or m]",
    "newer_age": "[s]",
    "older_by": "how much earlier the window began [s]",
    "due": "age at which the speed is measured, or the window moves on [s]",
    "fast": "1: above the top speed in the last window",
    "stop": "1 after a stop, until it is acknowledged",
    "cap": "present bound of the torque [N.m or N]",
    "bad": "number of ticks with faults in a row",
    "anchor": "where the joint has stood still [rad or m]",
    "still": "for how long [s]",
    "slid": "motion that the level was learned from, as a time [s]",
    "x": "friction law of the compensator",
    "s": "compensator",
    "xe": "friction law of the estimator of the external force",
    "se": "estimator of the external force",
    "p_own": "rate of decay of the compensator's law",
    "pe_own": "rate of decay of the estimator's law",
    **dict.fromkeys(("x_at", "s_at", "xe_at", "se_at"), "its positions and times"),
    "nominal": "period [s]",
    "top": "speed [rad/s or m/s]",
    "limit": "of the torque [N.m or N]",
    "rate": "fastest change of the torque [N.m/s or N/s]",
    "ramp": "rate of its growth after a start or a fault, and of its fall after a stop [N.m/s or N/s]",
    "latching": "rate of its fall once a joint is latched [N.m/s or N/s]",
    "hold": "time at rest after which the compensation is relaxed [s]",
    "fade": "rate at which the torque fades while readings are bad [1/s]",
    "patience": "time with faults after which a joint is latched [s]",
    "slack": "how much farther than at top speed a joint can seem to have moved [rad or m]",
    "away": "distance from the place of rest beyond which the joint has moved [rad or m]",
}
TITLES = {
    "c": "Numbers of a compensator.",
    "p": "A friction law.",
    "ce": "Numbers of an estimator of the external force.",
    "pe": "A friction law.",
}


class LoopHeader:
    """The header of a loop.

    Args:
        joints: what runs on each.
        interval: period [s].
        prefix: of every name.
        names: of the joints.
        single: reals are floats.
    """

    def __init__(
        self, joints: Sequence[JointLoop], interval: float, prefix: str, names: Sequence[str], single: bool
    ):
        self.prefix, self.names, self.interval, self.single = prefix, names, interval, single
        self.given = joints
        symbols = {s.name: f"{prefix.upper()}_{s.name}" for s in STATUSES}
        self.program = Program(prefix, Spelling(single), symbols, inlines=True)
        self.joints = [Joint(joint, interval) for joint in joints]
        i = Const(0)
        q, dt, by = Scalar("q", PLACE), Scalar("dt", PLACE), Scalar("by", PLACE)
        self.ticks: list[Function] = []
        self.shifts: list[Function] = []
        self.acknowledges: list[Function] = []
        for joint in self.joints:
            c, p, x, s, ce, pe, xe, se = (
                joint.value(n) for n in ("c", "p", "x", "s", "ce", "pe", "xe", "se")
            )
            g = joint.table()
            self.ticks.append(
                self.program.translate(loop_kernel.joint, [c, i, p, x, s, ce, pe, xe, se, g, q, dt])
            )
            self.shifts.append(self.program.translate(readings.shift, [c, s, ce, se, g, by]))
            self.acknowledges.append(self.program.translate(guard.acknowledge, [g]))
        self.functions = self.program.reachable([*self.ticks, *self.shifts, *self.acknowledges])
        text = "\n".join(line for f in self.functions for line in f.body)
        self.used = set(re.findall(r"g->(\w+)", text)) | set(INPUTS) | set(OUTPUTS) | {"stop"}
        self.settings = [n for _, n in FIELDS if n in set(re.findall(r"k->(\w+)", text))]
        self.variables = [n for _, n in FIELDS if n in self.used and n not in SETTINGS]
        called = [f for f in (*self.ticks, *self.shifts)]
        self.states: list[
            str
        ] = []  # of arrays, and behind each that of its positions where these are doubles
        for n in ("x", "s", "xe", "se", "p_own", "pe_own"):
            for name in (n, f"{n}_at"):
                if any(n in j.initial for j in self.joints) and any(
                    name == of for f in called for _, of in f.parameters
                ):
                    self.states.append(name)

    def _numbers(self, joint: Joint, name: str) -> list[float]:
        """Return the initial content of an array of a joint's state."""
        n = name.removesuffix("_at")
        numbers = joint.initial[n].tolist() if n in joint.initial else []
        return [numbers[i] for i in sorted(joint.places.get(n, ()))] if name != n else numbers

    def _size(self, name: str) -> int:
        return max(1, *(len(self._numbers(j, name)) for j in self.joints))

    def text(self) -> str:
        """Return the whole of the header but its frame."""
        program, functions = self.program, self.functions
        parts = [
            self._statuses(),
            self._structures(),
            prelude.INLINE.format(P=self.prefix.upper()),
            prelude.helpers(program, functions),
            prelude.tables(program, functions),
            self._constants(),
            *[f.text() for f in functions],
            self._initial(),
            self._loop(),
            selftest(self.given, self.interval, self.prefix, self.single),
        ]
        return "\n\n".join(part.rstrip() for part in parts if part.strip()) + "\n"

    @property
    def real(self) -> str:
        """Type of reals."""
        return "float" if self.single else "double"

    def _statuses(self) -> str:
        P = self.prefix.upper()
        rows = "\n".join(f"  {P}_{s.name} = {int(s)}, /* {s.sentence} */" for s in STATUSES)
        return f"/* What a step reports of a joint. */\nenum {{\n{rows}\n}};\n\n#define {P}_JOINTS {len(self.joints)}"

    def _structures(self) -> str:
        P = self.prefix
        kinds = {n: self.program.spelling.type_name(kind_of(n)) for _, n in FIELDS}
        fields = [f"  {kinds[n]} {n};" + (f" /* {WORDS[n]} */" if n in WORDS else "") for n in self.variables]
        for n in self.states:
            words = f" /* {WORDS[n]} */" if n in WORDS else ""
            fields.append(f"  {'double' if n.endswith('_at') else self.real} {n}[{self._size(n)}];{words}")
        settings = [
            f"  {kinds[n]} {n};" + (f" /* {WORDS[n]} */" if n in WORDS else "") for n in self.settings
        ] or [f"  {self.real} none;"]
        return (
            "/* What a joint remembers. */\ntypedef struct {\n" + "\n".join(fields) + f"\n}} {P}_joint;\n\n"
            "/* What stays: limits and rates. */\ntypedef struct {\n"
            + "\n".join(settings)
            + f"\n}} {P}_settings;\n\n"
            f"/* The whole loop, yours to keep: no memory but this is written to. */\ntypedef struct {{\n"
            f"  {P}_joint joint[{P.upper()}_JOINTS];\n  int code[{P.upper()}_JOINTS]; /* status of every joint */\n}} {P}_state;"
        )

    def _constants(self) -> str:
        P, texts = self.prefix, []
        self.tables: list[dict[str, str]] = []
        known: dict[str, str] = {}
        for i, (joint, f) in enumerate(zip(self.joints, self.ticks, strict=False)):
            names = {}
            for n, numbers in joint.constants.items():
                if any(name == n for g in (f, self.shifts[i]) for _, name in g.parameters):
                    rows = prelude.table("@", numbers, REAL, self.single, self._comments(n, i))
                    if rows not in known:
                        known[rows] = f"{P}_{n}_{i}"
                        texts.append(f"/* {TITLES[n]} */\n" + rows.replace("@", known[rows]))
                    names[n] = known[rows]
            self.tables.append(names)
        rows = []
        order = {n: r for r, n in FIELDS}
        for joint, name in zip(self.joints, self.names, strict=False):
            cells = [
                f"    {number(float(joint.rows[order[n]]), kind_of(n), self.single)}, /* {n} */"
                for n in self.settings
            ] or ["    0.0"]
            rows.append(f"  {{ /* {name} */\n" + "\n".join(cells) + "\n  }")
        texts.append(
            f"static const {P}_settings {P}_of_joint[{P.upper()}_JOINTS] = {{\n" + ",\n".join(rows) + "\n};"
        )
        return "\n\n".join(texts)

    def _comments(self, name: str, i: int) -> tuple[str, ...]:
        """Return what the numbers of a law are."""
        joint = self.given[i]
        if name == "p":
            return law_labels(joint.compensator.friction.law)
        return law_labels(joint.external.friction.law) if name == "pe" and joint.external else ()

    def _initial(self) -> str:
        """Return the state of joints that rest at 0."""
        P, rows = self.prefix, []
        order = {n: r for r, n in FIELDS}
        for joint, name in zip(self.joints, self.names, strict=False):
            cells = [
                f"    {number(float(joint.rows[order[n]]), kind_of(n), self.single)}, /* {n} */"
                for n in self.variables
            ]
            for n in self.states:
                kind = PLACE if n.endswith("_at") else REAL
                numbers = self._numbers(joint, n)
                numbers += [0.0] * (self._size(n) - len(numbers))
                cells.append(
                    "    {" + ", ".join(number(v, kind, self.single) for v in numbers) + f"}}, /* {n} */"
                )
            rows.append(f"  {{ /* {name} */\n" + "\n".join(cells) + "\n  }")
        body = ",\n".join(rows)
        return f"static const {P}_joint {P}_at_rest[{P.upper()}_JOINTS] = {{\n{body}\n}};"

    def _call(self, function: Function, i: int, given: dict[str, str]) -> str:
        parts = []
        for _, name in function.parameters:
            if name in given:
                parts.append(given[name])
            elif name == "g":
                parts.append(f"&s->joint[{i}]")
            elif name == "k":
                parts.append(f"&{self.prefix}_of_joint[{i}]")
            elif name in self.tables[i]:
                parts.append(self.tables[i][name])
            else:
                parts.append(f"s->joint[{i}].{name}")
        return f"{function.name}({', '.join(parts)})"

    def _loop(self) -> str:
        P, N, real = self.prefix, f"{self.prefix.upper()}_JOINTS", self.real
        severities = ", ".join(str(s.severity) for s in STATUSES)
        shifts = "\n".join(
            f"  {self._call(f, i, {'by': f'position[{i}]'})};" for i, f in enumerate(self.shifts)
        )
        ticks = "\n".join(
            f"  s->joint[{i}].applied = applied[{i}];\n"
            f"  s->code[{i}] = {self._call(f, i, {'q': f'position[{i}]', 'dt': 'interval'})};"
            for i, f in enumerate(self.ticks)
        )
        acknowledges = "\n".join(f"  all &= {self._call(f, i, {})};" for i, f in enumerate(self.acknowledges))
        ok = f"{P.upper()}_{Status.OK.name}"
        return f"""\
/* Return to joints at rest, relaxed and without torque, at these positions [rad or m]. */
static inline void {P}_reset({P}_state *s, const double position[{N}]) {{
  for (int i = 0; i < {N}; i++) {{
    int64_t calls = s->joint[i].calls;
    s->joint[i] = {P}_at_rest[i];
    s->joint[i].calls = calls;
    s->code[i] = {ok};
  }}
{shifts}
  for (int i = 0; i < {N}; i++) s->joint[i].zero = 0.0;
}}

/* Set up a loop whose joints rest at 0; the first step moves them to where the encoders are. */
static inline void {P}_init({P}_state *s) {{
  for (int i = 0; i < {N}; i++) {{
    s->joint[i] = {P}_at_rest[i];
    s->code[i] = {ok};
  }}
}}

/* Advance every joint by one tick: encoder readings [rad or m], the torque that acted since the tick before [N.m or N], and the
   time since then [s], {self.interval:g} where it came on time. Returns the worst status; what to add is in joint[i].torque. */
static inline int {P}_step({P}_state *s, const double position[{N}], const {real} applied[{N}], double interval) {{
  static const unsigned char severity[] = {{{severities}}};
  int worst = {ok};
{ticks}
  for (int i = 0; i < {N}; i++) {{
    if (severity[s->code[i]] > severity[worst]) worst = s->code[i];
  }}
  return worst;
}}

/* Let the torque ramp down to zero at the slow rate, and stay there until {P}_acknowledge. */
static inline void {P}_stop({P}_state *s) {{
  for (int i = 0; i < {N}; i++) s->joint[i].stop = 1;
}}

/* Take back latches and a stop; a latch stays where torque is left or the joint is too fast. Returns whether none is left. */
static inline int {P}_acknowledge({P}_state *s) {{
  int all = 1;
{acknowledges}
  return all;
}}"""


def loop_header(
    joints: Sequence[JointLoop],
    interval: float,
    prefix: str = "loop",
    names: Sequence[str] | None = None,
    single: bool = False,
    comment: str = "",
) -> str:
    """Return a C header of a torque loop.

    Args:
        joints: what runs on each.
        interval: period [s].
        prefix: of every name.
        names: of the joints; None: their numbers.
        single: reals are floats, positions and time stay doubles.
        comment: first lines.
    """
    names = [str(i) for i in range(len(joints))] if names is None else names
    body = LoopHeader(joints, interval, prefix, names, single).text()
    return frame_header(prefix, comment, body)


def frame_header(prefix: str, comment: str, body: str) -> str:
    """Return a header: comment, include guard, refusals and includes around its body."""
    guard_ = f"{prefix.upper()}_H"
    lines = "\n".join(f" * {line}".rstrip() for line in comment.splitlines())
    head = f"/*\n{lines}\n */\n" if comment else ""
    return (
        f"{head}#ifndef {guard_}\n#define {guard_}\n\n{prelude.INCLUDES}\n{prelude.GUARD}\n{body}\n#endif\n"
    )
