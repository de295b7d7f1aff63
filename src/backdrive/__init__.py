"""Identify, compensate and estimate the friction of robot joints from ordinary joint logs.

Public names are resolved when first used, so that importing the package loads no numerics.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from backdrive import _old_names

__version__ = "0.1.0"

_HOMES = {
    "BackdriveError": "backdrive.errors",
    "Joint": "backdrive.logs.log",
    "Log": "backdrive.logs.log",
    "Drive": "backdrive.logs.log",
    "read_log": "backdrive.logs.readers",
    "read_logs": "backdrive.logs.readers",
    "check": "backdrive.logs.health",
    "Sweep": "backdrive.plans",
    "identify": "backdrive.identification",
    "FrictionModel": "backdrive.model",
    "load_model": "backdrive.model",
    "Axis": "backdrive.engine",
    "DriveModel": "backdrive.engine",
    "Law": "backdrive.laws",
    "fit_motion": "backdrive.identification.dynamic",
    "forward": "backdrive.engine",
    "rollout": "backdrive.engine",
    "compare": "backdrive.identification.drift.comparison",
    "simulate": "backdrive.simulation.of_model",
    "tune": "backdrive.tuning.of_model:tune_joint",
}

__all__ = [  # noqa: RUF022  (sorted by use)
    "__version__",
    "Axis",
    "BackdriveError",
    "Drive",
    "FrictionModel",
    "Joint",
    "Law",
    "Log",
    "Sweep",
    "check",
    "compare",
    "forward",
    "identify",
    "load_model",
    "read_log",
    "read_logs",
    "rollout",
    "simulate",
    "tune",
]

if TYPE_CHECKING:
    from backdrive.engine import Axis as Axis
    from backdrive.engine import DriveModel as DriveModel
    from backdrive.engine import forward as forward
    from backdrive.engine import rollout as rollout
    from backdrive.errors import BackdriveError as BackdriveError
    from backdrive.identification import identify as identify
    from backdrive.identification.drift.comparison import compare as compare
    from backdrive.identification.dynamic import fit_motion as fit_motion
    from backdrive.laws import Law as Law
    from backdrive.logs.health import check as check
    from backdrive.logs.log import Drive as Drive
    from backdrive.logs.log import Joint as Joint
    from backdrive.logs.log import Log as Log
    from backdrive.logs.readers import read_log as read_log
    from backdrive.logs.readers import read_logs as read_logs
    from backdrive.model import FrictionModel as FrictionModel
    from backdrive.model import load_model as load_model
    from backdrive.plans import Sweep as Sweep
    from backdrive.simulation.of_model import simulate as simulate
    from backdrive.tuning.of_model import tune_joint as tune


_old_names.install()


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        _old_names.refuse(name)
        raise AttributeError(f"module 'backdrive' has no attribute '{name}'")
    home, _, member = _HOMES[name].partition(":")
    value = getattr(importlib.import_module(home), member or name)
    if callable(
        value
    ):  # `backdrive.identification` is a package and a function; the function is the public name
        globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
