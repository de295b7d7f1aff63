"""What `one_file` adds to the room of control: compensators, and a method of the estimator of external force."""

from __future__ import annotations

from _one_file_parts import Line, Part

LOOP = """
from backdrive.control import JointLoop, Loop
from backdrive.control.compensators import by_law
from backdrive.laws import CoulombViscous, Dahl, Law

law = Law(rate=CoulombViscous(coulomb_positive=4.0, coulomb_negative=4.0), element=Dahl(stiffness=1e4))

def run(compensator, slope=0.0):
    joint = JointLoop(compensator=compensator, limit=5.0, top_speed=3.0, encoder_count=1e-6)
    loop = Loop(joint, interval=1e-3)
    loop.slope = [slope]
    for k in range(2000):
        loop.update([1e-3 * k], [0.0])
    assert abs(loop.torque[0] - 2.0) < 0.05, loop.torque
"""

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
    Line(
        "control/compensators/__init__.py",
        "from backdrive.control.compensators.dither import Dither as Dither",
        "from backdrive.control.compensators.half import half as half",
    ),
    f"""
from backdrive.control.compensators import half
{LOOP}
run(half(law))
""",
)

KERNEL = Part(
    "compensator (a kernel of its own)",
    "control/compensators/lead.py",
    '''"""A torque along the slope of the reference, in the model's place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from backdrive._jit import jit
from backdrive.control.compensators.extras import Extra
from backdrive.control.estimators.friction import FrictionEstimator


@jit
def lead(c, i, share, p, x, s, j, q, dp, dt, error, slope, u, load, temp):
    """Return the torque; `c[i + 1]`: gain."""
    return c[i + 1] * slope


@dataclass(frozen=True, kw_only=True)
class Lead(Extra):
    """A torque along the slope of the reference."""

    KIND: ClassVar[int] = 42
    KERNEL: ClassVar[Callable] = staticmethod(lead)
    INSTEAD: ClassVar[bool] = True

    gain: float = 2.0

    def row(self, dt: float, friction: FrictionEstimator) -> np.ndarray:
        """Return the row that `lead` reads."""
        return self._row(self.gain)
''',
    Line(
        "control/compensators/compensator.py",
        "from backdrive.control.compensators.extras import Extra",
        "from backdrive.control.compensators.lead import Lead  # noqa: F401 (EXTRAS takes it)",
    ),
    f"""
from backdrive.control.compensators.lead import Lead
{LOOP}
run(by_law(law).replace(extra=Lead()), slope=1.0)
""",
)

ESTIMATOR = Part(
    "estimator method",
    "control/estimators/plain.py",
    '''"""The external force of a joint whose acceleration is neglected."""

from __future__ import annotations

from backdrive._jit import leaf
from backdrive.control.estimators.method import Method


@leaf
def plain(c, i, s, j, q, dp, T, n):
    """Return what motor, gravity and friction leave."""
    return -n


PLAIN = Method("plain", plain)
''',
    Line(
        "control/estimators/external.py",
        "from backdrive.control.estimators.method import Method",
        "from backdrive.control.estimators.plain import PLAIN  # noqa: F401 (METHODS takes it)",
    ),
    """
from backdrive.control.estimators.external import ExternalForce
force, _ = ExternalForce(inertia=1.0, method="plain").run(np.zeros(50), np.full(50, 2.0), 1e-3)
assert force[-1] == -2.0, force
""",
)

PARTS = (ESTIMATOR, COMPENSATOR, KERNEL)
