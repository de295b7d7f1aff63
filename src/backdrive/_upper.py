"""The one way to a room above: what a result shows of itself is done there, and opened by name when somebody asks for it."""

from __future__ import annotations

import importlib
from typing import Any


def upper(module: str, name: str) -> Any:
    """Return a member of a module that imports the one that asks for it.

    Args:
        module: below the package, `model.file`.
        name: of the member.
    """
    return getattr(importlib.import_module(f"backdrive.{module}"), name)
