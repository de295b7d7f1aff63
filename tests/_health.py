"""Logs for the tests of health checks: one or several joints, and what a check says of them."""

from __future__ import annotations

import numpy as np

from backdrive import Joint, Log, check


def smooth(n=2000, dt=1e-3):
    t = dt * np.arange(n)
    return np.sin(2.0 * t) + 0.3 * np.sin(5.1 * t + 1.0)


def log_of(n=2000, dt=1e-3, unit="rad", **channels) -> Log:
    """Return a log on a regular clock; each channel (n,) or (n, J), all in one unit."""
    time = channels.pop("time", dt * np.arange(n))
    if not {"position", "velocity"} & channels.keys():
        channels["position"] = smooth(n, dt)
    arrays = {name: np.asarray(x, dtype=float).reshape(n, -1 if n else 1) for name, x in channels.items()}
    width = next(iter(arrays.values())).shape[1]
    return Log(time=time, joints=tuple(Joint(name=f"j{k}", unit=unit) for k in range(width)), **arrays)


def named(log, name, **options):
    """Return what one check finds."""
    return [f for f in check(log, **options) if f.name == name]


def about(finding):
    """Return joint, channel, severity, value, rows and whether it can be repaired."""
    where = None if finding.where is None else finding.where.tolist()
    return finding.joint, finding.channel, finding.severity, finding.value, where, finding.repairable
