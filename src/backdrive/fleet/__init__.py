"""A fleet: many joint logs identified with Dask, results in Parquet, queries with DuckDB, and tests for changes of friction."""

from __future__ import annotations

import importlib
from typing import Any

#: Public name -> module of this package; imported on first use, so that a command loads only what it needs.
_HOMES = {
    "LogEntry": "entries",
    "list_logs": "sources",
    "Outcome": "run",
    "run_fleet": "run",
    "Store": "store",
    "Event": "simulation",
    "FleetSimulation": "simulation",
    "History": "history",
    "histories": "history",
    "Drift": "drift",
    "drifts": "drift",
    "Outlier": "population",
    "outliers": "population",
    "Population": "population_file",
    "merge": "population",
    "run_query": "query",
    "silent_joints": "silence",
    "write_page": "page",
}

__all__ = [*_HOMES]  # noqa: PLE0604  (the table above is the list)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'backdrive.fleet' has no attribute '{name}'")
    return getattr(importlib.import_module(f"backdrive.fleet.{_HOMES[name]}"), name)
