"""What a log holds, as plain values: joints, clock, range of each channel, sources, notes."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from backdrive._documents import plain
from backdrive._upper import upper
from backdrive.logs.log import Log, channel_unit


def describe(log: Log) -> dict[str, Any]:
    """Return plain values that describe a log, in SI units.

    Of each channel the smallest and the largest finite value of every joint are given, and how many samples are missing.
    """
    return plain(
        {
            "joints": [asdict(joint) for joint in log.joints],
            "samples": len(log),
            "duration": log.duration,
            "period": log.period,
            "channels": {
                name: [
                    {"joint": joint.name, "unit": channel_unit(name, joint), **_range(values[:, j])}
                    for j, joint in enumerate(log.joints)
                ]
                for name, values in log.channels.items()
            },
            "wrench": log.wrench is not None,
            "drive": None if log.drive is None else asdict(log.drive),
            "coupling": log.coupling,
            "plan": upper("plans.plan_file", "plan_to_dict")(log.plan) if hasattr(log.plan, "kind") else None,
            "sources": [asdict(source) for source in log.sources],
            "notes": log.notes,
        }
    )


def _range(values: np.ndarray) -> dict[str, float | int | None]:
    good = values[np.isfinite(values)]
    return {
        "smallest": float(good.min()) if good.size else None,
        "largest": float(good.max()) if good.size else None,
        "missing": values.size - good.size,
    }
