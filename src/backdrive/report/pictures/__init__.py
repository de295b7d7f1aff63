"""Pictures: the only home of plotting beside the report. matplotlib is loaded when one is drawn."""
