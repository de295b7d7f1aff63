"""Samples that are infinite."""

from __future__ import annotations

import numpy as np

from backdrive.logs.health._holes import check_holes

find = check_holes("infinite", "infinite values", "infinite", np.isinf)
