"""Tests for cli/plan.py, cli/_plan_centres.py and plots/plan.py: the command as a stranger would use it."""

import json
import math
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from backdrive.cli import main
from backdrive.plans import InTurn, Multisine, Sweep, load_plan

URDF = """<robot name="arm">
  <joint name="shoulder" type="revolute"><limit lower="-1" upper="2" velocity="2.2" effort="200"/></joint>
  <joint name="elbow" type="revolute"><limit lower="0.1" upper="2.5" velocity="3" effort="100"/></joint>
  <joint name="rail" type="prismatic"><limit lower="0" upper="0.8" velocity="0.5" effort="200"/></joint>
</robot>"""
FILES = {"plan.json", "plan.csv", "plan.npz", "trajectory.yaml"}


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run `backdrive plan ...` in an empty folder; return exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(URDF)

    def call(*words: str):
        monkeypatch.setattr(sys, "argv", ["backdrive", "plan", *words])
        with pytest.raises(SystemExit) as caught:
            main()
        captured = capsys.readouterr()
        return int(caught.value.code or 0), captured.out, " ".join(captured.err.split())

    return call


SWEEP = ("sweep", "--stroke-deg", "20", "--top-speed", "2", "--cycles", "4", "--draw", "none")


def test_a_sweep_is_written_and_said(run, tmp_path):
    code, out, _ = run(
        *SWEEP, "--joint", "j1", "-o", "out/deep", "--inertia", "1.6", "--torque-limit", "213.1"
    )
    assert code == 0
    assert {p.name for p in (tmp_path / "out/deep").iterdir()} == FILES
    plan = load_plan(tmp_path / "out/deep/plan.json")
    assert plan == Sweep(math.radians(20), 2.0, 4, joint="j1")
    for words in (
        "sweep of j1",
        "2 rad/s (114.6 deg/s)",
        "22.92 rad/s^2",
        "36.67 of 213.1 N.m",
        "-10 to 10 deg",
    ):
        assert words in out
    rows = (tmp_path / "out/deep/plan.csv").read_text().splitlines()
    t, q, _, _ = (float(x) for x in rows[2001].split(","))
    assert (t, rows[0]) == (2.0, "time,j1.q,j1.dq,j1.ddq")
    assert q == pytest.approx(float(plan.position(2.0)), abs=1e-11)


def test_json_is_one_document_with_the_figures(run):
    code, out, _ = run(*SWEEP, "--json", "--inertia", "1.6", "--torque-limit", "213.1", "--bias", "0.2")
    found = json.loads(out)
    assert code == 0
    assert found["ok"]
    assert found["plan"]["kind"] == "sweep"
    (joint,) = found["joints"]
    assert joint["peak_acceleration"] == pytest.approx(8 / math.radians(20))
    assert joint["smallest_stroke"] == pytest.approx(2 * 1.6 * 4 / 213.1)
    assert joint["stroke_for_bias"] == pytest.approx(math.sqrt(3.7297 * 1.6 * 8e-3 / 0.2), rel=1e-3)
    assert len(found["written"]) == 4
    assert any("range" in note for note in found["notes"])


def test_all_joints_of_a_description_take_turns(run, tmp_path):
    words = (
        "sweep",
        "--stroke",
        "0.3",
        "--top-speed",
        "1.5",
        "--cycles",
        "2",
        "--urdf",
        "arm.urdf",
        "--draw",
        "none",
    )
    code, _, err = run(*words, "--all-joints", "--hold", "elbow=1")
    assert code == 2
    assert "linear" in err
    code, _, err = run(*words, "--joint", "shoulder", "--joint", "elbow", "--hold", "rail=0.4")
    assert code == 2
    assert "'elbow': the position reaches -0.15 rad" in err
    code, out, _ = run(
        *words, "--joint", "shoulder", "--joint", "elbow", "--hold", "rail=0.4, elbow=1", "-o", "p"
    )
    assert code == 0
    plan = load_plan(tmp_path / "p/plan.json")
    assert isinstance(plan, InTurn)
    assert plan.joints == ("shoulder", "elbow", "rail")
    assert plan.units == ("rad", "rad", "m")
    np.testing.assert_allclose(plan.position(0.0), [0.0, 1.0, 0.4], atol=1e-12)
    assert "2 joints in turn" in out
    assert [line.split()[0] for line in out.splitlines()[3:5]] == ["shoulder", "elbow"]
    head = (tmp_path / "p/trajectory.yaml").read_text().splitlines()[:8]
    assert head[5:8] == ["- 'shoulder'", "- 'elbow'", "- 'rail'"]


@pytest.mark.parametrize(
    ("words", "kind", "commands"),
    [
        (("constant-velocity", "--stroke-deg", "40", "--speeds", "0.1,0.5"), "constant-velocity", "position"),
        (
            ("constant-velocity", "--stroke", "0.4", "--top-speed", "0.5", "--cycles", "3"),
            "constant-velocity",
            "position",
        ),
        (
            ("multisine", "--stroke", "0.4", "--band", "0.5,2", "--period", "2", "--seed", "5"),
            "multisine",
            "position",
        ),
        (("sine-torque", "--amplitude", "3", "--frequency", "1", "--inertia", "2"), "sine-torque", "torque"),
        (
            ("sawtooth-torque", "--amplitude", "3", "--frequency", "1", "--rise", "0.7"),
            "sawtooth-torque",
            "torque",
        ),
        (("ramp", "--amplitude", "6", "--torque-rate", "2", "--unit", "m"), "ramp", "torque"),
        (("sweep", "--stroke", "0.2", "--top-speed", "0.3", "--unit", "m", "--literal"), "sweep", "position"),
    ],
)
def test_every_kind_can_be_planned(run, tmp_path, words, kind, commands):
    code, out, _ = run(*words, "-o", "p", "--draw", "none")
    assert code == 0
    plan = load_plan(tmp_path / "p/plan.json")
    assert (plan.kind, plan.commands) == (kind, commands)
    assert out.startswith(f"{kind} of joint\n")
    with np.load(tmp_path / "p/plan.npz") as stored:
        main_channel = stored["position" if commands == "position" else "torque"]
        assert main_channel.shape == (stored["time"].size, 1)


def test_options_reach_the_plan(run, tmp_path):
    words = (
        "multisine",
        "--stroke",
        "0.4",
        "--band",
        "0.5,2",
        "--period",
        "2",
        "--seed",
        "5",
        "--cycles",
        "7",
    )
    assert run(*words, "--center", "0.2", "--lead-in", "1.5", "--draw", "none", "-o", "p")[0] == 0
    expected = Multisine(0.4, 0.5, 2.0, 2.0, seed=5, periods=7, center=0.2, lead_in=1.5)
    assert load_plan(tmp_path / "p/plan.json") == expected


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("sweep --stroke -0.3 --top-speed 2", 2, "-0.3"),
        ("sweep --stroke 20 --top-speed 2", 2, "--stroke-deg 20"),
        ("sweep --stroke-deg 20 --top-speed 115", 2, "--top-speed-deg 115"),
        ("sweep --stroke 20 --top-speed 1 --unit m", 2, "metres"),
        ("sweep --stroke-deg 20 --top-speed 2 --unit m", 2, "linear"),
        ("sweep --stroke-deg 20 --stroke 1 --top-speed 2", 2, "both"),
        ("sweep --stroke-deg 20", 2, "needs --top-speed"),
        ("sweep --top-speed 2", 2, "needs --stroke"),
        ("sweep --stroke-deg 20 --top-speed 2 --cycles 0", 2, "cycles is 0"),
        ("sweep --stroke-deg 20 --top-speed nan", 2, "nan"),
        ("sweep --stroke-deg 20 --top-speed fast", 2, "fast|valid number"),
        ("sweep --stroke-deg 20 --top-speed 2 --amplitude 3", 2, "--amplitude does not apply"),
        ("sweep --stroke-deg 20 --top-speed 2 --joint elbo --urdf arm.urdf", 2, "Did you mean 'elbow'"),
        ("sweep --stroke-deg 20 --top-speed 2 --urdf arm.urdf", 2, "3 joints that move"),
        ("sweep --stroke-deg 20 --top-speed 2 --urdf nowhere.urdf", 3, "nowhere.urdf: No such file"),
        ("sweep --stroke-deg 20 --top-speed 2 --all-joints", 2, "--urdf"),
        ("sweep --stroke-deg 20 --top-speed 2 --joint rail --urdf arm.urdf", 2, "linear"),
        ("sweep --stroke-deg 20 --top-speed 2 --joint elbow --urdf arm.urdf --unit m", 2, "Leave --unit out"),
        ("sweep --stroke-deg 20 --top-speed 2.5 --joint shoulder --urdf arm.urdf", 2, "limit of 2.2 rad/s"),
        ("sweep --stroke-deg 20 --top-speed 2 --hold elbow", 2, "NAME=POSITION"),
        ("sweep --stroke-deg 20 --top-speed 2 --hold joint=1 --center 1", 2, "both place"),
        ("sweep --stroke-deg 20 --top-speed 2 --unit deg", 2, "--unit deg"),
        ("sweep --stroke-deg 5 --top-speed 2 --inertia 3 --torque-limit 200", 2, "smallest stroke"),
        ("sweep --stroke-deg 20 --top-speed 2 --rate 0", 2, "0.0 Hz"),
        ("sweep --stroke-deg 20 --top-speed 2 --draw gif", 2, "gif"),
        ("sweep --stroke-deg 20 --top-speed 2 -o arm.urdf", 2, "arm.urdf"),
        ("constant-velocity --stroke-deg 20 --speeds 0.1,x", 2, "0.1,x"),
        (
            "constant-velocity --stroke-deg 20 --speeds 0.1 --top-speed 1",
            2,
            "--speeds cannot be combined with",
        ),
        ("constant-velocity --stroke-deg 20 --top-speed 1 --cycles 0", 2, "--cycles is 0"),
        ("multisine --stroke-deg 20 --band 1 --period 2", 2, "two frequencies"),
        ("ramp --amplitude 3", 2, "--torque-rate"),
        ("swep --stroke-deg 20 --top-speed 2", 2, "Did you mean 'sweep'"),
    ],
)
def test_mistakes_are_answered_and_leave_nothing_behind(run, tmp_path, words, code, said):
    import re

    found, out, err = run(*words.split())
    assert found == code
    assert re.search(said, err)
    assert "Traceback" not in out + err
    assert {p.name for p in tmp_path.iterdir()} == {"arm.urdf"}
    found, out, err = run(*words.split(), "--json")
    if "fast" not in words:  # the option parser's own message
        assert found == code
        assert json.loads(out)["ok"] is False


def test_large_strokes_are_accepted_where_the_range_says_so(run):
    words = ("sweep", "--stroke", "12", "--top-speed", "3", "--cycles", "2", "--draw", "none")
    assert run(*words)[0] == 2
    assert run(*words, "--lower", "-7", "--upper", "7")[0] == 0


def test_a_tiny_stroke_is_suspected(run):
    code, out, _ = run("sweep", "--stroke-deg", "0.35", "--top-speed", "2", "--draw", "none")
    assert code == 0
    assert "unusual" in out


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_pictures_are_drawn(run, tmp_path, kind):
    code, out, _ = run(
        *SWEEP[:-1], kind, "--joint", "a<b&c", "--velocity-limit", "2.1", "--lower", "-1", "-o", "p"
    )
    assert code == 0
    assert f"plan.{kind}" in out
    content = (tmp_path / f"p/plan.{kind}").read_bytes()
    if kind == "png":
        assert content.startswith(b"\x89PNG")
        assert int.from_bytes(content[16:20], "big") == 1280
    else:
        texts = "".join(ElementTree.fromstring(content).itertext())
        for words in ("sweep of a<b&c", "samples taken", "limit", "time [s]", "dq [rad/s]"):
            assert words in texts


def test_samples_marked_in_the_picture_are_those_of_the_windows():
    from backdrive.report.pictures.plan import _samples

    plan = Sweep(0.35, 2.0, 5, start=3.0)
    t = np.linspace(2.0, 3.5 + plan.duration, 5001)
    v = plan.velocity(t)
    expected = np.zeros(t.size, dtype=bool)
    for n, (begin, end) in enumerate(plan.windows(), start=1):
        expected |= (t >= begin) & (t <= end) & (np.abs(v) >= 0.8 * n * 2.0 / 5)
    np.testing.assert_array_equal(_samples(plan, t, v), expected)


def test_without_matplotlib_the_extra_is_named_and_files_can_still_be_had(run, tmp_path, monkeypatch):
    for module in [m for m in sys.modules if m.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, _, err = run(*SWEEP[:-2])
    assert code == 2
    assert 'pip install "backdrive[report]"' in err
    assert "--draw none" in err
    assert not (tmp_path / "plan").exists()
    assert run(*SWEEP)[0] == 0


# one sweep a center


@pytest.fixture
def several(run):
    return lambda words: run(*words.split(), "--draw", "none")


WORDS = "sweep --stroke-deg 20 --top-speed 2 --cycles 4 --lower -1.4 --upper 1.4"
NARROW = "sweep --stroke-deg 20 --top-speed 2 --cycles 4 --lower -0.7 --upper 0.7"


def test_one_plan_a_center_is_written(several, tmp_path):
    code, out, _ = several(f"{WORDS} --centres=-60,0,60 -o p --joint a/1")
    assert code == 0
    assert "noise gain" not in out
    assert "1.73 times the standard error" in out
    plans = [load_plan(tmp_path / f"p/a_1_at_{c}deg/plan.json") for c in (-60, 0, 60)]
    assert "each of p/a_1_at_-60deg, p/a_1_at_0deg, p/a_1_at_60deg." in out
    assert [math.degrees(p.center) for p in plans] == pytest.approx([-60, 0, 60])
    code, out, _ = several(f"{WORDS} --centers AUTO --json -o q")
    found = json.loads(out)
    assert code == 0
    outer = 1.4 - math.radians(10.0 + 0.02 * 20.0)  # a margin of 2 % of the stroke
    assert found["centers"] == pytest.approx([-outer, 0.0, outer], abs=1e-6)
    assert found["noise_gain"] < 1.3
    assert len(found["written"]) == 12
    assert len(found["folders"]) == 3
    assert not any("gain" in note for note in found["notes"])


def test_several_sweeps_about_a_center_have_a_folder_each(several):
    _, out, _ = several(f"{NARROW} --centres auto --json")
    names = [folder.split("_at_")[1] for folder in json.loads(out)["folders"]]
    assert names[:5] == ["-29.71deg", "-29.71deg_2", "0deg", "0deg_2", "0deg_3"]
    assert len(set(names)) == 9


def test_what_was_not_reached_or_not_checked_is_said(several):
    code, out, _ = several(f"{NARROW} --centres auto --inertia 1.6 --velocity-limit 3")
    assert code == 0
    assert "9 sweeps reach 4.79" in out
    assert out.count("bias by inertia, 1 ms slip") == out.count("stroke for less than 0.1 N.m") == 1
    sweep = "sweep --stroke-deg 20 --top-speed 2 --cycles 4"
    for limit, side in (("--lower -1", "upper"), ("--upper 1.3", "lower")):
        for centres in (" --centres auto", ""):
            _, out, _ = several(f"{sweep} {limit}{centres}")
            assert f"The {side} end of the range was not checked" in out
            assert f"The {'lower' if side == 'upper' else 'upper'} end" not in out


def test_the_other_joints_are_held_at_every_center(several, tmp_path):
    code, _, err = several(f"{WORDS} --centres=-60,0,60 -o p --joint a --hold b=1,c=-0.5")
    assert code == 0, err
    for degrees in (-60, 0, 60):
        plan = load_plan(tmp_path / f"p/a_at_{degrees}deg/plan.json")
        assert plan.joints == ("a", "b", "c")
        assert plan.position(0.0) == pytest.approx([math.radians(degrees), 1.0, -0.5])


def test_a_limit_that_no_center_changes_gets_no_advice_on_centers(several):
    for limit in ("--velocity-limit 1", "--inertia 3 --torque-limit 60"):
        code, _, err = several(f"{WORDS} --centres=-60,0,60 {limit}")
        assert code == 2
        assert "above the limit" in err
        assert "half a turn" not in err
        assert "vertical" not in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (f"{WORDS} --centres=-60,0,80", "80 deg cannot be driven"),
        (f"{WORDS} --centres=-60,0,80", "another posture"),
        (f"{WORDS} --centres=-5,0,5", "too near"),
        (f"{WORDS} --centres=x", "neither `auto`"),
        (f"{WORDS} --centres=1", "1 centers"),
        (f"{WORDS} --centres=-60,60", "Two centers 120 deg apart"),
        (f"{WORDS} --centres=-60,0,60 --center 1", "both place"),
        (f"{WORDS} --centres auto --center 0.5", "middle of the centers at 0 rad"),
        (f"{WORDS} --centres auto --hold joint=0.5", "both place"),
        (f"{WORDS} --centres auto --joint a --joint b", "several sweeps of one joint"),
        ("sweep --stroke 0.1 --top-speed 0.3 --unit m --centres auto", "is linear"),
        ("ramp --amplitude 3 --torque-rate 1 --centres auto", "does not apply"),
    ],
)
def test_what_cannot_be_planned_is_said_and_leaves_nothing(several, tmp_path, words, said):
    code, _, err = several(words)
    assert code == 2
    assert said in err
    assert {p.name for p in tmp_path.iterdir()} == {"arm.urdf"}


def test_the_center_may_be_in_degrees(run, tmp_path):
    assert run(*SWEEP, "--center-deg", "35", "-o", "p")[0] == 0
    assert load_plan(tmp_path / "p" / "plan.json").center == pytest.approx(math.radians(35.0))
    code, _, said = run(*SWEEP, "--center-deg", "35", "--center", "1")
    assert code == 2
    assert "--center and --center-deg are both given" in said


def test_a_motion_does_not_touch_the_limits(run, tmp_path):
    code, _, err = run(*SWEEP, "--lower", "-0.1745329252", "--upper", "0.1745329252", "-o", "p")
    assert code == 2 and not (tmp_path / "p").exists()
    err = " ".join(err.split())
    assert (
        "reaches the lower limit of -0.1745 rad (-10 deg) and the upper limit of 0.1745 rad (10 deg)" in err
    )
    assert "at most 0.3356 rad (19.23 deg)" in err and "--margin 0" in err
    smaller = (
        "sweep",
        "--stroke-deg",
        "19.23",
        *SWEEP[3:],
        "--lower",
        "-0.17453292",
        "--upper",
        "0.17453293",
    )
    code, out, _ = run(*smaller, "-o", "p")
    assert code == 0 and "leaves a margin" not in out
    assert "margin to the limits  0.00672 rad (0.385 deg) below, 0.00672 rad (0.385 deg) above" in out
    assert (
        run(*SWEEP, "--lower", "-0.1745329252", "--upper", "0.1745329252", "--margin", "0", "-o", "q")[0] == 0
    )


def test_a_motion_near_a_limit_names_it_with_the_margin(run):
    code, out, _ = run(*SWEEP, "--lower", "-1", "--upper", "0.1762", "-o", "p")
    out = " ".join(out.split())
    assert code == 0
    assert "leaves a margin of 0.001667 rad (0.09552 deg) only to the upper limit of 0.1762 rad" in out
    assert "lower limit" not in out
    code, out, _ = run(*SWEEP, "--lower", "-1", "--upper", "0.18", "--margin", "0.002", "--json", "-o", "p")
    figures = json.loads(out)["joints"][0]
    assert code == 0 and figures["margins"] == pytest.approx([0.82547, 0.005467], rel=1e-3)
    code, out, _ = run(*SWEEP, "--json", "-o", "p")
    assert json.loads(out)["joints"][0]["margins"] == [None, None]


def test_centers_that_are_chosen_keep_a_margin(several, tmp_path):
    assert several(WORDS + " --centres auto -o q")[0] == 0
    ends = [load_plan(p).position_range for p in (tmp_path / "q").glob("*/plan.json")]
    left = 1.4 - max(max(map(abs, pair)) for pair in ends)
    assert left == pytest.approx(0.02 * math.radians(20.0), rel=1e-3)


def test_a_sweep_has_a_slow_part_and_keeps_a_margin(run, tmp_path):
    size = ("--stroke-deg", "20", "--top-speed", "2", "--cycles", "4")
    words = ("sweep", *size, "--lower", "-0.2", "--upper", "0.2", "--draw", "none")
    assert run(*words, "--slow", "2", "--margin", "0.02", "-o", "p")[0] == 0
    plan = load_plan(tmp_path / "p/plan.json")
    assert plan.slow == 2 and plan.speeds == pytest.approx([0.125, 0.25, 0.5, 1.0, 1.5, 2.0])
    code, _, err = run(*words, "--margin", "0.03")
    assert code == 2 and "largest stroke that would do" in err
    code, _, err = run(*words, "--margin", "0.2")
    assert code == 2 and "leaves nothing of the range" in err
    code, _, err = run("multisine", "--slow", "2")
    assert code == 2 and "--slow does not apply to a plan of the kind multisine" in err
