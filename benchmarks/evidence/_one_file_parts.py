"""What `one_file` adds to a copy of the tree: a file each, the line that says so elsewhere, and a use of it as a person would."""

from __future__ import annotations

from typing import NamedTuple


class Line(NamedTuple):
    """One new line of another file.

    Attributes:
        file: below the package.
        anchor: text of the line behind which it goes; it stands there once.
        new: the line.
    """

    file: str
    anchor: str
    new: str


class Part(NamedTuple):
    """Something that is added.

    Attributes:
        kind: what it is called.
        file: that is added, below the package.
        text: of the file.
        line: elsewhere.
        use: program that uses it, in a folder of its own; PRELUDE stands before it.
    """

    kind: str
    file: str
    text: str
    line: Line
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
from typing import Any, ClassVar

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
    KIND: ClassVar[int] = 42
    PARAMETERS: ClassVar[dict[str, Parameter]] = {
        "coulomb": Parameter(symbol="F", unit="force", lower=0.0, log=True, start=lambda d: d.coulomb),
        "growth": Parameter(symbol="k", unit="force", lower=0.0, start=lambda d: 0.3 * d.coulomb),
        "knee": Parameter(symbol="w", unit="length/s", lower=1e-6, log=True, start=lambda d: 0.3 * d.speed),
    }
    WORDS: ClassVar[str] = "Coulomb and arc tangent"
    EXAMPLE: ClassVar[dict[str, Any]] = dict(coulomb=4.0, growth=2.0, knee=0.4)

    coulomb: float
    growth: float
    knee: float
''',
    Line(
        "laws/__init__.py",
        "from backdrive.laws.rates.degressive import Degressive as Degressive",
        "from backdrive.laws.rates.arc_tangent import ArcTangent as ArcTangent",
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
model = identify(log, law="arc-tangent", symmetric=True).model  # whose gravity would pass for a difference of directions
model.save("m.json")
again = load_model("m.json").joints[0].law
assert again == model.joints[0].law and again.name == "arc-tangent"
assert abs(float(again.torque(0.7)) - float(law.torque(0.7))) < 0.3, (again, law)
assert "arc-tangent" in command("show", "m.json")
loop = Loop(JointLoop(compensator=by_law(again), limit=5.0, top_speed=3.0, encoder_count=1e-6), interval=1e-3)
for k in range(2000):
    loop.update([1e-3 * k], [0.0])
assert abs(loop.torque[0] - 0.8 * float(again.torque(1.0))) < 0.2, loop.torque
from backdrive.report.pictures.curve import save_curves
save_curves("curve.png", model)
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
    Line("logs/readers/_formats.py", '    Format("json",', '    Format("pairs", "pairs", (".pairs",)),'),
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
    Line("logs/health/__init__.py", '        "no_motion",', '        "heavy",'),
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

from dataclasses import KW_ONLY, dataclass
from typing import ClassVar

import numpy as np

from backdrive.plans.base import MotionPlan, settle


@dataclass(frozen=True)
class Swing(MotionPlan):
    """Cycles of one sine, from rest at one end of the stroke.

    Attributes:
        stroke: peak to peak [rad or m].
        period: of the sine [s].
        cycles: how many.
    """

    stroke: float
    period: float
    _: KW_ONLY
    cycles: float = 3.0

    kind: ClassVar[str] = "swing"
    options: ClassVar[tuple[str, ...]] = ("stroke", "period", "cycles")

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

    def _motion(self, t: np.ndarray, order: int) -> np.ndarray:
        rate = 2.0 * np.pi / self.period
        phase = rate * np.clip(t - self.start, 0.0, self.duration) + 0.5 * np.pi * order
        return (self.center if order == 0 else 0.0) - 0.5 * self.stroke * rate**order * np.cos(phase)
''',
    Line(
        "plans/__init__.py",
        "from backdrive.plans.sweep import Sweep as Sweep",
        "from backdrive.plans.swing import Swing as Swing",
    ),
    """
from backdrive.plans import load_plan, plan_from_dict
plan = plan_from_dict({"format": "backdrive-plan", "schema": 1, "kind": "swing", "stroke": 0.4, "period": 2.0, "cycles": 1})
from backdrive.plans import save_plan
save_plan(plan, "plan.json")
assert load_plan("plan.json") == plan
from pathlib import Path
from backdrive.report.pictures.plan import picture
Path("plan.png").write_bytes(picture(plan, "png"))
from backdrive.simulation import machine
from backdrive.simulation.open_loop import simulate
log = simulate(machine("joint_1"), plan, rate=250.0)
assert np.ptp(log.need("position")) > 0.3
command("plan", "swing", "--stroke", "0.4", "--period", "2.0", "-o", "swing")
assert load_plan(next(Path("swing").glob("*.json"))).kind == "swing"
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
    Line(
        "thesis/catalog.py",
        '        "fig-4.3": "Identified rate-dependent friction",',
        '        "fig-9.9": "A line",',
    ),
    """
assert "fig-9.9" in command("reproduce", "--list")
command("reproduce", "fig-9.9", "--folder", "book")
assert [f for f in Path("book").rglob("*") if "9.9" in f.name or "9_9" in f.name], list(Path("book").rglob("*"))
""",
)

PARTS = (READER, CHECK, PLAN, EXPERIMENT, LAW)
