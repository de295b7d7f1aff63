"""The import contract of pyproject.toml and the imports that there are: layers, rooms, cycles."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path


def layers(root: Path) -> list[list[str]]:
    """Return the rooms of every layer of the contract, the ground last."""
    contracts = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (house,) = (c["layers"] for c in contracts if c["type"] == "layers")
    return [re.split(r"\s*[|:]\s*", layer) for layer in house]


def imports() -> dict[str, set[str]]:
    """Return module -> modules of the package that it imports, also within functions; not what only a type checker sees.

    The root is left out: it resolves the public names when they are first used.
    """
    import grimp

    graph = grimp.build_graph("backdrive", cache_dir=None, exclude_type_checking_imports=True)
    modules = graph.modules - {"backdrive"}
    return {m: graph.find_modules_directly_imported_by(m) & modules for m in modules}


def upward(graph: Mapping[str, set[str]], house: list[list[str]]) -> list[str]:
    """Return the imports of a higher layer, or of another room of the same; the ground is one room."""
    level = {f"backdrive.{name}": k for k, layer in enumerate(house) for name in layer}
    room = {name: ("ground" if k == len(house) - 1 else name) for name, k in level.items()}
    found = []
    for module, others in graph.items():
        for other in others:
            a, b = (".".join(m.split(".")[:2]) for m in (module, other))
            if a in level and b in level and room[a] != room[b] and level[b] <= level[a]:
                found.append(f"{module} -> {other}")
    return sorted(found)


def cycles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Return the sets of modules that import one another, directly or not."""
    reach = {m: _reached(graph, m) for m in graph}
    found, seen = [], set()
    for module in sorted(graph):
        if module not in seen:
            ring = sorted(m for m in reach[module] if module in reach[m])
            seen.update(ring)
            if ring:
                found.append(ring)
    return found


def _reached(graph: Mapping[str, set[str]], start: str) -> set[str]:
    waiting = list(graph[start])
    reached: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting.extend(graph[module])
    return reached
