"""Tables whose rows are of several clocks come onto that of the positions; lost samples and holes are no clock."""

import numpy as np
import pytest

from _commands import called
from backdrive import Log, check, read_log

SECONDS = 4.0


def position(t):
    return np.sin(2.0 * t)


def torque(t):
    return np.cos(3.0 * t)


def table(path, header, **topics):
    """Write topics, each (instants, columns); rows of one instant are one."""
    at = {name: {round(t, 6): i for i, t in enumerate(topic[0])} for name, topic in topics.items()}
    rows = []
    for t in sorted(set().union(*at.values())):
        cells = [f"{1.7e9 + t:.6f}"]
        for name, (_, *columns) in topics.items():
            i = at[name].get(t)
            cells += ["" if i is None else f"{c[i]:.9g}" for c in columns]
        rows.append(",".join(cells))
    path.write_text("\n".join([f"__time,{header}", *rows]) + "\n")
    return path


def clock(rate, late=0.0):
    return np.arange(late, SECONDS, 1.0 / rate)


def read(path, **options):
    return read_log(path, guarded=False, **options)


HEADER = "/js/hip/position,/js/knee/position,/js/hip/effort,/js/knee/effort"


@pytest.mark.parametrize(
    ("rates", "late"),
    [((500.0, 200.0), 3e-4), ((500.0, 200.0), 0.0), ((200.0, 500.0), 0.0), ((500.0, 499.0), 1e-4)],
)
def test_torque_of_another_clock_comes_onto_that_of_the_positions(tmp_path, rates, late):
    t, s = clock(rates[0]), clock(rates[1], late)
    path = table(
        tmp_path / "pj.csv", HEADER, q=(t, position(t), 2 * position(t)), tau=(s, torque(s), -torque(s))
    )
    log = read(path)
    assert len(log) >= t.size - 4 and 1.0 / log.period == pytest.approx(rates[0], rel=1e-3)
    time = log.time - 1.7e9
    assert np.allclose(log.position, position(time)[:, None] * (1, 2), atol=1e-5)
    assert np.allclose(log.torque, torque(time)[:, None] * (1, -1), atol=1e-4)
    said = " ".join(log.notes)
    assert "rows are of several clocks" in said and said.count("was joined by time") == 1
    assert "assumed to begin" not in said and not any(f.name == "nan" for f in check(log))


def test_each_joint_may_have_a_clock_of_its_own(tmp_path):
    t, s = clock(250.0), clock(200.0, 1.5e-3)
    header = "/hip/position,/hip/effort,/knee/position,/knee/effort"
    log = read(
        table(tmp_path / "pj.csv", header, a=(t, position(t), torque(t)), b=(s, position(s), torque(s)))
    )
    assert np.allclose(log.position[:, 0], log.position[:, 1], atol=1e-4)
    assert np.allclose(log.torque[:, 0], log.torque[:, 1], atol=1e-4)


def test_a_topic_that_is_not_used_costs_its_rows_alone(tmp_path):
    t, s = clock(250.0), clock(200.0, 1.5e-3)
    log = read(table(tmp_path / "pj.csv", "q,tau,/odom/x", a=(t, position(t), torque(t)), b=(s, s)))
    assert len(log) == t.size and np.isfinite(log.torque).all()
    assert any(f"{s.size} of {t.size + s.size} hold no position" in note for note in log.notes)


def test_mapped_columns_and_frames(tmp_path):
    pandas = pytest.importorskip("pandas")
    t, s = clock(250.0), clock(200.0, 1.5e-3)
    path = table(tmp_path / "pj.csv", "/js/a,/amps", q=(t, position(t)), i=(s, torque(s)))
    map = "q=/js/a,tau=2*/amps"
    log = read(path, map=map)
    assert np.allclose(log.torque[:, 0], 2.0 * torque(log.time - 1.7e9), atol=1e-3)
    assert np.allclose(Log.from_frame(pandas.read_csv(path), map=map).torque, log.torque)
    done = called("inspect", path, "--map", map)
    assert done.returncode == 0 and "No faults" in done.stdout and "was joined by time" in done.stdout


def test_a_time_that_is_named_without_its_unit(tmp_path):
    t, s = clock(250.0), clock(200.0, 1.5e-3)
    path = table(tmp_path / "pj.csv", "q,tau", q=(t, position(t)), tau=(s, torque(s)))
    text = path.read_text()
    path.write_text(text.replace("__time", "stamp [s]"))
    log = read(path, map="t=stamp")
    assert np.allclose(log.torque[:, 0], torque(log.time - 1.7e9), atol=1e-3)
    counted = read(path, map="t=0.001*index")  # a row's number is no clock of its columns
    assert len(counted) == t.size + s.size and any(f.name == "nan" for f in check(counted))


@pytest.mark.parametrize("kind", ["lost", "half lost", "hole", "half", "position"])
def test_lost_samples_and_holes_are_no_clock(tmp_path, kind):
    t = clock(500.0)
    q, tau = position(t), torque(t)
    rng = np.random.default_rng(4)
    gone = {
        "lost": rng.random(t.size) < 0.3,
        "half lost": rng.random(t.size) < 0.5,
        "hole": (t > 1.0) & (t < 2.2),
        "half": t > 2.0,
        "position": t > 2.0,
    }[kind]
    (q if kind == "position" else tau)[gone] = np.nan
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([t, q, tau]), delimiter=",", header="t,q,tau", comments="")
    log = read(path)
    assert len(log) == t.size
    (found,) = [f for f in check(log) if f.name == "nan"]
    assert found.severity == "spoils" and found.where.size == gone.sum()
