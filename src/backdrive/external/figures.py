"""The figures of an estimate as plain values: RMS, largest value, share outside the band, calibration, contacts."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from backdrive.external.result import ForceEstimate, JointForce
    from backdrive.external.wrench import WrenchEstimate


def figures(result: ForceEstimate) -> dict[str, Any]:
    """Return the figures of an estimate, in SI units."""
    joints = {j.joint.name: joint_figures(j) for j in result.joints}
    for name, calibration in result.calibrations.items():
        if name in joints:
            bands = {"moving": calibration.moving, "reversing": calibration.reversing}
            joints[name]["calibration"] = {"duration": calibration.duration} | {
                state: None if b is None else asdict(b) for state, b in bands.items()
            }
    values: dict[str, Any] = {"joints": joints, "warnings": list(result.remarks)}
    if result.wrench is not None:
        values["wrench"] = wrench_figures(result.wrench)
    if result.contacts is not None:
        values["false_alarms_per_hour"] = result.false_alarms
        values["thresholds"] = [asdict(t) for t in result.thresholds]
        values["contacts"] = [
            {"begin": c.begin, "end": c.end, "joints": list(c.joints), "forces": dict(c.forces)}
            for c in result.contacts
        ]
    return values


def joint_figures(one: JointForce) -> dict[str, Any]:
    """Return the figures of a joint, in SI units."""
    largest = int(np.argmax(np.abs(one.force)))
    return {
        "method": one.method,
        "bandwidth": one.bandwidth,
        "lag": None if np.isnan(one.lag) else one.lag,
        "unit": one.joint.torque_unit,
        "rms": float(np.sqrt(np.mean(one.force**2))),
        "largest": float(one.force[largest]),
        "time_of_largest": float(one.time[largest]),
        "share_outside_band": float(np.mean(one.outside)),
        "rms_error": one.rms_error,
    }


def wrench_figures(wrench: WrenchEstimate) -> dict[str, Any]:
    """Return the figures of a wrench, in SI units."""
    error, blind = wrench.rms_error, wrench.blind_direction
    return {
        "frame": wrench.frame,
        "components": ["fx", "fy", "fz", "mx", "my", "mz"],
        "rms": np.sqrt(np.mean(wrench.wrench**2, axis=0)).tolist(),
        "largest": wrench.wrench[np.abs(wrench.wrench).argmax(axis=0), range(6)].tolist(),
        "standard_deviation": np.median(wrench.deviation, axis=0).tolist(),
        "share_singular": float(np.mean(wrench.singular)),
        "blind_direction": None if blind is None else blind.tolist(),
        "rms_error": None if error is None else error.tolist(),
    }
