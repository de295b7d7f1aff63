"""What others have named, files, columns, options, is quoted where it is shown; and what is advised exists."""

import ast
import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

import backdrive
from backdrive._visible import visible
from backdrive.cli import app, main
from backdrive.cli._output import console, print_json
from backdrive.errors import InvalidInput

HOSTILE = "a\x1b[31mb\x07\x9b2J\u202ec\u2066d\u200fe\x7f\r"
STEERS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
SOURCE = Path(backdrive.__file__).parent


def answer(monkeypatch, capsys, *words) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["backdrive", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    return ended.value.code, out + err


def test_controls_and_bidi_marks_are_quoted_and_nothing_else():
    assert visible(HOSTILE) == r"a\x1b[31mb\x07\x9b2J\u202ec\u2066d\u200fe\x7f\r"
    assert visible("\ud800\U000e0041\u2028") == r"\ud800\U000e0041\u2028"
    for plain in ("Gelenk_größe [N·m]", "関節 1", "a\u00a0b\u3000c", "C:\\x1b", "🤖"):
        assert visible(plain) == plain
    assert visible("a\nb\t", keep="\n\t") == "a\nb\t"
    assert visible("a\nb\t") == r"a\nb\t"
    for code in range(
        0x110000
    ):  # every character of the classes Cc, Cf, Zl, Zp that Unicode has for turning or steering
        if STEERS.match(chr(code)):
            assert visible(chr(code)) != chr(code)


def test_an_error_quotes_the_names_in_it():
    error = InvalidInput(f"No joint '{HOSTILE}'.", remedy=f"Names: {HOSTILE}.")
    assert not STEERS.search(str(error) + error.message + error.remedy)
    assert r"\x1b[31m" in str(error)


@pytest.mark.parametrize(
    "words",
    [
        ["show", HOSTILE],
        [HOSTILE],
        ["show", "x.json", f"--{HOSTILE}"],
        ["laws", HOSTILE],
        ["plan", HOSTILE, "--stroke", "1"],
        ["plan", "sweep", "--stroke", HOSTILE],
        ["plan", "sweep", "--joint", HOSTILE, "--stroke", "1", "--top-speed", "1"],
        ["inspect", HOSTILE, "--map", HOSTILE],
        ["identify", HOSTILE, "-o", f"{HOSTILE}/x"],
        ["compare", HOSTILE, HOSTILE],
        ["tune", f"preset:{HOSTILE}"],
        ["reproduce", HOSTILE],
    ],
)
def test_a_hostile_option_is_quoted(words, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, said = answer(monkeypatch, capsys, *words)
    assert code in (2, 3)
    assert not STEERS.search(said), said


@pytest.mark.parametrize("more", [[], ["--json"]])
def test_a_hostile_log_is_quoted(more, monkeypatch, capsys, tmp_path):
    t = np.arange(1000) / 200.0
    columns = {"t": t, "q": np.sin(t), "tau": np.cos(t), f"tau {HOSTILE}": t}
    path = tmp_path / f"{HOSTILE}.npz"
    with open(path, "wb") as stream:
        np.savez(stream, **columns)
    mapping = f'tau="tau {visible(HOSTILE)}"'
    _, said = answer(monkeypatch, capsys, "inspect", str(path), "--names", HOSTILE, "--map", mapping, *more)
    assert not STEERS.search(said), said
    assert r"\x1b[31m" in said or r"\u001b[31m" in said
    if more:
        assert json.loads(said)["joints" if "joints" in json.loads(said) else "logs"]


def test_json_keeps_what_it_escapes(capsys):
    print_json({HOSTILE: HOSTILE, "größe": "ü"})
    out = capsys.readouterr().out
    assert not STEERS.search(out)
    assert json.loads(out) == {HOSTILE: HOSTILE, "größe": "ü"}


def test_tables_quote_and_keep_their_colours():
    from rich.table import Table

    made = console()
    made.file = stream = io.StringIO()
    made._force_terminal, made._color_system = True, made._color_system or None
    table = Table("a")
    table.add_row(HOSTILE)
    made.print(table, HOSTILE, style="red")
    shown = re.sub(r"\x1b\[[0-9;]*m", "", stream.getvalue())
    assert not STEERS.search(shown), shown


def strings():
    for file in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield file, node.value


def test_every_option_that_is_spoken_of_exists():
    known, commands = {"--help", "--version"}, [typer.main.get_command(app)]
    while commands:
        command = commands.pop()
        commands += getattr(command, "commands", {}).values()
        for parameter in command.params:
            known.update(parameter.opts, parameter.secondary_opts)
    wrong = [
        (file.name, option)
        for file, text in strings()
        if file.parts[-2] not in ("report", "plots", "reproduce") and "var(--" not in text
        for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", text)
        if option not in known and option.rstrip("-") not in known
    ]
    assert not wrong


def test_a_remedy_that_names_a_python_argument_says_so_or_names_the_option():
    found = []
    for file in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            for keyword in getattr(node, "keywords", ()):
                if isinstance(node, ast.Call) and keyword.arg == "remedy":
                    text = "".join(
                        c.value if isinstance(c.value, str) else ""
                        for c in ast.walk(keyword.value)
                        if isinstance(c, ast.Constant)
                    )
                    bare = re.search(r"(?<![\w\"-])(format|topic|limits|guarded|names|units|map)=", text)
                    if bare and "Python" not in text:
                        found.append((file.name, text))
    assert not found
