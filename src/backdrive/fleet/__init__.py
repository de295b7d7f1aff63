"""A fleet: many joint logs identified with Dask, results in Parquet, queries with DuckDB, and tests for changes of friction."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

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

__all__ = [
    "Drift",
    "Event",
    "FleetSimulation",
    "History",
    "LogEntry",
    "Outcome",
    "Outlier",
    "Population",
    "Store",
    "drifts",
    "histories",
    "list_logs",
    "merge",
    "outliers",
    "run_fleet",
    "run_query",
    "silent_joints",
    "write_page",
]

if TYPE_CHECKING:
    from backdrive.fleet.drift import Drift as Drift
    from backdrive.fleet.drift import drifts as drifts
    from backdrive.fleet.entries import LogEntry as LogEntry
    from backdrive.fleet.history import History as History
    from backdrive.fleet.history import histories as histories
    from backdrive.fleet.page import write_page as write_page
    from backdrive.fleet.population import Outlier as Outlier
    from backdrive.fleet.population import merge as merge
    from backdrive.fleet.population import outliers as outliers
    from backdrive.fleet.population_file import Population as Population
    from backdrive.fleet.query import run_query as run_query
    from backdrive.fleet.run import Outcome as Outcome
    from backdrive.fleet.run import run_fleet as run_fleet
    from backdrive.fleet.silence import silent_joints as silent_joints
    from backdrive.fleet.simulation import Event as Event
    from backdrive.fleet.simulation import FleetSimulation as FleetSimulation
    from backdrive.fleet.sources import list_logs as list_logs
    from backdrive.fleet.store import Store as Store


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'backdrive.fleet' has no attribute '{name}'")
    return getattr(importlib.import_module(f"backdrive.fleet.{_HOMES[name]}"), name)
