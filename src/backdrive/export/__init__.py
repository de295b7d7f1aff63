"""Out of Python: what was identified and tuned, for firmware, simulators and arrays, generated from the kernels' own source."""

from __future__ import annotations

from backdrive.export.c import export_laws as export_laws
from backdrive.export.c import export_loop as export_loop
