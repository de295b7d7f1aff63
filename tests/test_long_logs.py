"""Long logs are worked on in pieces, in memory that is kept: the results are those of the whole, and the memory is returned."""

import gc
import subprocess
import sys

import numpy as np
import pytest

from backdrive import _memory, identify
from backdrive.errors import InvalidInput
from backdrive.identification import block_prediction, delay, lag_products, quality, regression, waves
from backdrive.identification.motion import identify_motion
from backdrive.identification.signals import Signals
from backdrive.logs import filters
from backdrive.logs.log import Joint, Log


@pytest.fixture(scope="module")
def logs():
    first, second = made(1), made(2)
    keep = np.r_[0:5000, 5600:12_000]  # a gap
    return [with_known(first).rows(keep), with_known(second)]


def with_known(log):
    known = 0.2 * np.sin(log.position)
    return log.replace(torque=log.torque + known, model_torque=known)


def made(seed):
    t = np.arange(12_000) / 500.0
    q = sum(np.sin(2.0 * np.pi * f * t + k) / (4.0 * f) for k, f in enumerate((0.2, 0.53, 1.1)))
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    tau = 0.3 * a + 2.0 * np.sign(v) + 0.8 * v + 0.1 * np.random.default_rng(seed).standard_normal(t.size)
    return Log(time=t, joints=(Joint(name="a"),), position=q[:, None], torque=np.roll(tau, 4)[:, None])


def test_small_pieces_change_no_result(logs, monkeypatch):
    whole = identify(logs, method="motion").model.joints[0]
    pieces = (
        (block_prediction, "CHUNK", 1000),
        (delay, "PIECE", 1000),
        (lag_products, "PIECE", 50),
        (quality, "LONG", 100),
        (regression, "PIECE", 37),
        (waves, "FITS", 100),
    )
    for module, name, value in pieces:
        monkeypatch.setattr(module, name, value)
    pieces = identify(logs, method="motion").model.joints[0]
    velocity = np.linspace(-1.0, 1.0, 9)
    assert pieces.law.torque(velocity) == pytest.approx(whole.law.torque(velocity), rel=1e-9)
    assert pieces.warnings == whole.warnings
    for a, b in ((pieces.fitted, whole.fitted), (pieces.held_out, whole.held_out)):
        assert (a.residual, a.residual_raw, a.rms) == pytest.approx(
            (b.residual, b.residual_raw, b.rms), rel=1e-9
        )
    for name, error in whole.standard_errors.items():
        assert pieces.standard_errors[name] == pytest.approx(error, rel=1e-6)
    assert whole.dynamics["time_slip"].value == pytest.approx(0.008, abs=0.001)


def test_a_torque_known_in_one_log_only_is_asked_for():
    with pytest.raises(InvalidInput, match="the log holds no model_torque"):
        identify([made(1), with_known(made(2))], method="motion")


@pytest.mark.parametrize("samples", [0.3, -0.7, 5.5, -20.25, 300.0, -300.0])
def test_a_shift_in_pieces_is_that_of_every_sample(samples, monkeypatch):
    x = np.random.default_rng(0).standard_normal((2, 90))
    whole, weights = delay.cubic(samples)
    places = [np.clip(np.arange(90) - whole - 2 + k, 0, 89) for k in range(4)]
    expected = sum(w * x[:, at] for w, at in zip(weights, places, strict=True))
    for piece in (7, 1000):
        monkeypatch.setattr(delay, "PIECE", piece)
        assert delay.earlier(x, samples) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("piece", [7, 1000])
def test_products_with_a_correlation_by_their_spectrum(piece, monkeypatch):
    monkeypatch.setattr(lag_products, "PIECE", piece)
    X, rho = np.random.default_rng(0).standard_normal((70, 3)), 0.8 ** np.arange(12)
    lags = np.abs(np.subtract.outer(np.arange(70), np.arange(70)))
    T = np.where(lags < 12, 0.8**lags, 0.0)
    each = lag_products.transforms(X, 12)
    assert lag_products.between_columns(each, rho) == pytest.approx(X.T @ T @ X, abs=1e-11)


def test_a_low_pass_writes_where_it_is_told():
    x, out = np.random.default_rng(0).standard_normal((2, 400)), np.zeros((2, 400))
    assert filters.low_pass_rows(x, 10.0, 200.0, out=out) is out
    assert np.all(out == filters.low_pass_rows(x, 10.0, 200.0))
    assert np.all(filters.low_pass_rows(x, 95.0, 200.0, out=out) == x)


def test_a_derivative_is_that_of_five_samples_and_at_the_ends_that_of_numpy_and_refuses_one_sample():
    x = np.random.default_rng(0).standard_normal((50, 2))
    inside = (x[:-4] - 8.0 * x[1:-3] + 8.0 * x[3:-1] - x[4:]) / 0.12
    found, plain = filters.derivative(x, 0.01), np.gradient(x, 0.01, axis=0)
    np.testing.assert_allclose(found[2:-2], inside, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found[[0, 1, -2, -1]], plain[[0, 1, -2, -1]])
    for few in (2, 3, 4):
        assert np.all(filters.derivative(x[:few], 0.01) == np.gradient(x[:few], 0.01, axis=0))
    with pytest.raises(InvalidInput, match="1 samples are too few"):
        filters.derivative(x[:1], 0.01)


class Library:
    def __init__(self, most=1 << 40):
        self.calls, self.most = [], most

    def mallopt(self, option, value):
        self.calls.append((option, value))
        return int(option != -3 or value <= self.most)

    def malloc_trim(self, pad):
        self.calls.append(("trim", pad))


class OfLength:
    def __init__(self, n):
        self.time = np.broadcast_to(0.0, n)


def test_nothing_of_a_joint_is_left_once_it_is_identified():
    """A cycle of references would keep every array of every joint until Python looks for cycles."""
    log = made(0)
    gc.collect()
    gc.disable()
    try:
        before = sum(isinstance(each, Signals) for each in gc.get_objects())
        identify_motion([log], "a", law="coulomb-viscous")
        del log  # the latest log's stretches are kept with it
        after = sum(isinstance(each, Signals) for each in gc.get_objects())
    finally:
        gc.enable()
    assert after <= before


@pytest.mark.parametrize("n", [1000, 1_000_000])
def test_memory_of_usual_logs_is_the_c_library_s_own_affair(n, monkeypatch):
    library = Library()
    monkeypatch.setattr(_memory, "_glibc", lambda: library)
    assert _memory.with_free_memory(lambda logs: len(logs))([OfLength(n)]) == 1
    assert library.calls == []


def test_memory_kept_for_a_long_log_is_returned_even_after_an_error(monkeypatch):
    library = Library()
    monkeypatch.setattr(_memory, "_glibc", lambda: library)

    def fails(logs):
        assert library.calls == [(-3, 4 * 8 * 5_000_000), (-1, 2 * 4 * 8 * 5_000_000)]
        raise ValueError("no fit")

    with pytest.raises(ValueError, match="no fit"):
        _memory.with_free_memory(fails)(logs=OfLength(5_000_000))
    assert library.calls[2:] == [(-3, 1 << 25), (-1, 1 << 26), ("trim", 0)]


def test_an_older_glibc_that_refuses_keeps_its_own_way(monkeypatch):
    library = Library(most=1 << 25)
    monkeypatch.setattr(_memory, "_glibc", lambda: library)
    _memory.with_free_memory(lambda logs: None)([OfLength(5_000_000)])
    assert [option for option, _ in library.calls] == [-3, -3, -1, "trim"]


def test_memory_of_a_large_result_is_kept_for_the_next_one(monkeypatch):
    library = Library()
    monkeypatch.setattr(_memory, "_glibc", lambda: library)
    monkeypatch.setattr(_memory, "_kept", [1 << 25])
    for shape in ((1 << 22,), (1 << 23, 1), (1 << 23,), (1 << 22, 2), (1 << 24, 2)):
        assert _memory.empty(shape).shape == shape
    assert library.calls == [
        (-3, 9 << 23),
        (-1, (1 << 26) + (1 << 25)),
    ]  # once; neither for 32 MB nor for 256 MB


def test_large_results_take_the_same_memory_again():
    script = (
        "import resource\n"
        "from backdrive._memory import _glibc, empty\n"
        "def faults():\n"
        "    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "    empty((8_000_000,))[::256] = 1.0\n"
        "    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before\n"
        "faults()\n"
        "able = _glibc() is not None and _glibc().mallopt(-3, 1 << 27)\n"
        "print(faults() if able else 0)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert int(done.stdout) <= 2  # where it is given back: 30 of 2 MB each, or 15 000


def test_without_glibc_nothing_is_asked_of_it(monkeypatch):
    monkeypatch.setattr(_memory, "_glibc", lambda: None)
    assert _memory.empty((1 << 23,)).shape == (1 << 23,)
    assert _memory.with_free_memory(lambda logs: "done")(OfLength(10**9)) == "done"
    assert _memory.with_free_memory(lambda logs: "done")(None) == "done"
