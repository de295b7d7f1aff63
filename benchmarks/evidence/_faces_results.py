"""Which classes are results: what the functions and methods of the API pages return, by their annotations."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path
from typing import Any

API = Path(__file__).parents[2] / "docs" / "api"
SHOWS = ("_repr_html_", "plot", "report", "summary", "to_dict")  # that a result has
PART = "a part of a result that shows itself"
SETTING = "a setting of a loop or a law, not a result"
ONLINE = "a value of a loop's tick"
#: Classes that are returned and do not show themselves, each with the reason.
EXCEPTIONS = {
    **dict.fromkeys(("JointForce", "JointFriction", "Choice", "Covariance"), PART),
    **dict.fromkeys(
        ("Admittance", "Compensator", "ExternalForce", "Growth", "JointLoop", "BareLoop", "Law"), SETTING
    ),
    **dict.fromkeys(("ArmForce", "ArmLoop", "MotionFilter", "Servo"), SETTING),
    **dict.fromkeys(("ArmForceTick", "ArmSeries", "Status"), ONLINE),
    "ArrayLaw": "a law as functions on arrays",
    "Answer": "a table of a query: columns and rows as they are",
    "BaseParameters": "what a robot's description makes identifiable: matrices, for further computation",
    "Drift": "one of a fleet's joints; `write_page` shows them all",
    "Facts": "data of a joint that `tune` takes",
    "Finding": "one sentence with its remedy, which `backdrive inspect` prints",
    "Fit": "numbers of a search, for further computation; `identify` makes a result of them",
    "History": "one of a fleet's joints over time; `write_page` shows them all",
    "Joint": "metadata of a log's column",
    "JointOfArm": "one column of a plan that shows itself",
    "JointSimulation": "a simulated machine, which `simulate` takes",
    "LogEntry": "the name of a file of a fleet",
    "Member": "a robot of a population",
    "Motions": "arrays of many lanes without a clock, for further computation",
    "Outcome": "counts of a fleet's run, whose sentences the command prints",
    "Outlier": "one of a fleet's joints; `write_page` shows them all",
    "Plan": "the base class of the plans of one joint, each of which has its cell",
    "Population": "what siblings have in common; a file that `compare` and `write_page` read",
    "Prior": "what `identify` takes; the model shows what became of it",
    "Robot": "a robot's description, which comes from a file",
    "Store": "a folder of results",
}


def public() -> dict[str, Any]:
    """Return every object of the API pages by its path."""
    paths = [
        p for page in sorted(API.glob("*.md")) for p in re.findall(r"^::: (\S+)", page.read_text(), re.M)
    ]
    return {path: _resolve(path) for path in paths}


def _resolve(path: str) -> Any:
    words = path.split(".")
    for n in range(len(words) - 1, 0, -1):
        try:
            found = import_module(".".join(words[:n]))
        except ImportError:
            continue
        for word in words[n:]:
            found = getattr(found, word)
        return found
    raise ImportError(path)


def _functions(value: Any) -> list[Any]:
    """Return a function itself, or the public methods of a class."""
    if not isinstance(value, type):
        return [value] if inspect.isfunction(value) else []
    members = [m for name, m in vars(value).items() if not name.startswith("_")]
    return [f for m in members if inspect.isfunction(f := getattr(m, "__func__", m))]


def _all_classes() -> dict[str, list[type]]:
    """Return the classes of all modules of the package that are loaded, by name."""
    import sys

    found: dict[str, set[type]] = {}
    for name, module in list(sys.modules.items()):
        for value in vars(module).values() if name.split(".")[0] == "backdrive" else ():
            if isinstance(value, type) and value.__module__.startswith("backdrive"):
                found.setdefault(value.__name__, set()).add(value)
    return {name: list(several) for name, several in found.items()}


def results() -> dict[str, type]:
    """Return the classes that public functions and methods return, by name; of a base class, its public subclasses too.

    Public classes that show themselves are among them whatever returns them.
    """
    shown = public()
    classes = {value.__name__: value for value in shown.values() if isinstance(value, type)}
    known = _all_classes()
    found: dict[str, type] = {}
    for value in shown.values():
        for function in _functions(value):
            text = str(inspect.unwrap(function).__annotations__.get("return", ""))
            for name in set(re.findall(r"(?<![.\w])[A-Z]\w+", text)) & known.keys():
                base = inspect.unwrap(function).__globals__.get(name) or known[name][0]
                if not isinstance(base, type):
                    continue
                found |= {name: base} | {n: c for n, c in classes.items() if issubclass(c, base)}
    found |= {name: value for name, value in classes.items() if shows_itself(value)}  # load_plan returns Any
    return dict(sorted(found.items()))


def shows_itself(kind: type) -> bool:
    """Return whether a class has all that a result shows of itself."""
    return all(hasattr(kind, name) for name in SHOWS)
