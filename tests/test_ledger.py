"""The ledger of the thesis' statements, its page, and the scatter that verdicts rest on."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from backdrive.control.admittance import Admittance
from backdrive.errors import InvalidInput
from backdrive.identification.metrics import mean_magnitude, tracking_error
from backdrive.laws import CoulombViscous, Law
from backdrive.thesis import Claim, Outcome, fig_2_7
from backdrive.thesis.catalog import ENTRIES
from backdrive.thesis.ledger import STATEMENTS, counts, disagreements, evaluate, headline, missing
from backdrive.thesis.scatter import clearly_less, interval, less
from backdrive.thesis.statement import REPRODUCED, UNJUDGED, VERDICTS

ROOT = Path(__file__).resolve().parent.parent


def outcome(**holds: bool | None) -> Outcome:
    claims = tuple(
        Claim(what="w", ours="o", holds=value, statement=name.replace("_", "-").replace("x", ".").lstrip("s"))
        for name, value in holds.items()
    )
    return Outcome(name="fig-3.8", title="t", setting="s", claims=claims)


def test_every_statement_has_a_place_a_verdict_and_where_it_is_lost_a_reason():
    names = [s.name for s in STATEMENTS]
    assert len(set(names)) == len(names) == sum(counts(STATEMENTS).values())
    known = {e.name for e in ENTRIES}
    for s in STATEMENTS:
        assert s.experiment in known and s.section[0] in "234" and s.verdict in VERDICTS
        assert bool(s.why) == (s.verdict != REPRODUCED)
        omitted = "not printed" in s.why or "without numbers" in s.why
        assert omitted or s.verdict != UNJUDGED, f"{s.name} does not name the quantity that is omitted"
    assert all(f" {n} {verdict}" in headline(STATEMENTS) for verdict, n in counts(STATEMENTS).items())


def test_a_statement_comes_out_where_all_its_claims_hold():
    assert evaluate([outcome(s3x8_test=True), outcome(s3x8_test=False)]) == {"3.8-test": False}
    assert evaluate([outcome(s3x8_test=True, s3x8_dither=None)]) == {"3.8-test": True, "3.8-dither": False}
    lost, kept = "3.8-test", "3.7-speed"
    assert disagreements({lost: False, kept: True}) == ()
    assert disagreements({lost: True, kept: False, "9.9-new": True}) == (lost, kept, "9.9-new")
    unjudged = next(s for s in STATEMENTS if s.verdict == UNJUDGED)
    assert disagreements({unjudged.name: True}) == (unjudged.name,)
    assert kept in missing(["fig-3.7"], {}) and unjudged.name not in missing([unjudged.experiment], {})


def test_a_failure_s_explanation_is_told_only_where_it_fails():
    told = [Claim(what="w", ours="o", holds=h, why="a", why_not="b").explanation for h in (True, None, False)]
    assert told == ["a", "a", "b"]


def test_the_page_is_what_would_be_written():
    spec = importlib.util.spec_from_file_location("claims_page", ROOT / "benchmarks" / "claims_page.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.PAGE.read_text() == module.page(), "run: python benchmarks/claims_page.py"


def test_the_interval_is_students():
    d = np.random.default_rng(3).normal(0.4, 1.0, 12)
    expected = ttest_1samp(d, 0.0).confidence_interval(0.95)
    assert interval(d) == pytest.approx((expected.low, expected.high))
    small, large = np.array([1.0, 2.0, 3.0]), np.array([1.02, 2.03, 3.02])
    assert less(small, large) and not less(large, small) and not clearly_less(small, large)
    assert clearly_less(small, small + np.array([0.3, 0.31, 0.32]))


def test_mean_magnitudes_are_those_of_sines():
    """(2.23), (2.26): A/sqrt(2) over whole periods."""
    t = np.arange(4000) / 1000.0
    assert mean_magnitude(3.0 * np.sin(2 * np.pi * t)) == pytest.approx(3.0 / np.sqrt(2.0))
    assert tracking_error(np.sin(2 * np.pi * t) + 0.5, np.sin(2 * np.pi * t)) == pytest.approx(0.5)
    with pytest.raises(InvalidInput, match="1 values that are not finite"):
        mean_magnitude(np.array([1.0, np.nan]))
    with pytest.raises(InvalidInput, match="3,.*2,"):
        tracking_error(np.zeros(3), np.zeros(2))


def test_the_virtual_force_is_of_mass_and_viscosity():
    """(4.19): a mass of 2 kg and 15 N.s/m that falls freely from rest."""
    virtual = Admittance(inertia=2.0, viscosity=15.0, proportional=0.0, derivative=0.0, limit=1.0)
    t = np.linspace(0.0, 1.0, 5)
    assert virtual.virtual_force(9.81 * t, np.full(5, 9.81)) == pytest.approx(2.0 * 9.81 + 15.0 * 9.81 * t)
    with pytest.raises(InvalidInput, match="one of each"):
        virtual.virtual_force(np.zeros(3), np.zeros(4))


def test_a_curve_that_was_not_obtained_lies_on_no_other():
    curve = Law(rate=CoulombViscous(coulomb_positive=5.0, coulomb_negative=5.0))
    assert fig_2_7._apart(curve, curve) == 0.0
    assert fig_2_7._apart(None, curve) == fig_2_7._apart(curve, None) == float("inf")
