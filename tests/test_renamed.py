"""Tests for _old_names.py: whoever asks for an old name is told the new one, and the new one is there."""

import importlib

import pytest

from backdrive._old_names import MODULES, new_name
from backdrive.errors import BackdriveError, OldName


@pytest.mark.parametrize("old", MODULES)
def test_an_old_module_says_where_it_is_now(old):
    parts = old.split(".")  # of a package that has moved, what lay below is not reached
    top = next(name for i in range(len(parts)) if (name := ".".join(parts[: i + 1])) in MODULES)
    with pytest.raises(OldName, match=rf"backdrive\.{top} has moved\. Import backdrive\.{MODULES[top]}\."):
        importlib.import_module(f"backdrive.{old}")
    importlib.import_module(f"backdrive.{MODULES[old]}")


def test_what_lay_below_moved_along():
    with pytest.raises(OldName, match=r"Import backdrive\.control\.compensators\."):
        importlib.import_module("backdrive.compensate.dither")
    assert new_name("backdrive.compensate.dither") == "backdrive.control.compensators.dither"
    with pytest.raises(OldName):
        from backdrive import plants  # noqa: F401
    assert new_name("backdrive.plants.thesis") == "backdrive.simulation.machines"
    assert new_name("backdrive.plants.hand") == "backdrive.simulation.hand"


def test_the_error_is_typed_and_other_names_are_unknown_as_ever():
    with pytest.raises(ImportError) as caught:
        importlib.import_module("backdrive.excite")
    assert isinstance(caught.value, BackdriveError)
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("backdrive.nothing")
    assert new_name("backdrive.laws") is None
