"""Export of identified and tuned results for firmware, simulators and array libraries, generated from the kernels' source."""

from __future__ import annotations

from backdrive.export.c import export_laws as export_laws
from backdrive.export.c import export_loop as export_loop
