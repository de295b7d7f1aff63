"""Values of the options of `backdrive identify`: parsed and checked."""

from __future__ import annotations

from math import isfinite, nan
from pathlib import Path
from typing import Any

from backdrive._catalog import lookup
from backdrive.cli._joint_options import numbers_by_name
from backdrive.engine import DriveModel
from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.drive_stretch import drive_unknowns, model_of
from backdrive.identification.timing import Timing
from backdrive.logs.log import Drive


def timing(word: str | None) -> Timing | None:
    if word is None:
        return None
    known: dict[str, Timing] = {"command": "command", "sample": "sample"}
    return lookup(word, known, "timing of the torque")


def prior(path: Path | None, type: str | None) -> Any:
    """Return the prior of a file: of a population's type, or a model.

    Args:
        path: of a population or a model file.
        type: of the robot; None: the population's only one.

    Raises:
        ModelFileError: the file is neither.
        InvalidInput: a type does not go with a model, or the population has several types and none is given.
        UnknownName: the population has no such type.
    """
    if path is None:
        if type is not None:
            raise InvalidInput(f"--prior-type {type} without a prior.", remedy="Add --prior population.json.")
        return None
    from backdrive.fleet.population_file import Population, is_population
    from backdrive.model import load_model

    if is_population(path):
        return Population.load(path).priors(type)
    if type is not None:
        raise InvalidInput(
            f"--prior-type {type}: {path} is no population.",
            remedy="Leave it out, or name a file of `backdrive fleet merge --population`.",
        )
    return load_model(path)


def payloads(text: str | None) -> list[tuple[float, float]] | None:
    if text is None:
        return None
    found = []
    for word in text.split(","):
        try:
            sine, cosine = map(float, (word if ":" in word else f"{word}:{word}").split(":"))
        except ValueError:
            sine = cosine = nan
        if not (isfinite(sine) and isfinite(cosine)) or (":" not in word and sine != 0.0):
            raise InvalidInput(
                f"--payload {word!r}: neither 0 nor SIN:COS.",
                remedy="A payload of 2 kg at 1 m that hangs level at q = 0 is 0:19.6.",
            )
        found.append((sine, cosine))
    return found


def bounds(words: list[str] | None) -> dict[str, tuple[float, float]]:
    found = {}
    for word in words or []:
        name, _, ends = word.partition("=")
        low, colon, high = ends.partition(":")
        try:
            found[name.strip()] = (float(low), float(high))
        except ValueError as error:
            raise InvalidInput(
                f"--bound {word}: not NAME=LOW:HIGH.", remedy="For example --bound stiffness=1e3:1e5."
            ) from error
        if not colon or not found[name.strip()][0] < found[name.strip()][1]:
            raise InvalidInput(
                f"--bound {word}: the lower end is not below the upper one.",
                remedy="Give the lower end first: NAME=LOW:HIGH.",
            )
    return found


def drive(words: str | None, ranges: dict[str, tuple[float, float]]) -> DriveModel | None:
    """Return the drive of the engine that a person names, or None."""
    if words is None:
        return None
    law, _, gains = words.partition(",")
    return model_of(Drive(law=law.strip(), gains=numbers_by_name([gains], "--drive")), drive_unknowns(ranges))  # type: ignore[arg-type]
