"""The catalogue, the runner, the book and the command: with small experiments made here, and one real one."""

import importlib.machinery
import json
import sys
import types

import pytest
from typer.testing import CliRunner

from backdrive.cli import app
from backdrive.cli import reproduce as command
from backdrive.errors import InvalidInput, UnknownName
from backdrive.thesis import Claim, Outcome
from backdrive.thesis import run as running
from backdrive.thesis.book import headline, overall, render, verdict
from backdrive.thesis.catalog import ENTRIES, Entry, choose, entry
from backdrive.thesis.run import run_all


def outcome(*verdicts: bool | None, seed: int = 0) -> Outcome:
    return Outcome(
        name="fig-2.2",
        title="A title with <b>marks</b> & more",
        setting="a setting of 3 N.m",
        claims=tuple(
            Claim(
                what=f"statement {i}",
                thesis="so",
                ours="<script>",
                gate="at least",
                holds=v,
                why="so it comes",
                why_not="because",
            )
            for i, v in enumerate(verdicts)
        ),
        data={"big": object()},
        numbers={"number": float(seed)},
    )


def draw(_: Outcome):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1])
    return figure


@pytest.fixture
def fake(monkeypatch):
    """Return a function that puts an experiment of our own behind a name of the catalogue."""

    def put(name: str, run) -> Entry:
        item = entry(name)
        made = types.ModuleType(item.module)
        made.run, made.draw = run, draw  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, item.module, made)
        made.__spec__ = importlib.machinery.ModuleSpec(item.module, None)  # it is there, for who asks
        return item

    return put


def test_the_catalogue_names_every_figure_of_the_issue():
    assert len({e.name for e in ENTRIES}) == len(ENTRIES) == 26
    assert entry("fig-3.8").module == "backdrive.thesis.fig_3_8"
    assert entry("table-2.2").module == "backdrive.thesis.table_2_2"
    assert [e.name for e in choose(["chapter-2"])] == [e.name for e in ENTRIES if e.group == "chapter-2"]
    assert [e.name for e in choose(["2"])] == [e.name for e in choose(["chapter-2"])]
    assert [e.name for e in choose(["table-2.2", "fig_2.2", "fig-2.2"])] == ["fig-2.2", "table-2.2"]
    assert {e.name for e in choose()} == {e.name for e in ENTRIES if e.available}


def test_unknown_and_absent_experiments_are_named(monkeypatch):
    with pytest.raises(UnknownName, match=r"fig-2\.11"):
        choose(["fig-2.111"])
    monkeypatch.setattr("backdrive.thesis.catalog.importlib.util.find_spec", lambda name: None)
    with pytest.raises(InvalidInput, match="no program yet"):
        choose(["fig-2.2"])
    with pytest.raises(InvalidInput, match="Nothing of 'chapter-2'"):
        choose(["chapter-2"])


def test_a_result_leaves_the_data_behind_and_keeps_pictures(fake):
    (result,) = run_all([fake("fig-2.2", lambda seed: outcome(True, None, seed=seed))], seed=7)
    assert result.holds
    assert result.outcome is not None
    assert result.outcome.data == {}
    assert result.outcome.numbers == {"number": 7.0}
    assert result.png.startswith(b"\x89PNG")
    assert b"<svg" in result.svg
    assert verdict(result) == ("good", "holds")


def test_what_breaks_down_does_not_stop_the_others(fake):
    def broken(seed):
        raise ZeroDivisionError("of course")

    def refused(seed):
        raise InvalidInput("No.", remedy="Yes.")

    items = [
        fake("fig-2.2", broken),
        fake("fig-2.3", refused),
        fake("fig-2.6", lambda seed: outcome(True, False)),
    ]
    first, second, third = run_all(items, workers=1)
    assert (first.error, first.exit_code) == ("ZeroDivisionError: of course", 4)
    assert "Traceback" in first.where
    assert (second.error, second.exit_code, second.where) == ("No. Yes.", 2, "")
    assert not third.holds
    assert verdict(third) == ("poor", "1 of 2 fall short")
    assert verdict(first)[1] == "broke down"
    assert "Of 2 checks of our own in 3 experiments, 1 hold" in overall([first, second, third])


def test_the_book_is_one_safe_file(fake):
    results = list(run_all([fake("fig-2.2", lambda seed: outcome(True, False, None))]))
    text = render(results, command="backdrive reproduce <x>", seed=3, version="1", missing=["fig-2.3"])
    assert text == render(
        results, command="backdrive reproduce <x>", seed=3, version="1", missing=["fig-2.3"]
    )
    assert "<script" not in text
    assert "&lt;b&gt;marks" in text
    assert "http" not in text.replace("http-equiv", "")
    assert "data:image/png;base64," in text
    assert "img-src data:" in text
    assert "falls short" in text and "Not finished" in text and "3\u00a0N·m" in text
    assert headline("fig-2.2") == "Fig. 2.2"
    assert headline("table-2.2") == "Table 2.2"
    assert headline("league") == "League"


def test_the_command_writes_a_book_and_tells_what_falls_short(fake, tmp_path):
    fake("fig-2.2", lambda seed: outcome(True, False, seed=seed))
    done = CliRunner().invoke(
        app, ["reproduce", "fig-2.2", "--folder", str(tmp_path), "--seed", "5", "--json"]
    )
    assert done.exit_code == 1
    said = json.loads(done.stdout)
    assert said["ok"] is False
    (one,) = said["experiments"]
    assert [c["holds"] for c in one["claims"]] == [True, False]
    assert one["numbers"] == {"number": 5.0}
    assert (tmp_path / "fig-2.2.png").read_bytes().startswith(b"\x89PNG")
    assert {p.name for p in tmp_path.iterdir()} == {"fig-2.2.png", "fig-2.2.svg", "index.html"}
    fake("fig-2.2", lambda seed: outcome(True))
    done = CliRunner().invoke(app, ["reproduce", "fig-2.2", "--folder", str(tmp_path)])
    assert done.exit_code == 0
    assert "Of 1 check of our own in 1 experiment, 1 hold" in done.stdout
    assert "Of 1 statements of the thesis: 1 reproduced, 0 not reproduced and explained" in done.stdout


def test_an_interrupt_keeps_what_is_done(fake, tmp_path, monkeypatch):
    items = [fake("fig-2.2", lambda seed: outcome(True)), fake("fig-2.3", lambda seed: outcome(True))]

    def interrupted(entries, *, seed=0, workers=1, say=None):
        yield running.run_one(items[0], seed)
        raise KeyboardInterrupt

    monkeypatch.setattr(running, "run_all", interrupted)
    done = CliRunner().invoke(app, ["reproduce", "fig-2.2", "fig-2.3", "--folder", str(tmp_path)])
    assert done.exit_code == 130
    assert "1 of 2 experiments are done and kept" in done.stdout
    assert "Not finished" in (tmp_path / command.BOOK).read_text()


def test_the_list_runs_nothing():
    done = CliRunner().invoke(app, ["reproduce", "--list"])
    assert done.exit_code == 0
    assert len(done.stdout.splitlines()) == len(ENTRIES)


def test_processes_give_the_same_numbers_as_one():
    entries = choose(["fig-2.2", "fig-2.3"])
    alone = {r.entry.name: r for r in run_all(entries, seed=2, workers=1)}
    spread = {r.entry.name: r for r in run_all(entries, seed=2, workers=2)}
    assert alone.keys() == spread.keys()
    for name, result in alone.items():
        other = spread[name]
        assert result.outcome is not None and other.outcome is not None
        assert result.outcome.claims == other.outcome.claims
        assert result.outcome.numbers == other.outcome.numbers
        assert result.png == other.png


def stated(holds: bool) -> Outcome:
    claim = Claim(what="a statement", ours="so", holds=holds, statement="2.2-duration")
    return Outcome(name="fig-2.2", title="t", setting="s", claims=(claim,))


def test_a_statement_that_comes_out_otherwise_than_the_ledger_says_is_named(fake):
    (good,) = run_all([fake("fig-2.2", lambda seed: stated(True))])
    assert good.holds and verdict(good) == ("good", "1 of 1 statements come out")
    (bad,) = run_all([fake("fig-2.2", lambda seed: stated(False))])
    assert not bad.holds
    assert verdict(bad) == ("poor", "other than in the ledger: 2.2-duration")
    assert "Other than in the ledger: 2.2-duration." in overall([bad])
