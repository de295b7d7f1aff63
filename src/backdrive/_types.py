"""Names of types that the signatures of kernels share."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Pair = tuple[float, float]  # a load: motor-side and external torque [N.m or N]
