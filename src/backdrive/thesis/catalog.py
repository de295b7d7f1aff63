"""The catalogue of experiments by name; their modules are imported when they run.

The experiment `fig-3.8` is the module `backdrive.thesis.fig_3_8` with its functions `run` and `draw`. An experiment whose module
is missing is left out of `all` and of its chapter.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput


@dataclass(frozen=True, kw_only=True)
class Entry:
    """An experiment that can be run.

    Attributes:
        name: `fig-3.8`, `table-2.2`, `league`.
        group: `chapter-3`, or `beyond` for what is not in the thesis.
        title: what it shows.
    """

    name: str
    group: str
    title: str

    @property
    def module(self) -> str:
        """Module that runs and draws it."""
        return "backdrive.thesis." + self.name.replace("-", "_").replace(".", "_")

    @property
    def available(self) -> bool:
        """Whether its module is there."""
        return importlib.util.find_spec(self.module) is not None


_TITLES = {
    "chapter-2": {
        "fig-2.2": "Desired trajectory of the sweep",
        "fig-2.3": "Data of a sweep and the windows around its velocity peaks",
        "fig-2.6": "Measured torque and identified curves of Joint 1 by stroke",
        "fig-2.7": "Identified curves of each joint by stroke",
        "fig-2.8": "Distance of each curve from that of the longest stroke",
        "fig-2.9": "Identified curves of Joint 1 by posture",
        "table-2.2": "Distance of each posture's curve from that of posture (i)",
        "fig-2.11": "Joints moved by hand, without and with friction compensation",
        "fig-2.12": "Mean magnitudes of velocity and hand torque",
        "fig-2.13": "Saw-tooth tracking with four compensations",
        "fig-2.14": "Tracking errors of four compensations",
    },
    "chapter-3": {
        "fig-3.3": "Presliding displacement",
        "fig-3.4": "Identified rate-dependent friction",
        "fig-3.6": "Displacement by a sinusoidal dither",
        "fig-3.7": "Setup A moved by hand with five compensators",
        "fig-3.8": "Force peaks by compensator, Setup A",
        "fig-3.9": "Setup B moved by hand with five compensators",
        "fig-3.10": "Torque peaks by compensator, Setup B",
        "fig-3.11": "Hold and release with three decay rates",
    },
    "chapter-4": {
        "fig-4.3": "Identified rate-dependent friction",
        "fig-4.7": "External force estimated with three friction estimators",
        "fig-4.8": "Sensorless admittance control with three friction estimators",
        "fig-4.9": "Equilibrium of admittance control with an elastoplastic estimator",
        "fig-4.10": "Measured force beside the virtual mass and viscosity",
        "fig-4.11": "Admittance control with three decay rates",
    },
    "beyond": {"league": "All compensators and estimators on the same joints"},
}

#: Every experiment, in the order of the thesis.
ENTRIES: tuple[Entry, ...] = tuple(
    Entry(name=name, group=group, title=title)
    for group, titles in _TITLES.items()
    for name, title in titles.items()
)


def entry(name: str) -> Entry:
    """Return an experiment by name; an unknown name is answered with the known ones."""
    return lookup(name, {e.name: e for e in ENTRIES}, "known experiment")


def choose(words: Sequence[str] = ()) -> list[Entry]:
    """Return the requested experiments, each once, in the order of the thesis.

    Args:
        words: names, chapters (`chapter-3`, or `3`), or `all`; nothing means `all`.

    Raises:
        UnknownName: there is no such experiment or chapter.
        InvalidInput: what is asked for has no program yet.
    """
    wanted: set[str] = set()
    for word in words or ("all",):
        key = word.strip().lower().replace("_", "-")
        key = f"chapter-{key}" if key.isdigit() else key
        if key in _TITLES or key == "all":
            found = [e.name for e in ENTRIES if key in ("all", e.group) and e.available]
            if not found:
                raise InvalidInput(f"Nothing of '{word}' has a program yet.", remedy=_remedy())
            wanted.update(found)
        elif entry(key).available:
            wanted.add(key)
        else:
            raise InvalidInput(f"The experiment '{key}' has no program yet.", remedy=_remedy())
    return [e for e in ENTRIES if e.name in wanted]


def _remedy() -> str:
    return f"Choose from: {', '.join(e.name for e in ENTRIES if e.available)}."
