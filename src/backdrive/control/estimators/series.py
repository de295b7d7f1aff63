"""The series of a log as estimators of one joint run along them: of one length, finite, torque on time."""

from __future__ import annotations

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import REFERENCE


def on_time(torque: np.ndarray, delay: float | np.ndarray, dt: float) -> np.ndarray:
    """Return torque that was recorded late as it acted: later samples, interpolated; its ends are held.

    Args:
        torque: as recorded [N.m or N], (n,) or (n, J).
        delay: by which it was recorded later than motion [s], one or (J,); negative: earlier.
        dt: sampling time [s].
    """
    delays = np.broadcast_to(delay, torque.shape[1:])
    if not np.any(delays):
        return torque
    k = np.arange(torque.shape[0], dtype=np.float64)
    columns = torque.reshape(torque.shape[0], -1).T
    shifted = [np.interp(k + d / dt, k, u) for u, d in zip(columns, delays.ravel(), strict=True)]
    return np.ascontiguousarray(np.array(shifted).T.reshape(torque.shape))


def check_series(
    position: np.ndarray,
    torque: np.ndarray,
    known: np.ndarray | None,
    temperature: np.ndarray | float | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return position, torque, known torque and temperature as kernels read them, (n,) each; one temperature may be (1,).

    Args:
        position: encoder readings [rad or m], (n,).
        torque: of the motor [N.m or N], (n,).
        known: torque of gravity and other joints [N.m or N], (n,); None: 0.
        temperature: [degC], one number or (n,); None: 20.

    Raises:
        InvalidInput: the series have different lengths, or a temperature is not finite.
    """
    series = (position, torque, np.zeros(np.size(position)) if known is None else known)
    q, u, g = (np.ascontiguousarray(x, dtype=np.float64) for x in series)
    if q.ndim != 1 or q.shape != u.shape or q.shape != g.shape or q.size == 0:
        raise InvalidInput(
            f"position {q.shape}, torque {u.shape}, known {g.shape}.", remedy="Give series of one length."
        )
    warmth = np.atleast_1d(np.asarray(REFERENCE if temperature is None else temperature, dtype=np.float64))
    if warmth.shape not in ((1,), q.shape) or not np.isfinite(warmth).all():
        raise InvalidInput(
            f"temperature {warmth.shape} for {q.size} samples, {np.count_nonzero(~np.isfinite(warmth))} not finite.",
            remedy="Give one finite number, or one per sample.",
        )
    return q, u, g, warmth
