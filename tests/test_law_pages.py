"""The pages of the laws are what the laws say now; their pictures are there and show what they claim to."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from backdrive.laws import ELEMENTS, RATES, Coulomb, Dahl, Law, pages
from backdrive.laws.base import Parameter
from backdrive.laws.examples import example
from backdrive.report.pictures import _signature_data as data
from backdrive.report.pictures import signatures

ROOT = Path(__file__).resolve().parent.parent
NAMES = [*RATES, *ELEMENTS]
BYTES = 70_000  # of a picture at most


def load(path: Path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


law_pages = load(ROOT / "benchmarks" / "law_pages.py")
PAGES = law_pages.pages()


def test_there_is_a_page_a_law_and_an_index():
    assert set(PAGES) == {"README.md", *(f"{name}.md" for name in NAMES)}
    assert {path.name for path in law_pages.TEXT.iterdir()} == set(PAGES)


@pytest.mark.parametrize("name", PAGES)
def test_a_committed_page_is_what_would_be_written(name):
    written = (law_pages.TEXT / name).read_text()
    assert written == PAGES[name], "run: python benchmarks/law_pages.py"


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", PAGES[name]):
        assert (law_pages.TEXT / target).exists()


@pytest.mark.parametrize("name", NAMES)
def test_every_law_has_a_small_picture(name):
    picture = (law_pages.FIGURES / f"{name}.png").read_bytes()
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    assert len(picture) < BYTES
    width, height = struct.unpack(">II", picture[16:24])
    assert (width, height) == pytest.approx((1100, 850), abs=10)


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_a_page_runs(name):
    block = re.search(r"```python\n(.*?)```", PAGES[f"{name}.md"], re.S)
    assert block
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(block[1], {})
    numbers = [float(x) for x in said.getvalue().replace("[", " ").replace("]", " ").split()]
    assert np.all(np.isfinite(numbers))


@pytest.mark.parametrize("name", NAMES)
def test_a_page_has_the_equation_every_parameter_and_every_claim(name):
    kind = pages.find(name)
    text = PAGES[f"{name}.md"]
    assert pages.equation(kind)
    assert f"```text\n{pages.equation(kind)}\n```" in text
    for entry in pages.entries(kind):
        assert f"| `{entry.name}` | `{entry.symbol}` |" in text.replace(r"\|", "|")
    assert all(claim in text for claim in kind.CLAIMS)


def test_text_is_taken_apart_rightly():
    entry = {e.name: e for e in pages.entries(RATES["m4"])}
    assert entry["load"].meaning == "growth with |tau_m - tau_e|"
    assert entry["stribeck_velocity"].meaning == ""  # it says the symbol alone
    assert entry["stribeck"].meaning == "Stribeck torque, which the slowest motion adds"  # inherited
    assert entry["viscous"].unit == "N.m.s/rad or N.s/m"
    assert {e.name: e.unit for e in pages.entries(RATES["m6"])}["quadratic_motor"] == "1/(N.m) or 1/N"
    assert pages.bounds(Parameter(symbol="x", unit="1", lower=1e-9, upper=1e6)) == "1e-9 to 1e6"
    assert pages.bounds(Parameter(symbol="x", unit="1", upper=2.5)) == "<= 2.5"
    assert pages.bounds(Parameter(symbol="x", unit="1")) == "free"


def test_partners_are_those_that_a_law_accepts():
    assert pages.partners(RATES["sigmoid"])[0] == ["none"]
    assert pages.partners(ELEMENTS["none"]) == (list(RATES), "")
    carried, reason = pages.partners(ELEMENTS["gms"])
    assert set(RATES) - set(carried) == {"makkar", "sigmoid"}
    assert reason.startswith("it is continuous and zero at rest")


@pytest.mark.parametrize("name", ["coulomb", "m3", "load-temperature", "polyline+decaying"])
def test_the_four_signatures_are_drawn(name):
    law = example(name)
    figure = signatures.draw(law)
    assert len(figure.axes) == 5
    assert all(axes.get_lines() for axes in figure.axes)
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels == ["speed [rad/s]", "position [mrad]", "", "time [s]", "velocity [rad/s]"]
    assert len(data.conditions(law)) == (1 if not law.rate.NEEDS else 3)
    for axes in figure.axes:
        for line in axes.get_lines():
            assert np.all(np.isfinite(line.get_xydata()))


def test_steady_curves_end_with_what_an_element_promises():
    at = data.conditions(example("lugre"))[0]
    v = np.array([-0.5, 1e-3, 0.02, 0.5])
    for name in ("lugre", "gms", "leuven", "xiong-kikuuwe-multi"):
        law = example(name)
        np.testing.assert_allclose(data.steady(law, v, at), law.torque(v), rtol=1e-6)
    law = example("coulomb+decaying")
    np.testing.assert_allclose(
        data.steady(law, v, at), np.clip(1e4 * v / 20.0, -5.0, 5.0), rtol=1e-7
    )  # min(F, K v/alpha)


def test_presliding_counts_the_path_alone_where_that_is_claimed():
    law = Law(rate=Coulomb(coulomb=5.0), element=Dahl(stiffness=1e4))
    at = data.conditions(law)[0]
    slow, fast = (data.presliding(law, speed, at) for speed in (1e-4, 1e-2))
    np.testing.assert_allclose(slow[1], fast[1], rtol=1e-12, atol=1e-12)
    assert np.abs(slow[1]).max() <= 5.0
    assert slow[0].max() == pytest.approx(3 * 5e-4)


def test_a_pulled_mass_sticks_until_break_away_and_then_slips():
    law = example("hayward-armstrong")
    time, end = data.spring_end(law)
    position = data.pull(law, data.conditions(law)[0])
    torque = data.scene(law).spring * (end - position)
    held = time < 2.9  # 6 N.m at 2 N.m/s, less what the contact gives way
    assert np.ptp(position[held]) < 1e-3
    assert 6.0 < torque.max() < 6.5
    drops = np.flatnonzero(np.diff(torque) > 0)  # loading again
    assert torque[drops[-1] :].min() > 2.0
    assert position[-1] > 0.08


def test_lag_is_a_loop_only_where_an_element_lags():
    def area(name, frequency):
        law = example(name)
        v, torque = data.lag(law, frequency, data.conditions(law)[0])
        return abs(0.5 * np.sum(v[:-1] * torque[1:] - v[1:] * torque[:-1]))

    assert area("none", 10.0) < 1e-12
    assert area("maxwell-slip", 10.0) < 0.01 * area("xiong-kikuuwe", 10.0)
    assert 5 * area("xiong-kikuuwe", 1.0) < area("xiong-kikuuwe", 10.0)
