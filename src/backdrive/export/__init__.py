"""Out of Python: what was identified and tuned, for firmware, simulators and arrays, generated from the kernels' own source."""
