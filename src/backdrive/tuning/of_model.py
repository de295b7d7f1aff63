"""`tune` for a joint of a model: the model's data and the user's options, in one call."""

from __future__ import annotations

import inspect
from typing import Any

from backdrive._arguments import check_keywords
from backdrive.errors import InvalidInput, check_type
from backdrive.model import FrictionModel
from backdrive.tuning.facts import facts_of
from backdrive.tuning.goals import check_goal
from backdrive.tuning.propose import tune as tune_facts
from backdrive.tuning.tuning import Tuning

#: Options of the search; all others describe the joint (`facts_of`).
OF_SEARCH = ("wish", "stroke", "joints", "seed", "draw", "dither", "trip_speed", "limit", "effort", "say")
#: Options of the joint.
OF_JOINT = tuple(inspect.signature(facts_of).parameters)[1:]


def tune_joint(
    model: FrictionModel,
    joint: str | int | None = None,
    goal: str = "backdrive",
    *,
    top_speed: float | None = None,
    **more: Any,
) -> Tuning:
    """Choose a compensator's parameters for a joint, and check them over joints within the model's uncertainty.

    Args:
        model: of friction.
        joint: name or number; None: the only one.
        goal: `backdrive`, `track`, `estimate` or `admit`.
        top_speed: trip speed, above which the loop switches off [rad/s or m/s]; None: the model's.
        more: of the joint `stiffness`, `inertia`, `counts`, `noise`, `delay`, `interval`, ... as `tuning.facts_of` takes them; of
            the search `wish`, `limit`, `joints`, `seed`, ... as `tuning.tune` takes them.

    Raises:
        InvalidInput: several joints and none is named, or an option is unknown or makes no sense.
        NotIdentifiable: stiffness, inertia or encoder count is unknown; or no parameters are safe.
    """
    check_type(model, FrictionModel, "friction model", "Give one, such as identify(log).model.")
    if joint is None and len(model.joints) != 1:
        raise InvalidInput(
            f"The model has {len(model.joints)} joints.", remedy=f"Name one: {', '.join(model.names)}."
        )
    check_goal(goal)
    check_keywords("tune", more, ("model", "joint", "goal", "top_speed", *OF_JOINT, *OF_SEARCH))
    search = {name: more.pop(name) for name in OF_SEARCH if name in more}
    if top_speed is not None:
        search["trip_speed"] = top_speed
    facts = facts_of(model.joint(0 if joint is None else joint), **more)
    return tune_facts(facts, goal, **search)
