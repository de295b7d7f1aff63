"""Several joints, some without a torque: what is said names the joint, and both ways out work."""

import re

import numpy as np
import pytest

from _commands import called
from backdrive import read_log
from backdrive.errors import InvalidInput

T = np.arange(200) * 0.01
Q = np.column_stack([np.sin(T), np.cos(T), np.sin(2.0 * T)])

TABLES = {
    "numbered": ("q_1,q_2,q_3,tau_1,tau_2,i_3", "joint_3", "tau=tau_1,tau_2,i_3", "joint_1,joint_2"),
    "suffixes": (
        "hip_pos,knee_pos,toe_pos,hip_effort,knee_effort,x",
        "toe",
        "tau=hip_effort,knee_effort,x",
        "hip,knee",
    ),
    "paths": (
        "/js/hip/position,/js/knee/position,/js/toe/position,/js/hip/effort,x,/js/toe/effort",
        "knee",
        "tau=/js/hip/effort,x,/js/toe/effort",
        "hip,toe",
    ),
}


def table(path, header):
    columns = np.column_stack([T, Q, 2.0 * Q])
    np.savetxt(path, columns, delimiter=",", header=f"time,{header}", comments="", fmt="%.9g")
    return path


def read(path, **options):
    return read_log(path, guarded=False, **options)


@pytest.mark.parametrize("name", TABLES)
def test_both_ways_that_are_told_work(tmp_path, name):
    header, joint, option, kept = TABLES[name]
    path = table(tmp_path / "log.csv", header)
    log = read(path)
    (note,) = (n for n in log.notes if n.startswith("No column was taken as torque"))
    assert f"torque: {joint} has none" in note and "Columns: time 200" in note
    told = re.search(r"--map (.*?), or leave", note)[1]
    assert told.replace("COLUMN", "i_3" if name == "numbered" else "x") == option
    with pytest.raises(InvalidInput) as refused:
        log.need("torque")
    assert note in refused.value.remedy
    mapped = read(path, map=option)
    assert mapped.torque.shape == (200, 3) and mapped.names == log.names
    assert not any(n.startswith("No column") for n in mapped.notes)
    assert f"--names {kept}. " in note
    for names in (kept.split(","), kept.split(",")[::-1]):
        rest = read(path, names=names)
        assert rest.names == tuple(names)
        assert np.allclose(rest.torque, 2.0 * rest.position)


def test_the_page_says_it_once(tmp_path):
    shown = called("inspect", table(tmp_path / "log.csv", TABLES["suffixes"][0])).stdout
    assert " ".join(shown.split()).count("toe has none") == 1
    assert "--map tau=COLUMN." not in shown


def test_names_inside_the_log_are_those_that_are_told(tmp_path):
    rows = "\n".join(f"{t:.2f},hip,knee,{t},{2 * t},{t}" for t in T)
    path = tmp_path / "n.csv"
    path.write_text(f"time,name[0],name[1],position[0],position[1],effort[0]\n{rows}\n")
    (note,) = (n for n in read(path).notes if "--names hip. " in n)
    assert "--map 'tau=\"effort[0]\",COLUMN'" in note
    log = read(path, names="hip")
    assert log.names == ("hip",) and np.allclose(log.torque, log.position)


def test_other_names_than_those_of_the_file_choose_nothing(tmp_path):
    path = table(tmp_path / "log.csv", TABLES["numbered"][0])
    log = read(path, names="a,b,c")
    assert log.names == ("a", "b", "c") and log.torque is None
    assert read(path, map="tau=tau_1,tau_2,i_3", names="joint_2,joint_1").torque.shape == (200, 2)


def test_other_numbers_than_those_of_the_positions_are_named_one_by_one(tmp_path):
    log = read(table(tmp_path / "log.csv", "q1,q2,q3,tau0,tau1,tau2"))
    assert any("name 3 with --map tau=COLUMN,COLUMN..." in note for note in log.notes)
