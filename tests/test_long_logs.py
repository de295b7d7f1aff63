"""Long logs are worked on in pieces, in memory that is kept: the results are those of the whole, and the memory is returned."""

import numpy as np
import pytest

from backdrive import _memory, identify
from backdrive.errors import InvalidInput
from backdrive.identification import block_prediction, delay, noise, quality, regression, residual
from backdrive.logs import filters
from backdrive.logs.log import Joint, Log


@pytest.fixture(scope="module")
def log():
    t = np.arange(12_000) / 500.0
    q = sum(np.sin(2.0 * np.pi * f * t + k) / (4.0 * f) for k, f in enumerate((0.2, 0.53, 1.1)))
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    tau = 0.3 * a + 2.0 * np.sign(v) + 0.8 * v + 0.1 * np.random.default_rng(1).standard_normal(t.size)
    return Log(time=t, joints=(Joint(name="a"),), position=q[:, None], torque=np.roll(tau, 4)[:, None])


def test_small_pieces_change_no_result(log, monkeypatch):
    whole = identify(log, method="motion").model.joints[0]
    pieces = (
        (block_prediction, "CHUNK", 1000),
        (delay, "PIECE", 1000),
        (noise, "PIECE", 50),
        (quality, "LONG", 100),
        (regression, "PIECE", 37),
        (residual, "FITS", 100),
    )
    for module, name, value in pieces:
        monkeypatch.setattr(module, name, value)
    pieces = identify(log, method="motion").model.joints[0]
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


@pytest.mark.parametrize("samples", [0.3, -0.7, 5.5, -20.25, 300.0, -300.0])
def test_a_shift_in_pieces_is_that_of_every_sample(samples, monkeypatch):
    x = np.random.default_rng(0).standard_normal((2, 90))
    expected = delay.earlier(x, samples)
    monkeypatch.setattr(delay, "PIECE", 7)
    assert delay.earlier(x, samples) == pytest.approx(expected, abs=1e-14)
    assert np.all(delay.earlier(x, 300.0) == x[:, :1])
    assert np.all(delay.earlier(x, -300.0) == x[:, -1:])


def test_products_with_a_correlation_by_their_spectrum():
    X, rho = np.random.default_rng(0).standard_normal((70, 3)), 0.8 ** np.arange(12)
    lags = np.abs(np.subtract.outer(np.arange(70), np.arange(70)))
    T = np.where(lags < 12, 0.8**lags, 0.0)
    each = np.fft.rfft(X.T, filters.fft_length(70 + 12))
    assert noise._between_columns(each, rho) == pytest.approx(X.T @ T @ X, abs=1e-11)


def test_a_low_pass_writes_where_it_is_told():
    x, out = np.random.default_rng(0).standard_normal((2, 400)), np.zeros((2, 400))
    assert filters.low_pass_rows(x, 10.0, 200.0, out=out) is out
    assert np.all(out == filters.low_pass_rows(x, 10.0, 200.0))
    assert np.all(filters.low_pass_rows(x, 95.0, 200.0, out=out) == x)


def test_a_derivative_is_that_of_numpy_and_refuses_one_sample():
    x = np.random.default_rng(0).standard_normal((50, 2))
    assert np.all(filters.derivative(x, 0.01) == np.gradient(x, 0.01, axis=0))
    assert np.all(filters.derivative(x[:2], 0.01) == np.gradient(x[:2], 0.01, axis=0))
    with pytest.raises(InvalidInput, match="1 samples are too few"):
        filters.derivative(x[:1], 0.01)


class Library:
    def __init__(self):
        self.calls = []

    def mallopt(self, option, value):
        self.calls.append((option, value))

    def malloc_trim(self, pad):
        self.calls.append(("trim", pad))


class OfLength:
    def __init__(self, n):
        self.time = range(n)


@pytest.mark.parametrize("n", [1000, 4_000_000])
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
    assert library.calls[2:] == [(-3, 1 << 23), (-1, 1 << 24), ("trim", 0)]


def test_without_glibc_nothing_is_asked_of_it(monkeypatch):
    monkeypatch.setattr(_memory, "_glibc", lambda: None)
    assert _memory.with_free_memory(lambda logs: "done")(OfLength(10**9)) == "done"
    assert _memory.with_free_memory(lambda logs: "done")(None) == "done"
