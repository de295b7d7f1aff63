"""Comparison of two models of a robot, joint by joint: has friction changed?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from backdrive._arguments import NAMES, NUMBER, TABLE, check_arguments, either, guard_keywords, optional
from backdrive._upper import Display
from backdrive.errors import InvalidInput, check_type
from backdrive.identification.coupling import coupling_of_one
from backdrive.identification.drift.change import ALARM, REACH, Change, change_of, kind_of
from backdrive.identification.names import rename_joints, same_names
from backdrive.identification.quality import grade
from backdrive.model import FrictionModel
from backdrive.model.joint_friction import JointFriction

PAIR = "first", "second"
PAIRING = either("names of joints, or a dict from one model's to the other's", TABLE, NAMES)


@dataclass(frozen=True, kw_only=True)
class Comparison(Display):
    """The differences between two models.

    Attributes:
        changes: one per joint of both models.
        left_out: a sentence for every joint that only one model has, and for every assumption.
        models: the two.
    """

    changes: tuple[Change, ...]
    left_out: tuple[str, ...]
    models: tuple[FrictionModel, FrictionModel]

    @property
    def joints_with_change(self) -> tuple[str, ...]:
        """Return the joints whose friction changed by more than chance."""
        return tuple(c.joint for c in self.changes if c.is_significant)

    @property
    def joints_without_test(self) -> tuple[str, ...]:
        """Return the joints whose models lack the standard errors that a test needs."""
        return tuple(c.joint for c in self.changes if not c.is_testable)

    @property
    def is_testable(self) -> bool:
        """Return whether any joint has the standard errors that a test needs."""
        return any(c.is_testable for c in self.changes)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as `backdrive compare --json` prints them."""
        rows = {
            c.joint: {
                "outcome": kind_of(c),
                "verdict": c.verdict,
                "lowest_speed": c.lowest_speed,
                "top_speed": c.top_speed,
                "distance": {"positive": c.distance[0], "negative": c.distance[1], "unit": c.unit},
                "relative": {"positive": c.relative[0], "negative": c.relative[1]},
                "mean_change": c.mean,
                "mean_change_interval": [c.mean - REACH * c.mean_error, c.mean + REACH * c.mean_error],
                "chi_square": c.chi_square,
                "degrees_of_freedom": c.degrees,
                "probability": c.probability,
                "alarm": c.alarm,
                "remarks": c.remarks,
            }
            for c in self.changes
        }
        return {"changed": list(self.joints_with_change), "joints": rows, "left_out": list(self.left_out)}


@guard_keywords
def compare(
    first: FrictionModel,
    second: FrictionModel,
    *,
    joints: Sequence[str] | Mapping[str, str] | None = None,
    rename: Mapping[str, str] | None = None,
    top_speed: float | None = None,
    alarm: float = ALARM,
) -> Comparison:
    """Compare two models joint by joint; joints are matched by name.

    Args:
        first: the earlier one.
        second: the later one.
        joints: names to compare, or name in the first -> name in the second; None: all joints of both.
        rename: name in the second -> name in the first.
        top_speed: largest compared speed [rad/s or m/s]; None: as far as both models are valid.
        alarm: probability of a false alarm, for each joint.

    Raises:
        InvalidInput: the models have no joint in common, names are missing in the data of several joints and neither joints
            nor rename says which is which, or a number is invalid.
        UnknownName: a model does not have the joint.
    """
    for model in (first, second):
        check_type(model, FrictionModel, "friction model", "Give two, such as identify(log).model.")
    kinds = {
        "joints": optional(PAIRING),
        "rename": optional(TABLE),
        "top_speed": optional(NUMBER),
        "alarm": NUMBER,
    }
    check_arguments(kinds, {"joints": joints, "rename": rename, "top_speed": top_speed, "alarm": alarm})
    if top_speed is not None and not 0.0 < top_speed < float("inf"):
        raise InvalidInput(
            f"top_speed = {top_speed:g} is no speed.", remedy="Give a positive, finite number [rad/s or m/s]."
        )
    if not 0.0 < alarm < 1.0:
        raise InvalidInput(
            f"alarm = {alarm:g} is no probability.", remedy="Give one between 0 and 1, such as 0.01."
        )
    second = _rename_joints(second, rename or {})
    pairs, left_out = _pairs(first, second, joints, is_told=bool(joints or rename))
    left_out += coupling_of_one(first, second)
    changes = [_change(first.joint(a), second.joint(b), top_speed, alarm) for a, b in pairs]
    return Comparison(changes=tuple(changes), left_out=tuple(left_out), models=(first, second))


def _change(first: JointFriction, second: JointFriction, top_speed: float | None, alarm: float) -> Change:
    """Return the change of a joint, with a remark where one of its models is of no worth."""
    change = change_of(first, second, top_speed=top_speed, alarm=alarm)
    poor = [name for name, one in zip(PAIR, (first, second), strict=True) if grade(one).level == "poor"]
    said = [f"The {name} model of it was graded as not credible or poor." for name in poor]
    return replace(change, remarks=(*said, *change.remarks)) if said else change


def _rename_joints(model: FrictionModel, names: Mapping[str, str]) -> FrictionModel:
    """Return a model with its joints renamed."""
    if not names:
        return model
    joints = rename_joints(
        [friction.joint for friction in model.joints], [f"{a}={b}" for a, b in names.items()]
    )
    named = tuple(
        replace(friction, joint=joint) for friction, joint in zip(model.joints, joints, strict=True)
    )
    return replace(model, joints=named, coupling=None, coupled=())


def _pairs(
    first: FrictionModel,
    second: FrictionModel,
    joints: Sequence[str] | Mapping[str, str] | None,
    *,
    is_told: bool,
) -> tuple[list[tuple[str, str]], list[str]]:
    """Return pairs of names to compare, and a sentence for every joint that only one model has.

    Default names tell nothing but an order, by which columns that were swapped look like changed joints: several of them
    are matched only where it was told how.
    """
    if joints:
        words = dict(joints) if isinstance(joints, Mapping) else {name: name for name in joints}
        return [(first.joint(a).joint.name, second.joint(b).joint.name) for a, b in words.items()], []
    by_order = same_names([j.joint for j in first.joints], [j.joint for j in second.joints], *PAIR)
    if by_order and not is_told:
        raise InvalidInput(
            "Joints cannot be matched: names are missing in the data, and the order of columns alone does not tell which is "
            f"which (first: {', '.join(first.names)}; second: {', '.join(second.names)}).",
            remedy=f"If equal names mean equal joints: --joint {first.names[0]}, once for each (in Python "
            f"joints={list(first.names)!r}). Else --rename {second.names[0]}={first.names[-1]} and so on, or --names when "
            "reading.",
        )
    common = [name for name in first.names if name in second.names]
    if not common:
        raise InvalidInput(
            f"The models have no joint in common: {', '.join(first.names)}, and {', '.join(second.names)}.",
            remedy=f"Say which is which: --rename {second.names[0]}={first.names[0]}, once for each "
            f"(in Python rename={{{second.names[0]!r}: {first.names[0]!r}}}).",
        )
    left_out = [f"Joint '{n}' is only in the first model." for n in first.names if n not in common]
    left_out += [f"Joint '{n}' is only in the second model." for n in second.names if n not in common]
    sides = [*first.joints, *second.joints]
    if len(sides) == len(PAIR) and not is_told and any(one.joint.named is False for one in sides):
        left_out.append(
            "Names are missing in the data: the only joint of each model was taken as the same one."
        )
    return [(name, name) for name in common], left_out
