"""Plans that were recorded late, and the commands that read tables: options shared, checked before the work begins."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from backdrive import Joint, Log, Sweep, identify, load_model
from backdrive.cli._app import app
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.alignment import best_lag, tempo, with_plan
from backdrive.plans import InTurn

PLAN = Sweep(stroke=0.8, top_speed=1.5, cycles=4)
RATE = 200.0
RUN = CliRunner()


def recorded(late: float, clock: float = 0.0, joints: int = 1) -> Log:
    """Return a sweep that begins so long after the first sample [s]."""
    rng = np.random.default_rng(1)
    time = np.arange(round((PLAN.duration + late + 1.0) * RATE)) / RATE
    inside = np.clip(time - late, 0.0, PLAN.duration)
    q = PLAN.position(inside)[:, None] * np.r_[np.zeros(joints - 1), 1.0]
    dq = PLAN.velocity(inside)[:, None] * np.r_[np.zeros(joints - 1), 1.0]
    tau = 1.5 * np.tanh(dq / 1e-3) + 0.3 * dq + 0.01 * rng.standard_normal(q.shape)
    names = tuple(Joint(name=f"j{i}") for i in range(joints))
    return Log(time=time + clock, joints=names, position=q + 1e-5 * rng.standard_normal(q.shape), torque=tau)


@pytest.mark.parametrize(("late", "clock", "joints"), [(3.7, 0.0, 1), (3.7031, 1.7e9, 2), (0.0, 5.0, 1)])
def test_the_lag_of_a_plan_shows_in_the_motion(late, clock, joints):
    lag, alike, other = best_lag(recorded(late, clock, joints), PLAN)
    assert other is None
    assert lag == pytest.approx(late, abs=0.2 / RATE)
    assert alike > 0.95


@pytest.mark.parametrize(
    ("clock", "stroke", "late"), [(1.0, 1.0, 0.0), (1.1, 1.0, 0.4), (0.95, -1.0, 0.0), (1.0, 57.3, 0.2)]
)
def test_how_fast_a_plan_was_run(clock, stroke, late):
    log = recorded(late)
    ran = tempo(log.replace(time=clock * log.time, position=stroke * log.need("position")), "j0", PLAN)
    assert ran is not None
    assert ran.duration == pytest.approx(clock, rel=2e-3)
    assert ran.stroke == pytest.approx(stroke, rel=1e-2)


def test_another_motion_has_no_tempo():
    log = recorded(0.0)
    assert tempo(log.replace(position=np.sin(log.time**1.3)), "j0", PLAN) is None


def test_a_recording_that_began_after_its_plan():
    whole = recorded(0.0)
    late = whole.rows(whole.time >= 2.0)
    assert best_lag(late, PLAN)[0] == pytest.approx(-2.0, abs=0.2 / RATE)


def test_a_sweep_is_found_where_its_plan_begins():
    log = recorded(3.7, clock=100.0)
    for start in ("auto", 3.7):
        result = identify(log, plan=PLAN, start=start, method="sweep")
        assert any("The plan begins 3.7 s after the first sample" in note for note in result.notes)
        assert result.model.options["start"] == start
        assert not any(
            "did not follow the plan" in w for w in (*result.warnings, *result.model.joints[0].remarks())
        )


def test_a_sweep_by_a_fast_clock_names_the_clock():
    log = recorded(0.5)
    friction = identify(log.replace(time=1.1 * log.time), plan=PLAN, method="sweep").model.joints[0]
    assert any("1.100 times as long as its plan" in warning for warning in friction.warnings)


def test_a_plan_that_was_run_twice_begins_at_two_times():
    once = recorded(2.0)
    n = len(once)
    twice = Log(
        time=np.arange(2 * n) / RATE,
        joints=once.joints,
        position=np.concatenate([once.position, once.position]),
        torque=np.concatenate([once.torque, once.torque]),
    )
    linked = with_plan(twice, PLAN, "auto")
    (note,) = [note for note in linked.notes if "The plan begins" in note]
    first, second = 2.0, 2.0 + n / RATE
    assert min(abs(linked.plan.start - begin) for begin in (first, second)) < 0.01
    other = float(note.partition("fit as well at ")[2].partition(" s")[0])
    assert other == pytest.approx(first if linked.plan.start > 3.0 else second, abs=0.02)
    assert "--start SECONDS" in note


def test_turns_are_aligned_by_the_names_of_the_joints():
    plan = InTurn((Sweep(stroke=0.8, top_speed=1.5, cycles=4, joint="j1"),))
    assert best_lag(recorded(2.0, joints=2), plan)[0] == pytest.approx(2.0, abs=0.2 / RATE)


def test_starts_that_make_no_sense():
    log = recorded(1.0)
    for start, match in (
        (float("nan"), "start = nan"),
        (1e6, "lies outside the log"),
        (-1e6, "lies outside"),
        (True, "start"),
    ):
        with pytest.raises(InvalidInput, match=match):
            with_plan(log, PLAN, start)
    with pytest.raises(InvalidInput, match="without a plan"):
        identify(log, start=1.0)
    noise = log.replace(position=np.random.default_rng(0).standard_normal((len(log), 1)))
    with pytest.raises(NotIdentifiable, match="does not contain the motion of its plan"):
        with_plan(noise, PLAN, "auto")


def write(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.12g")
    return str(path)


def test_a_coupling_is_kept_in_the_model(tmp_path):
    log = recorded(0.5)
    q, tau = log.position[:, 0], log.torque[:, 0]
    file = write(tmp_path / "log.csv", "time,q1,q2,tau1,tau2", log.time, q, 1.5 * q, tau, tau)
    (tmp_path / "c.json").write_text("[[1, 0], [-0.5, 1]]")
    model = tmp_path / "model.json"
    command = [
        "identify",
        file,
        "--coupling",
        str(tmp_path / "c.json"),
        "-o",
        str(model),
        "--method",
        "motion",
        "--gate",
        "1000",
    ]
    RUN.invoke(app, command)
    kept = load_model(model)
    assert kept.coupling == ((1.0, 0.0), (-0.5, 1.0))
    assert kept.options["reading"]["coupling"] == [[1.0, 0.0], [-0.5, 1.0]]
    assert RUN.invoke(app, [*command[:4], "-o", str(tmp_path / "c.json")]).exception is not None
    assert json.loads((tmp_path / "c.json").read_text()) == [[1, 0], [-0.5, 1]]  # not written over
    (tmp_path / "other.json").write_text("[[1, 0], [-0.6, 1]]")
    plain = tmp_path / "plain.json"
    RUN.invoke(app, [*command[:2], "-o", str(plain), *command[6:]])
    for file_, option, words in (
        (model, (), "read it with --coupling"),
        (model, (tmp_path / "c.json",), ""),
        (model, (tmp_path / "other.json",), "another coupling"),
        (plain, (tmp_path / "c.json",), "of no coupled motors"),
        (plain, (), ""),
    ):
        given = [word for path in option for word in ("--coupling", str(path))]
        said = " ".join(
            RUN.invoke(app, ["validate", str(file_), file, *given, "--gate", "1000"]).output.split()
        )
        assert (words in said) if words else ("coupl" not in said and "motors" not in said)
    for text in ("", "1,2\n3", "1,0\n0,x", "[" * 5000, '{"a": 1}', "1,1\n1,1"):
        (tmp_path / "bad.csv").write_text(text)
        result = RUN.invoke(app, ["inspect", file, "--coupling", str(tmp_path / "bad.csv")])
        assert result.exception is not None and ("matrix" in str(result.exception)), text[:20]


def test_inspect_previews_a_repair_and_makes_it(tmp_path):
    log = recorded(0.5)
    q = log.position[:, 0].copy()
    q[50] = np.nan
    file = write(tmp_path / "log.csv", "time,q,tau", log.time, q, log.torque)
    plain = RUN.invoke(app, ["inspect", file])
    assert "--repair would do this" in plain.output and plain.exit_code == 1
    told = json.loads(RUN.invoke(app, ["inspect", file, "--json"]).output)
    assert told["logs"][0]["repairs"] and not told["ok"]
    after = json.loads(RUN.invoke(app, ["inspect", file, "--repair", "--json"]).output)
    assert "nan" not in [f["name"] for f in after["logs"][0]["findings"]]


def test_inspect_does_not_call_a_log_without_torque_fine(tmp_path):
    log = recorded(0.5)
    file = write(tmp_path / "log.csv", "time,q,current_mA", log.time, log.position, 1e3 * log.torque)
    result = RUN.invoke(app, ["inspect", file])
    assert result.exit_code == 1 and "No faults found" not in result.output
    assert "has neither torque" in " ".join(result.output.split())
    taken = RUN.invoke(app, ["inspect", file, "--map", "tau=current_mA"])
    assert "No faults found" not in taken.output
    assert "its name ends with ma" in " ".join(taken.output.split())


def test_inspect_names_a_clock_in_another_unit(tmp_path):
    log = recorded(0.5)
    for factor, words in (
        (1.0, None),
        (1e3, "t=0.001*COLUMN for milliseconds"),
        (1e6, "t=1e-6*COLUMN for microseconds"),
    ):
        file = write(tmp_path / "log.csv", "time,q,tau", factor * log.time, log.position, log.torque)
        said = " ".join(RUN.invoke(app, ["inspect", file]).output.split())
        assert words is None or words in said, said
        assert (words is not None) == ("its time is probably in another unit" in said)


def test_a_repair_that_is_undone_is_not_recommended(tmp_path, monkeypatch):
    log = recorded(0.5)
    file = write(tmp_path / "log.csv", "time,q,tau", log.time, log.position, np.roll(log.torque, 12, axis=0))
    said = " ".join(RUN.invoke(app, ["inspect", file]).output.split())
    assert "Shift torque" in said and "was shifted" in said and "Leave it" not in said
    undone = {"time-slip": "This one is no help."}  # the name tells, in whatever words
    monkeypatch.setattr("backdrive.identification.repairs.useless", lambda *_: undone)
    said = " ".join(RUN.invoke(app, ["inspect", file]).output.split())
    assert "This one is no help." in said and "Leave it" in said and "Shift torque" not in said
    monkeypatch.setattr("backdrive.identification.repairs.useless", lambda *_: {"outlier": "No help."})
    said = " ".join(RUN.invoke(app, ["inspect", file]).output.split())
    assert "No help." in said and "Leave it" not in said and "Shift torque" in said


def test_a_file_in_a_folder_that_is_read_is_not_written_over(tmp_path):
    log = recorded(0.5)
    folder = tmp_path / "logs"
    folder.mkdir()
    file = Path(write(folder / "a.csv", "time,q,tau", log.time, log.position, log.torque))
    before = file.read_bytes()
    result = RUN.invoke(app, ["identify", str(folder), "-o", str(file)])
    assert "which is read" in str(result.exception) and file.read_bytes() == before
    for _ in range(2):  # an earlier result may be replaced
        result = RUN.invoke(
            app, ["identify", str(folder), "-o", str(folder / "model.json"), "--gate", "1000"]
        )
        assert (folder / "model.json").is_file() and "which is read" not in str(result.exception)
    (folder / "plan.json").write_text('{"format": "backdrive-plan"}')
    result = RUN.invoke(app, ["identify", str(folder), "-o", str(folder / "plan.json")])
    assert "which is read" in str(result.exception)
