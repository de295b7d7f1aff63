"""Tables of text with a list in a cell, as data frames and hand-written loggers make them."""

import numpy as np
import pytest

from backdrive import read_log

N = 300
Q = np.round(np.stack([np.sin(0.01 * np.arange(N)), 0.5 * np.cos(0.02 * np.arange(N))], axis=1), 6)


def written(path, head, row):
    path.write_text(head + "\n" + "".join(row(0.01 * i, *Q[i]) + "\n" for i in range(N)))
    return read_log(str(path))


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("time,name,position,effort", '{t},"[\'a\', \'b\']","[{x}, {y}]","[{y}, {x}]"'),
        ("time;name;position;effort", "{t};['a', 'b'];[{x}, {y}];[{y}, {x}]"),
        ("time,name,position,effort", "{t},a;b,[ {x}  {y}],[{y} {x} ]"),
        ("time,name,position,effort", "{t},\"('a', 'b')\",\"array('d', [{x}, {y}])\",\"({y}, {x})\""),
        (
            "time,name,position,effort",
            '{t},"[\'a\' \'b\']","[{x}\n {y}]","[np.float64({y}), np.float64({x})]"',
        ),
    ],
)
def test_a_list_in_a_cell_is_a_column_a_joint(tmp_path, head, row):
    log = written(tmp_path / "log.csv", head, lambda t, x, y: row.format(t=f"{t:.2f}", x=x, y=y))
    assert log.names == ("a", "b")
    np.testing.assert_array_equal(log.position, Q)
    np.testing.assert_array_equal(log.torque, Q[:, ::-1])


def test_a_cut_line_is_dropped_and_lists_of_other_lengths_are_left_out(tmp_path):
    path = tmp_path / "log.csv"
    rows = [
        f'{0.01 * i:.2f},"[{x}, {y}]","[{y}, {x}]","[{", ".join("1" * (i % 2 + 1))}]"'
        for i, (x, y) in enumerate(Q)
    ]
    path.write_text("\n".join(["time,position [deg],effort,contacts", *rows, '3.00,"[0.1, ']))
    log = read_log(str(path))
    np.testing.assert_allclose(log.position, np.deg2rad(Q))
    assert any("cut" in note for note in log.notes)
    assert any("'contacts'" in note for note in log.notes)


def test_brackets_in_names_and_units_are_no_lists(tmp_path):
    log = written(tmp_path / "a.csv", "time,q [rad],tau [N.m],state", lambda t, x, y: f"{t:.2f},{x},{y},[ok]")
    np.testing.assert_array_equal(log.position[:, 0], Q[:, 0])
    assert any("'state' holds words" in note for note in log.notes)
    log = written(tmp_path / "b.csv", "time,q,tau\n[s],[deg],[N.m]", lambda t, x, y: f"{t:.2f},{x},{y}")
    np.testing.assert_allclose(log.position[:, 0], np.deg2rad(Q[:, 0]))


def test_columns_of_names_that_named_the_joints_are_not_said_to_be_left_out(tmp_path):
    head = "time,name[0],name[1],position[0],position[1]"
    log = written(tmp_path / "log.csv", head, lambda t, x, y: f"{t:.2f},a,b,{x},{y}")
    assert log.names == ("a", "b")
    assert not any("left out" in note for note in log.notes)
