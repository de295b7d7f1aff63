"""Modules and names that have moved: using an old name raises an error that states the new one."""

from __future__ import annotations

import sys

#: Former module below `backdrive` -> its present name; submodules moved with it unless they have their own entry.
MODULES = {
    "arm_loop": "simulation.arm_loop",
    "closed_loop": "simulation.closed_loop",
    "compensate": "control.compensators",
    "drift": "identification.drift",
    "estimate": "control.estimators",
    "excite": "plans",
    "experiments": "thesis",
    "filters": "logs.filters",
    "fitting": "identification.dynamic",
    "health": "logs.health",
    "fleet.simulated": "fleet.simulation",
    "identification.arm_expected": "identification.arm_forecast",
    "identification.dynamic.drive_of_log": "identification.dynamic.drive_stretch",
    "identification.dynamic.driven": "identification.dynamic.drive_stretch",
    "identification.dynamic.given_drive": "identification.dynamic.motion_task",
    "identification.dynamic.given_motion": "identification.dynamic.torque_task",
    "identification.dynamic.intervals": "identification.dynamic.uncertainty",
    "identification.dynamic.judging": "identification.validate",
    "identification.grade": "identification.quality",
    "identification.hysteresis": "identification.ramp",
    "identification.request": "identification.options",
    "identification.sweep_shown": "identification.sweep_verdict",
    "limits": "plans.limits",
    "log": "logs",
    "metrics": "identification.metrics",
    "model_bounds": "model.bounds",
    "model_file": "model.file",
    "plants": "simulation",
    "plants.thesis": "simulation.machines",
    "plots": "report.pictures",
    "plots.thesis": "thesis",
    "presets": "model.presets",
    "readers": "logs.readers",
    "reproduce": "thesis",
    "report.guided": "report.hand",
    "report.pictures.guided": "report.hand",
    "simulate": "simulation.open_loop",
    "tune": "tuning",
    "tuning.judging": "tuning.evaluation",
}


#: Public name of `backdrive` as it was -> as it is.
NAMES = {"fit": "identify(logs, law=...)"}


def refuse(name: str) -> None:
    """Raise an error with the new name of an old public name.

    Raises:
        Renamed: it was renamed.
    """
    if name in NAMES:
        from backdrive.errors import OldName

        raise OldName(f"backdrive.{name} has another name now.", remedy=f"Use backdrive.{NAMES[name]}.")


def new_name(module: str) -> str | None:
    """Return where a module is now, or None where it has not moved.

    Args:
        module: dotted name, `backdrive.compensate.dither`.
    """
    package, _, path = module.partition(".")
    parts = path.split(".")
    for count in range(len(parts), 0, -1):
        new = MODULES.get(".".join(parts[:count]))
        if new is not None:
            return ".".join([package, new, *parts[count:]])
    return None


class _Finder:
    """The last finder of the import system, for modules that no other finder knows."""

    def find_spec(self, fullname, path=None, target=None):
        new = new_name(fullname) if fullname.startswith("backdrive.") else None
        if new is not None:
            from backdrive.errors import OldName

            raise OldName(f"The module {fullname} has moved.", remedy=f"Import {new}.")


def install() -> None:
    """Have imports of old modules say where these are now."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())
