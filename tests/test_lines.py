"""Lines of the command line: messages that go to a pipe are as wide as a page, and nothing that is copied is broken."""

import io
import sys

import pytest

from _commands import called, started
from backdrive.cli._lines import USUAL, wrap


def lines_of(text, monkeypatch, columns=""):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setenv("COLUMNS", columns)
    return wrap(text, sys.stderr).split("\n")


@pytest.mark.parametrize(
    "whole",
    [
        "--known delay=0.004",
        "(--torque-timing sample)",
        '--map "tau=0.001 * current"',
        'pip install "backdrive[report]"',
        "backdrive laws --json",
        "backdrive show m.json",
        "'stribeck-gauss + lugre'",
        "/tmp/a folder/the log of monday.csv",
        "/home/" + 30 * "long/" + "log.csv",
    ],
)
def test_what_is_copied_is_not_broken(monkeypatch, whole):
    for before in range(1, USUAL):
        text = f"{'x' * before} {whole} and more words that follow it until the line is full."
        lines = lines_of(text, monkeypatch)
        assert any(whole in line for line in lines)
        assert all(len(line) <= USUAL or line.strip() == whole for line in lines)
        assert " ".join(line.strip() for line in lines) == text


def test_lines_are_as_wide_as_columns_says_and_results_stay_whole(monkeypatch):
    text = 30 * "some words "
    assert max(map(len, lines_of(text, monkeypatch, "60"))) <= 60
    assert max(map(len, lines_of(text, monkeypatch, "many"))) <= USUAL
    assert lines_of("  indented\n" + text, monkeypatch)[0] == "  indented"
    assert wrap(text, io.StringIO()) == text


ERRORS = [
    ("identify", "no/such/log.csv", "-o", "m.json"),
    ("plan", "sweep", "--stroke-deg", "20", "--top-speed", "2", "--lower", "-0.1", "--upper", "0.1"),
    (
        "plan",
        "sweep",
        "--stroke-deg",
        "20",
        "--top-speed",
        "2",
        "--margin",
        "9",
        "--lower",
        "-1",
        "--upper",
        "1",
    ),
    ("plan", "arm", "--duration", "5"),
    ("laws", "coulom"),
    ("identify", "x.csv", "--report", "r.pdf"),
    ("identify", "x.csv", "--bound", "stiffness"),
    ("tune", "preset:no"),
    ("fleet", "run", "-o", "nowhere"),
    ("inspect", "x.csv", "--map", "t=a b c d e f", "--unit", "deg"),
    ("show",),
]


@pytest.mark.parametrize("words", ERRORS, ids=" ".join)
def test_errors_fit_a_page(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wide = called(*words, COLUMNS="2000").stderr
    done = called(*words, COLUMNS="")
    assert done.returncode
    assert max(map(len, done.stderr.splitlines())) <= USUAL
    assert done.stderr.split() == wide.split()


def test_errors_of_a_process_fit_a_page(tmp_path):
    done = started(*ERRORS[2], cwd=tmp_path, COLUMNS="")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) > 1
    assert max(map(len, done.stderr.splitlines())) <= USUAL


def test_json_with_a_long_text_is_broken_at_the_width(monkeypatch):
    """A text longer than a quotation is; the quotes behind it were paired the wrong way, and nothing was broken."""
    pairs = ", ".join(f'"key_{i}": "value_{i}"' for i in range(9))
    line = 'options {"citation": "' + "word " * 20 + 'end, 2024", ' + pairs
    assert max(map(len, lines_of(line, monkeypatch))) <= USUAL
