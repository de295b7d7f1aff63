"""Loops for tests: of compensators by themselves, and of joints within their limits."""

import warnings

from backdrive.control import BareLoop, JointLoop, Loop, torque_limit
from backdrive.errors import LimitWarning


class Bench(Loop):
    """A loop that takes joints without guards: what a compensator or an estimator does by itself."""

    def _admit(self):
        pass


def bench(dt, **parts):
    """Return a loop of one joint without guards."""
    return Bench(BareLoop(**parts), interval=dt)


def guarded(compensator, *, top_speed, encoder_count=1e-6, **changes):
    """Return a joint within its limits; a limit above 1.5 R F is meant here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LimitWarning)
        changes = {"limit": torque_limit(compensator, top_speed)} | changes
        return JointLoop(compensator=compensator, top_speed=top_speed, encoder_count=encoder_count, **changes)
