"""What `one_file` adds to a copy of the tree: a file each, the lines that say so elsewhere, and a use of it as a person would."""

from __future__ import annotations

from typing import NamedTuple


class Line(NamedTuple):
    """One line of another file that is new or reads differently.

    Attributes:
        file: below the package.
        anchor: text of the line behind which it goes, or that changes; it stands there once.
        new: the line, or what takes the anchor's place.
        changes: the anchor itself is replaced.
    """

    file: str
    anchor: str
    new: str
    changes: bool = False


class Part(NamedTuple):
    """Something that is added.

    Attributes:
        kind: what it is called.
        file: that is added, below the package.
        text: of the file.
        lines: elsewhere.
        use: program that uses it, in a folder of its own; PRELUDE stands before it.
    """

    kind: str
    file: str
    text: str
    lines: tuple[Line, ...]
    use: str


PRELUDE = """
import json, subprocess, sys
from pathlib import Path
import numpy as np

def command(*words, ends=(0,)):
    done = subprocess.run([sys.executable, "-m", "backdrive", *words], capture_output=True, text=True)
    assert done.returncode in ends, done.stdout + done.stderr
    return done.stdout
"""

LAW = Part(
    "law",
    "laws/rates/arc_tangent.py",
    '''"""Coulomb friction and a viscous part that an arc tangent flattens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from backdrive._jit import leaf
from backdrive.laws.base import Parameter, Rate


@leaf
def limits(p, v, load, temp):
    """Rate law: -F, F and k atan(v/w)."""
    return -p[1], p[1], p[2] * np.arctan(v / p[3])


@dataclass(frozen=True, kw_only=True)
class ArcTangent(Rate):
    """Coulomb friction and a flattening viscous part."""

    NAME: ClassVar[str] = "arc-tangent"
    KIND: ClassVar[int] = 77
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "coulomb": Parameter(symbol="F", unit="force", lower=0.0, log=True),
        "growth": Parameter(symbol="k", unit="force", lower=0.0),
        "knee": Parameter(symbol="w", unit="length/s", lower=1e-6, typical=0.3, log=True),
    }

    coulomb: float
    growth: float
    knee: float
''',
    (
        Line(
            "laws/__init__.py",
            "from backdrive.laws.rates.degressive import Degressive as Degressive",
            "from backdrive.laws.rates.arc_tangent import ArcTangent as ArcTangent",
        ),
        Line("laws/__init__.py", "        Degressive,", "        ArcTangent,"),
        Line("laws/examples.py", "    BlimanSorine,", "    ArcTangent,"),
        Line(
            "laws/examples.py",
            "        Coulomb(coulomb=5.0),",
            "        ArcTangent(coulomb=4.0, growth=2.0, knee=0.4),",
        ),
        Line("laws/kernels.py", "    degressive,", "    arc_tangent,"),
        Line("laws/kernels.py", "        return gear_load.limits(p, v, load, temp)", "    if rate == 77:"),
        Line("laws/kernels.py", "    if rate == 77:", "        return arc_tangent.limits(p, v, load, temp)"),
    ),
    """
from backdrive import Sweep, identify, load_model
from backdrive.control import JointLoop, Loop
from backdrive.control.compensators import by_law
from backdrive.laws import Law, rate_law
from backdrive.simulation import machine
from backdrive.simulation.open_loop import simulate

assert "arc-tangent" in command("laws")
command("laws", "arc-tangent")
law = Law(rate=rate_law("arc-tangent")(coulomb=4.0, growth=2.0, knee=0.4))
joint = machine("joint_1").replace(law=law)
log = simulate(joint, Sweep(stroke=0.4, top_speed=1.5, cycles=4), seed=0, rate=500.0)
model = identify(log, law="arc-tangent").model
model.save("m.json")
again = load_model("m.json").joints[0].law
assert again == model.joints[0].law and again.name == "arc-tangent"
assert abs(float(again.torque(0.7)) - float(law.torque(0.7))) < 0.3, (again, law)
assert "arc-tangent" in command("show", "m.json")
loop = Loop(JointLoop(compensator=by_law(again), limit=5.0, top_speed=3.0, encoder_count=1e-6), interval=1e-3)
for k in range(2000):
    loop.update([1e-3 * k], [0.0])
assert abs(loop.torque[0] - 0.8 * float(again.torque(1.0))) < 0.2, loop.torque
from backdrive.report.pictures.curve import save_curve_png
save_curve_png("curve.png", model.joints[0])
""",
)

READER = Part(
    "reader",
    "logs/readers/pairs.py",
    '''"""Lines of `name=value` pairs."""

from __future__ import annotations

import numpy as np

from backdrive.logs.readers.columns import Columns, ReadOptions


def read(path: str, options: ReadOptions) -> Columns:
    """Read every line."""
    with open(path) as stream:
        rows = [dict(pair.split("=") for pair in line.split()) for line in stream]
    return Columns(arrays={name: np.array([float(row[name]) for row in rows]) for name in rows[0]})
''',
    (Line("logs/readers/_formats.py", '    Format("json",', '    Format("pairs", "pairs", (".pairs",)),'),),
    """
from backdrive import read_log
t = np.arange(400) / 100.0
lines = [f"time={a!r} q={float(np.sin(a))!r} tau={float(np.cos(a))!r}" for a in t.tolist()]
Path("log.pairs").write_text("\\n".join(lines) + "\\n")
log = read_log("log.pairs")
assert np.array_equal(log.need("position")[:, 0], np.sin(t))
assert "400" in command("inspect", "log.pairs")
assert read_log("log.pairs", format="pairs").time.size == 400
""",
)

CHECK = Part(
    "health check",
    "logs/health/heavy.py",
    '''"""A torque that no robot gives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, check


@check("heavy", "torques that no robot gives")
def find(exam: Exam) -> Iterator[Finding]:
    """Report torques above 1e5."""
    for channel, j, joint in exam.columns("torque"):
        if np.abs(exam.sample(channel, j)).max() > 1e5:
            yield Finding(
                joint=joint, severity="warn", sentence=f"{joint} gives 100 kN.m.", remedy="Look at the unit.", value=1e5
            )
''',
    (Line("logs/health/__init__.py", '        "no_motion",', '        "heavy",'),),
    """
from backdrive import check, read_log
from backdrive.logs.health import CHECKS
t = np.arange(2000) / 100.0
Path("log.csv").write_text("t,q,tau\\n" + "".join(f"{a},{np.sin(a)},{2e5 * np.cos(a)}\\n" for a in t))
assert "heavy" in [finding.name for finding in check(read_log("log.csv"))]
assert "heavy" in [c.name for c in CHECKS]
assert "100 kN.m" in command("inspect", "log.csv", ends=(0, 2, 3))
""",
)

PLAN = Part(
    "plan",
    "plans/swing.py",
    '''"""One sine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from backdrive.plans.base import instants, settle


@dataclass(frozen=True)
class Swing:
    """Cycles of one sine, from rest at one end of the stroke."""

    kind: ClassVar[str] = "swing"
    commands: ClassVar[str] = "position"

    stroke: float
    period: float
    cycles: float = 3.0
    start: float = 0.0
    center: float = 0.0
    joint: str = "joint"
    unit: Literal["rad", "m"] = "rad"

    def __post_init__(self):
        settle(self, positive=("stroke", "period", "cycles"), finite=("start", "center"))

    @property
    def duration(self) -> float:
        """All cycles [s]."""
        return self.cycles * self.period

    @property
    def home(self) -> float:
        """Where it begins and ends [rad or m]."""
        return self.center - 0.5 * self.stroke

    @property
    def position_range(self) -> tuple[float, float]:
        """Lowest and highest position [rad or m]."""
        return self.center - 0.5 * self.stroke, self.center + 0.5 * self.stroke

    @property
    def peak_velocity(self) -> float:
        """Largest velocity [rad/s or m/s]."""
        return np.pi * self.stroke / self.period

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration [rad/s^2 or m/s^2]."""
        return 2.0 * np.pi**2 * self.stroke / self.period**2

    def windows(self) -> np.ndarray:
        """Return the whole of it."""
        return np.array([[self.start, self.start + self.duration]])

    def _phase(self, t: Any) -> np.ndarray:
        return 2.0 * np.pi / self.period * np.clip(instants(t) - self.start, 0.0, self.duration)

    def position(self, t: Any) -> np.ndarray:
        """Return the position [rad or m]."""
        return self.center - 0.5 * self.stroke * np.cos(self._phase(t))

    def velocity(self, t: Any) -> np.ndarray:
        """Return the velocity [rad/s or m/s]."""
        return np.pi * self.stroke / self.period * np.sin(self._phase(t))

    def acceleration(self, t: Any) -> np.ndarray:
        """Return the acceleration [rad/s^2 or m/s^2]."""
        return self.peak_acceleration * np.cos(self._phase(t))
''',
    (
        Line(
            "plans/plan_file.py",
            "from backdrive.plans.multisine import Multisine",
            "from backdrive.plans.swing import Swing",
        ),
        Line("plans/plan_file.py", "TorqueRamp, Multisine)", "TorqueRamp, Multisine, Swing)", True),
        Line("cli/_plan_request.py", '    "multisine": (', '    "swing": (*_MOTION, "period"),'),
        Line(
            "cli/_planning.py",
            '    if kind == "multisine":',
            '    if kind == "swing":\n'
            '        return excite.PLANS[-1](stroke, need("period", "--period"), **cycles, **common)\n'
            '    if kind == "multisine":',
            True,
        ),
    ),
    """
from backdrive.plans import load_plan, plan_from_dict
plan = plan_from_dict({"format": "backdrive-plan", "schema": 1, "kind": "swing", "stroke": 0.4, "period": 2.0, "cycles": 1})
from backdrive.plans import save_plan
save_plan(plan, "plan.json")
assert load_plan("plan.json") == plan
from backdrive.report.pictures.plan import draw_plan
draw_plan(plan, "plan.png")
from backdrive.simulation import machine
from backdrive.simulation.open_loop import simulate
log = simulate(machine("joint_1"), plan, rate=250.0)
assert np.ptp(log.need("position")) > 0.3
command("plan", "swing", "--stroke", "0.4", "--period", "2.0", "-o", "swing")
assert load_plan(next(Path("swing").glob("*.json"))).kind == "swing"
""",
)

COMPENSATOR = Part(
    "compensator (of a law)",
    "control/compensators/half.py",
    '''"""Half of what a law says."""

from __future__ import annotations

from backdrive.control.compensators.catalog import by_law
from backdrive.control.compensators.compensator import Compensator
from backdrive.laws import Law


def half(law: Law) -> Compensator:
    """Return a compensator of half of the friction."""
    return by_law(law, share=0.5)
''',
    (
        Line(
            "control/compensators/__init__.py",
            "from backdrive.control.compensators.dither import Dither as Dither",
            "from backdrive.control.compensators.half import half as half",
        ),
    ),
    """
from backdrive.control import JointLoop, Loop
from backdrive.control.compensators import half
from backdrive.laws import CoulombViscous, Dahl, Law
law = Law(rate=CoulombViscous(coulomb_positive=4.0, coulomb_negative=4.0), element=Dahl(stiffness=1e4))
loop = Loop(JointLoop(compensator=half(law), limit=5.0, top_speed=3.0, encoder_count=1e-6), interval=1e-3)
for k in range(2000):
    loop.update([1e-3 * k], [0.0])
assert abs(loop.torque[0] - 2.0) < 0.05, loop.torque
""",
)

KERNEL = Part(
    "compensator (a kernel of its own)",
    "control/compensators/lead.py",
    '''"""A torque along the slope of the reference."""

from __future__ import annotations

from backdrive._jit import jit


@jit
def lead(c, i, slope):
    """Return the torque; `c[i + 1]`: gain."""
    return c[i + 1] * slope
''',
    (
        Line(
            "control/compensators/compensator.py",
            "from backdrive.control.compensators.dither import NONE, Dither",
            "from backdrive.control.compensators.lead import lead",
        ),
        Line(
            "control/compensators/compensator.py",
            "    kind = int(c[i + EXTRA])",
            "    if int(c[i + EXTRA]) == 77:",
        ),
        Line(
            "control/compensators/compensator.py",
            "    if int(c[i + EXTRA]) == 77:",
            "        return lead(c, i + EXTRA, slope), 0.0",
        ),
    ),
    """
from backdrive.control import JointLoop, Loop
from backdrive.control.compensators import by_law
from backdrive.control.compensators.extras import Extra
from backdrive.laws import CoulombViscous, Dahl, Law

class Lead(Extra):
    KIND = 77
    def row(self, dt, friction):
        return self._row(2.0)

law = Law(rate=CoulombViscous(coulomb_positive=4.0, coulomb_negative=4.0), element=Dahl(stiffness=1e4))
joint = JointLoop(compensator=by_law(law).replace(extra=Lead()), limit=5.0, top_speed=3.0, encoder_count=1e-6)
loop = Loop(joint, interval=1e-3)
loop.slope = [1.0]
for k in range(2000):
    loop.update([1e-3 * k], [0.0])
assert abs(loop.torque[0] - 2.0) < 0.05, loop.torque
""",
)

ESTIMATOR = Part(
    "estimator method",
    "control/estimators/plain.py",
    '''"""The external force of a joint whose acceleration is neglected."""

from __future__ import annotations

from backdrive._jit import leaf


@leaf
def plain(n):
    """Return what motor, gravity and friction leave."""
    return -n
''',
    (
        Line(
            "control/estimators/external.py",
            'METHODS = ("direct", "momentum", "disturbance", "extended", "kalman")',
            'METHODS = ("direct", "momentum", "disturbance", "extended", "kalman", "plain")',
            True,
        ),
        Line(
            "control/estimators/external.py",
            "from backdrive.control.estimators import sliding_mode",
            "from backdrive.control.estimators.plain import plain",
        ),
        Line("control/estimators/external.py", "        return M * a - n, tau_f", "    if kind == 5:"),
        Line("control/estimators/external.py", "    if kind == 5:", "        return plain(n), tau_f"),
    ),
    """
from backdrive.control.estimators.external import ExternalForce
force, _ = ExternalForce(inertia=1.0, method="plain").run(np.zeros(50), np.full(50, 2.0), 1e-3)
assert force[-1] == -2.0, force
""",
)

EXPERIMENT = Part(
    "experiment",
    "thesis/fig_9_9.py",
    '''"""A straight line."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.thesis.outcome import Claim, Outcome


def run(seed: int = 0) -> Outcome:
    """Draw a line."""
    claim = Claim(what="It is straight", ours="straight", holds=True)
    return Outcome(name="fig-9.9", title="A line", setting="none", claims=(claim,), data={"x": np.arange(3.0)})


def draw(outcome: Outcome) -> Any:
    """Return the figure."""
    from matplotlib.figure import Figure

    figure = Figure()
    figure.add_subplot().plot(outcome.data["x"])
    return figure
''',
    (
        Line(
            "thesis/catalog.py",
            '        "fig-4.3": "Identified rate-dependent friction",',
            '        "fig-9.9": "A line",',
        ),
    ),
    """
assert "fig-9.9" in command("reproduce", "--list")
command("reproduce", "fig-9.9", "--folder", "book")
assert [f for f in Path("book").rglob("*") if "9.9" in f.name or "9_9" in f.name], list(Path("book").rglob("*"))
""",
)

PARTS = (READER, CHECK, PLAN, EXPERIMENT, ESTIMATOR, COMPENSATOR, KERNEL, LAW)
