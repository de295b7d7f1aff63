"""Joint names that a file lists once, beside its columns, in every format that can hold words."""

import json
import zipfile

import numpy as np
import pytest

from backdrive import read_log

T = np.arange(400) / 100.0
Q = np.column_stack([np.sin(T), np.cos(1.3 * T)])
NAMES = ["shoulder", "elbow"]


def npz(path, word, names):
    np.savez(path, t=T, q=Q, **{word: np.array(names)})


def npz_of_bytes(path, word, names):
    np.savez(path, t=T, q=Q, **{word: np.array([str(name).encode() for name in names])})


def mat(path, word, names):
    from scipy.io import savemat

    savemat(path, {"t": T, "q": Q, word: np.array(names, dtype=object)})


def mat_of_letters(path, word, names):
    from scipy.io import savemat

    savemat(path, {"t": T, "q": Q, word: names})


def hdf5(path, word, names):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["t"], file["q"], file[f"about/{word}"] = T, Q, names


def json_(path, word, names):
    path.write_text(json.dumps({"t": T.tolist(), "q": Q.tolist(), word: names}))


WRITERS = {
    "a.npz": npz,
    "b.npz": npz_of_bytes,
    "a.mat": mat,
    "b.mat": mat_of_letters,
    "a.h5": hdf5,
    "a.json": json_,
}


@pytest.mark.parametrize("word", ["joint_names", "names"])
@pytest.mark.parametrize("file", WRITERS)
def test_joints_have_the_names_that_the_file_lists(tmp_path, file, word):
    WRITERS[file](tmp_path / file, word, NAMES)
    log = read_log(tmp_path / file)
    assert log.names == tuple(NAMES) and all(joint.named for joint in log.joints)
    assert not [note for note in log.notes if "left out" in note]


@pytest.mark.parametrize(
    ("word", "names", "said"),
    [
        ("names", ["a", "b", "c"], "3 names of joints, a, b, c, were left out: the columns are of 2."),
        ("names", ["a", "a"], "'names' names a, a, some of them twice, and was left out."),
        ("names", ["a", " "], "'names' is no list of names and was left out."),
        ("comment", NAMES, "Array 'comment' is not one- or two-dimensional numbers and was left out."),
        ("names", "ab", "Array 'names' is not one- or two-dimensional numbers and was left out."),
        ("names", [NAMES], "Array 'names' is not one- or two-dimensional numbers and was left out."),
        (
            "names",
            ["x" * 5000, "b"],
            "Array 'names' is not one- or two-dimensional numbers and was left out.",
        ),
    ],
)
def test_what_names_no_joints_is_left_out_and_told(tmp_path, word, names, said):
    npz(tmp_path / "a.npz", word, names)
    log = read_log(tmp_path / "a.npz")
    assert log.names == ("joint_1", "joint_2") and not any(joint.named for joint in log.joints)
    assert said in log.notes


def test_a_word_about_the_file_names_no_joint(tmp_path):
    from scipy.io import savemat

    for word, named in (("name", False), ("joint_name", True)):
        savemat(tmp_path / "a.mat", {"t": T, "q": Q[:, :1], word: "run three"})
        (joint,) = read_log(tmp_path / "a.mat").joints
        assert (joint.name == "run three") is named


def test_names_that_would_steer_a_terminal_are_shown(tmp_path):
    npz(tmp_path / "a.npz", "names", ["\x1b[31mred", "b"])
    assert read_log(tmp_path / "a.npz").names == ("\\x1b[31mred", "b")


def test_letters_that_are_none_are_shown_by_their_numbers(tmp_path):
    npz(tmp_path / "a.npz", "names", NAMES)
    with (
        zipfile.ZipFile(tmp_path / "a.npz") as old,
        zipfile.ZipFile(tmp_path / "b.npz", "w") as new,
    ):
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content.replace(b"h\0\0\0", b"\0\xd8\0\0") if name == "names.npy" else content)
    assert read_log(tmp_path / "b.npz").names == ("s\\ud800oulder", "elbow")
