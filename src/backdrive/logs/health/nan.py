"""Samples that are not a number."""

from __future__ import annotations

import numpy as np

from backdrive.logs.health._holes import check_holes

find = check_holes("nan", "values that are not a number", "NaN", np.isnan)
