"""Arrays and tables of unusual kinds: lazy frames, no rows, degrees, complex numbers, unknown channels."""

import warnings

import numpy as np
import pytest

from backdrive import Log, Sweep, check, identify, simulate
from backdrive.errors import InvalidInput, UnknownName
from backdrive.simulation.machines import machine

T = 0.01 * np.arange(50)
Q = np.stack([np.sin(T), 2.0 * np.sin(T)], axis=1)


@pytest.fixture(scope="module")
def frame() -> dict:
    log = simulate(machine("joint_1"), Sweep(stroke=0.35, top_speed=2.0, cycles=4), seed=0)
    return {"t": log.time, "q": log.position[:, 0], "tau": log.torque[:, 0]}


def test_a_lazy_frame_is_collected(frame):
    polars = pytest.importorskip("polars")
    lazy = polars.DataFrame(frame).lazy()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(Log.from_frame(lazy).position[:, 0], frame["q"])
        assert identify(lazy).model.names == ("joint_1",)


def test_check_takes_what_identify_takes(frame):
    pandas = pytest.importorskip("pandas")
    table, log = pandas.DataFrame(frame), Log.from_frame(frame)
    wrong = log.replace(torque=np.zeros_like(log.torque))
    names = [f.name for f in check(log)]
    assert [f.name for f in check(table)] == names
    both = check([log, wrong], plan=[None, None])
    assert [f.name for f in both if f.log == 0] == names
    assert "silent-torque" in [f.name for f in both if f.log == 1]
    with pytest.raises(InvalidInput, match="no log"):
        check([])
    with pytest.raises(InvalidInput, match="2 plans for 1 logs"):
        check(log, plan=[None, None])


@pytest.mark.parametrize("table", [{"t": [], "q": [], "tau": []}, "pandas", "polars"])
def test_a_table_without_rows_says_so(table):
    if isinstance(table, str):
        table = pytest.importorskip(table).DataFrame({"t": [], "q": [], "tau": []})
    with pytest.raises(InvalidInput, match="has no rows; its columns are t, q, tau"):
        Log.from_frame(table)


def test_arrays_may_be_in_degrees():
    plain = Log.from_arrays(T, position=Q, velocity=Q, torque=Q)
    log = Log.from_arrays(T, position=np.degrees(Q), velocity=np.degrees(Q), torque=Q, unit="deg")
    for name in ("position", "velocity", "torque"):
        np.testing.assert_allclose(log.channels[name], plain.channels[name], rtol=1e-14)
    assert [joint.unit for joint in log.joints] == ["rad", "rad"]
    assert "Converted from degrees, as asked: position, velocity." in log.notes
    mixed = Log.from_arrays(T, position=Q * [180.0 / np.pi, 1.0], unit=["deg", "m"])
    np.testing.assert_allclose(mixed.position, Q, rtol=1e-14)
    assert [joint.unit for joint in mixed.joints] == ["rad", "m"]
    assert Log.from_arrays(T, position=np.degrees(Q[:, 0]), unit="deg").position.max() < 1.0


def test_an_unknown_channel_is_answered_with_those_that_there_are():
    with pytest.raises(
        UnknownName, match="no channel 'joint'. Did you mean 'joints'.*position, velocity, torque"
    ):
        Log.from_arrays(T, position=Q, joint="elbow")
    with pytest.raises(UnknownName, match="Did you mean 'position'"):
        Log.from_arrays(T, positon=Q)


@pytest.mark.parametrize("make", [Log.from_arrays, lambda t, **more: Log(time=t, joints=("a", "b"), **more)])
def test_complex_numbers_are_named(make):
    with pytest.raises(InvalidInput, match="is an array of complex numbers"):
        make(T, position=Q + 0j)
