"""`estimate_force` and `backdrive estimate`: a joint pushed by a known torque, simulated in plain Python."""

import json
import sys

import numpy as np
import pytest

from backdrive import FrictionModel, Joint, Log, identify
from backdrive.cli import main
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.errors import InvalidInput, NotIdentifiable, UnknownName
from backdrive.external import estimate_force
from backdrive.external.choose import Noise, choose, of_free_motion, power_by_band

DT, M, F, B, COUNT = 2e-3, 0.8, 3.0, 1.5, 2e-5
PUSH = 4.0


def simulated(seconds, push, seed, gravity=0.0):
    """Return time, position, motor torque and push of a joint that tracks three sines; one that is pushed ends with 3 s of rest."""
    rng = np.random.default_rng(seed)
    n, fine = int(seconds / DT), 10
    h = DT / fine
    w, A = 2.0 * np.pi * np.array([0.7, 1.3, 2.1]), np.array([0.35, 0.2, 0.1])
    q = hold = 0.0
    v = float(A @ w)
    contact = F
    rows = []
    for k in range(n):
        t = k * DT
        wanted, speed, rise = (
            A @ np.sin(w * t), (A * w) @ np.cos(w * t), -(A * w**2) @ np.sin(w * t)
        )  # fmt: skip
        if push and t > seconds - 3.0:
            wanted, speed, rise = hold, 0.0, 0.0
        else:
            hold = wanted
        read = COUNT * np.round(q / COUNT)
        u = M * rise + 400.0 * (wanted - read) + 40.0 * (speed - v) + F * np.tanh(speed / 0.05) + B * speed
        u += gravity * np.sin(q)
        f = push * np.sign(np.sin(np.pi * t)) if push else 0.0
        rows.append((t, read, u + 0.05 * rng.standard_normal(), f))
        for _ in range(fine):
            contact = min(max(contact + 3e4 * v * h, -F), F)
            v += h * (u + f - contact - B * v - gravity * np.sin(q)) / M
            q += h * v
    return np.array(rows).T


def log_of(t, q, u, f=None):
    joints = (Joint(name="elbow", encoder_counts=1.0 / COUNT),)
    force = None if f is None else f[:, None]
    return Log(time=t, position=q[:, None], torque=u[:, None], external_torque=force, joints=joints)


@pytest.fixture(scope="module")
def model() -> FrictionModel:
    return identify(log_of(*simulated(16.0, 0.0, 1)[:3])).model


@pytest.fixture(scope="module")
def contact() -> Log:
    return log_of(*simulated(10.0, PUSH, 2))


def test_the_push_is_found_and_lies_in_its_band(model, contact):
    one = estimate_force(model, contact).joint("elbow")
    inside = (one.known >= one.lower) & (one.known <= one.upper)
    moving, rest = one.state < 2, one.state == 2
    assert np.sqrt(np.mean((one.force - one.known)[moving] ** 2)) < 0.15 * PUSH
    assert inside[moving].mean() > 0.9 and inside[rest].mean() > 0.9
    assert rest.sum() > 500 and (one.upper - one.lower)[rest].max() < 2.3 * 1.1 * F
    assert one.outside[moving].mean() > 0.95 and one.method in METHODS


@pytest.mark.parametrize("method", METHODS)
def test_every_method_tells_the_same_push(model, contact, method):
    one = estimate_force(model, contact, method=method, bandwidth=100.0).joints[0]
    moving = one.state == 0
    assert np.sqrt(np.mean((one.force - one.known)[moving] ** 2)) < 0.3 * PUSH
    assert one.method == method and one.bandwidth == 100.0
    assert one.rms_error == pytest.approx(np.sqrt(np.mean((one.force - one.known) ** 2)))


def test_without_a_push_hardly_anything_lies_outside(model):
    one = estimate_force(model, log_of(*simulated(8.0, 0.0, 3)[:3])).joints[0]
    assert one.known is None and one.rms_error is None
    assert one.outside.mean() < 0.06


def test_gravity_and_offset_of_the_model_come_along():
    free = log_of(*simulated(16.0, 0.0, 4, gravity=6.0)[:3])
    found = identify(free, gravity=True).model
    with pytest.raises(InvalidInput, match="A bandwidth of -1"):
        ExternalForce.from_model(found, "elbow", bandwidth=-1.0)
    made = ExternalForce.from_model(found, "elbow", bandwidth=60.0)
    value = {term: e.value for term, e in found.joints[0].dynamics.items()}
    assert (made.inertia, made.gravity_sin) == (value["inertia"], value["gravity_sin"])
    assert made.offset == value["offset"] and made.bandwidth == 60.0 and made.method == "momentum"
    assert made.friction.law.rate == found.joints[0].law.rate
    pushed = estimate_force(found, log_of(*simulated(8.0, PUSH, 5, gravity=6.0))).joints[0]
    moving = pushed.state == 0
    assert np.sqrt(np.mean((pushed.force - pushed.known)[moving] ** 2)) < 0.2 * PUSH


def test_what_cannot_be_estimated_is_said(model, contact):
    with pytest.raises(UnknownName):
        estimate_force(model, contact, method="guess")
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(InvalidInput, match="bandwidth"):
            estimate_force(model, contact, bandwidth=wrong)
    from dataclasses import replace

    other = contact.replace(joints=(Joint(name="wrist"),))
    with pytest.raises(InvalidInput, match="share no joint"):
        estimate_force(model, other)
    metres = contact.replace(joints=(Joint(name="elbow", unit="m"),))
    with pytest.raises(InvalidInput, match="measured in rad"):
        estimate_force(model, metres)
    still = replace(model.joints[0], dynamics={}, covariance=None)
    with pytest.raises(NotIdentifiable, match="no inertia"):
        estimate_force(replace(model, joints=(still,)), contact)
    with pytest.raises(NotIdentifiable, match="settled"):
        estimate_force(model, contact, bandwidth=0.3)
    with pytest.raises(InvalidInput, match="CSV or Parquet"):
        estimate_force(model, contact).save("force.txt")


def test_a_slow_force_is_smoothed_and_an_abrupt_one_is_not():
    rng = np.random.default_rng(0)
    rate = 1000.0
    t = np.arange(8000) / rate
    noise = Noise(count=0.0, inertia=1.0, torque=0.0, misfit=1.0, correlation=0.01, cutoff=100.0, rate=rate)
    misfit = np.zeros(t.size)
    for k in range(1, t.size):
        misfit[k] = 0.9048 * misfit[k - 1] + np.sqrt(1.0 - 0.9048**2) * rng.standard_normal()
    slow = choose(4.0 * np.sin(2.0 * t) + misfit, noise)
    abrupt = choose(12.0 * np.sign(np.sin(12.0 * t)) + misfit, noise)
    nothing = choose(misfit, noise)
    assert nothing[1] <= slow[1] < 30.0 and abrupt[1] > 100.0
    assert choose(12.0 * np.sign(np.sin(12.0 * t)) + misfit, noise, "kalman")[0] == "kalman"


def test_auto_is_near_the_best_with_free_motion_and_without(model, contact):
    def error(**more):
        one = estimate_force(model, contact, **more).joints[0]
        moving = one.time < 6.9
        inside = (one.known >= one.lower) & (one.known <= one.upper)
        assert inside[moving].mean() > 0.9 or "bandwidth" in more
        return np.sqrt(np.mean((one.force - one.known)[moving] ** 2))

    free = log_of(*simulated(10.0, 0.0, 3)[:3])
    best = min(error(method=m, bandwidth=L) for m in METHODS[1:] for L in (20.0, 80.0, 320.0))
    assert error() < 1.1 * best and error(free=(free,)) < 1.1 * best


def test_free_motion_corrects_the_noise_and_a_short_one_does_not():
    rng, rate = np.random.default_rng(5), 500.0
    t = np.arange(8000) / rate
    wrong = Noise(count=0.0, inertia=1.0, torque=50.0, misfit=0.0, correlation=0.0, cutoff=50.0, rate=rate)
    force = 3.0 * np.sign(np.sin(8.0 * t)) + 0.05 * rng.standard_normal(t.size)
    free = [(0.05 * rng.standard_normal(6000), rate)]
    assert choose(force, wrong)[1] < 20.0  # nothing stands out of such a noise
    assert choose(force, wrong, free=free)[1] > 30.0
    assert choose(force, wrong, free=[(free[0][0][:10], rate)]) == choose(force, wrong)
    middle, power, count = power_by_band(free[0][0], rate)
    assert np.average(power, weights=count) == pytest.approx(2.0 * 0.05**2 / rate, rel=0.1)
    assert of_free_motion(free, middle[::5]) == pytest.approx(np.full(middle[::5].size, 1e-5), rel=0.8)


def test_the_command_writes_a_table_and_a_picture(model, contact, tmp_path, monkeypatch, capsys):
    model.save(tmp_path / "m.json")
    names = {"t": contact.time, "q": contact.position[:, 0], "tau": contact.torque[:, 0]}
    np.savez(tmp_path / "c.npz", **names, tau_ext=contact.external_torque[:, 0])

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["backdrive", "estimate", *(str(w) for w in words)])
        with pytest.raises(SystemExit) as stopped:
            main()
        captured = capsys.readouterr()
        return stopped.value.code or 0, captured.out + captured.err

    asked = [tmp_path / "m.json", tmp_path / "c.npz", "--names", "elbow", "--counts", "50000"]
    code, out = run(*asked, "-o", tmp_path / "f.csv", "--plot", tmp_path / "f.svg")
    assert code == 0 and "elbow" in out and "error, rms" in out
    head = (tmp_path / "f.csv").read_text().splitlines()[0]
    assert head.startswith("time [s],elbow_force [N.m],elbow_lower [N.m]")
    table = np.genfromtxt(tmp_path / "f.csv", delimiter=",", skip_header=1)
    assert np.isfinite(table).all() and table.shape[1] == 6
    assert "<svg" in (tmp_path / "f.svg").read_text()
    code, out = run(*asked, "--json", "--method", "kalman", "--bandwidth", "40")
    told = json.loads(out)["joints"]["elbow"]
    assert code == 0 and told["method"] == "kalman" and told["lag"] == pytest.approx(1 / 40 + DT, rel=1e-6)
    code, out = run(*asked, "-o", tmp_path / "f.txt")
    assert code != 0 and "CSV or Parquet" in out
    code, out = run(tmp_path / "m.json", tmp_path / "c.npz")
    assert code != 0 and "--names" in out


def test_a_log_of_another_joint_is_remarked_on(model, contact):
    assert not any("another joint or robot" in line for line in estimate_force(model, contact).remarks)
    other = contact.replace(torque=-6.0 * contact.torque, external_torque=None)
    assert any("another joint or robot" in line for line in estimate_force(model, other).remarks)
