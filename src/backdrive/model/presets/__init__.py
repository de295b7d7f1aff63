"""Published friction parameters as model files: `preset:mx106/m6`, `preset:franka/panda`, `preset:thesis/hp3j`, ...

Wherever a model file is asked for, `preset:NAME` stands for one of these. They are starting points and references, not
measurements of your joint. The provenance of each preset names the publication, its authors and its licence. Its warnings list
what was not published. `benchmarks/make_presets.py` writes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from typing import TYPE_CHECKING

from backdrive._catalog import lookup

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from backdrive.model.friction_model import FrictionModel

PREFIX = "preset:"


def preset_name(path: object) -> str | None:
    """Return the name behind `preset:`, which may be empty; None for anything else, such as the path of a file."""
    text = str(path).replace("\\", "/")  # as a Path writes it where folders are parted by backslashes
    return text.removeprefix(PREFIX).lower() if text.startswith(PREFIX) else None


def names() -> tuple[str, ...]:
    """Return the names of all presets, in order."""
    return tuple(_catalogue())


def load_preset(name: str) -> FrictionModel:
    """Return a preset.

    Args:
        name: such as `mx106/m6`.

    Raises:
        UnknownName: no such preset; the message names the nearest and lists all.
    """
    from backdrive.model.file import decode

    return decode(lookup(name, _catalogue(), "preset").read_bytes(), PREFIX + name)


def overview() -> Iterator[dict[str, str]]:
    """Yield the name, title, law and joints of each preset."""
    for name in names():
        model = load_preset(name)
        yield {
            "name": name,
            "title": str(model.options["title"]),
            "law": model.joints[0].law.name,
            "joints": ", ".join(model.names),
        }


def _catalogue() -> dict[str, Traversable]:
    """Name -> model file."""
    return {
        f"{family.name}/{file.name.removesuffix('.json')}": file
        for family in sorted(files(__name__).iterdir(), key=lambda f: f.name)
        if family.is_dir() and not family.name.startswith("_")
        for file in sorted(family.iterdir(), key=lambda f: f.name)
        if file.name.endswith(".json")
    }
