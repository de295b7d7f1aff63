"""Motors that drive several joints together: whether a model and what it meets are of the same ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.logs.log import Log
from backdrive.model import FrictionModel


def other_coupling(model: FrictionModel, logs: Sequence[Log]) -> list[str]:
    """Return a remark if motors drive several joints in the model or in a log, and not, or otherwise, in the other.

    Args:
        model: of some joints.
        logs: to which it is applied.
    """
    for log in logs:
        if model.coupling is not None and log.coupling is None:
            return [
                "Motors drive several of the model's joints together, and a log tells nothing of it: if its channels are those "
                "of the motors, read it with --coupling FILE."
            ]
        if model.coupling is None and log.coupling is not None:
            return ["A log was brought from coupled motors to its joints; the model is of no coupled motors."]
        alike = log.names == (model.coupled or model.names)
        if alike and log.coupling is not None and not np.allclose(log.coupling, model.coupling or ()):
            return ["Motors drive the joints by another coupling in a log than in the model."]
    return []


def coupling_of_one(first: FrictionModel, second: FrictionModel) -> list[str]:
    """Return a remark if motors drive several joints together in one of two models alone."""
    if (first.coupling is None) == (second.coupling is None):
        return []
    which, other = ("first", "second") if second.coupling is None else ("second", "first")
    return [
        f"Motors drive several joints of the {which} model together (--coupling), and the {other} one tells nothing of it: it may "
        "be one of the motors."
    ]
