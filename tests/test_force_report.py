"""The report of `estimate`: offline, safe, remarks first, its numbers the estimate's; and the temperature of a log."""

import re
from dataclasses import replace

import numpy as np
import pytest

from backdrive import FrictionModel, Joint, Log
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.errors import InvalidInput
from backdrive.external import Contact, ForceEstimate, JointForce, Threshold, estimate_force
from backdrive.external.wrench import WrenchEstimate
from backdrive.identification.bands import states
from backdrive.identification.signals import prepare
from backdrive.laws import Law, LoadTemperature
from backdrive.model import Band, Bands, Estimate, JointFriction, Validity
from backdrive.report.force import render_force, write_force_report
from backdrive.report.pictures.force import save_force
from backdrive.report.sheet import CSS
from backdrive.report.words import percent

HOSTILE = "j<script>&\"'"


def estimate(name="elbow", n=4000, known=True, start=0.0) -> ForceEstimate:
    """Return an estimate of one joint with a contact."""
    t = start + np.arange(n) * 0.01
    x = 0.1 * np.sin(3.0 * t) + np.where((t > start + 12.0) & (t < start + 13.5), 2.0, 0.0)
    one = JointForce(
        joint=Joint(name=name),
        time=t,
        force=x,
        friction=np.sign(np.sin(t)),
        lower=x - 0.5,
        upper=x + 0.5,
        state=np.where(np.arange(n) % 500 > 450, 2, np.arange(n) % 500 > 400).astype(np.int8),
        method="momentum",
        bandwidth=60.0,
        lag=0.02,
        known=x + 0.1 if known else None,
        contact=x > 1.0,
    )
    thresholds = [
        Threshold(
            joint=name,
            state=s,
            bands=b,
            interval=(1.5, 4.5),
            peaks=100,
            highest=2.0,
            hours=1.0,
            extrapolation=1.0,
        )
        for s, b in (("moving", 2.5), ("reversing", 3.5), ("rest", 1.25))
    ]
    contact = Contact(begin=start + 12.01, end=start + 13.49, forces={name: 2.1})
    return ForceEstimate(
        joints=(one,),
        remarks=("A remark <b>.",),
        contacts=(contact,),
        thresholds=tuple(thresholds),
        false_alarms=1.0,
    )


def test_the_page_is_offline_safe_and_says_remarks_first(tmp_path):
    text = render_force(estimate(HOSTILE), command="backdrive estimate <m> log.csv")
    assert "<script" not in text and "//" not in text and "j&lt;script&gt;" in text
    assert "default-src 'none'" in text and "&lt;m&gt;" in text
    assert text.index("A remark &lt;b&gt;.") < text.index("<table") < text.index('class="joint"')
    used, defined = set(re.findall(r"var\((--[a-z-]+)\)", text)), set(re.findall(r"(--[a-z-]+):", CSS))
    assert used <= defined and not re.search("#0a0b", text)
    identifiers = re.findall(r' id="([^"]+)"', text)
    assert len(identifiers) == len(set(identifiers))
    assert render_force(estimate(HOSTILE), command="backdrive estimate <m> log.csv") == text
    assert (
        write_force_report(estimate(), tmp_path / "r.html", command="c")
        .read_text()
        .startswith("<!DOCTYPE html>")
    )


def test_the_page_shows_the_estimates_numbers():
    found = estimate()
    text = re.sub(r"<[^>]+>", " ", render_force(found, command="c", remarks=("Another remark.",)))
    one = found.joints[0]
    assert "Another remark." in text and "A remark" not in text
    for part in (
        "1 contact, at thresholds for a false-alarm rate of 1/h",
        "12.010 s",
        "2.10 N·m",
        "momentum, 60.0 1/s",
    ):
        assert part in text
    assert percent(100.0 * float(np.mean(one.outside))) in text
    assert "0.100 N·m" in text  # RMS error
    assert re.search(r"Threshold, bands\s+2\.50\s+3\.50\s+1\.25", text)
    assert re.search(r"Half the band\s+0?\.?500\S* \S+\s+0?\.?500", text)
    for label in ("External torque on elbow", "Largest contact of elbow", "Friction taken off, elbow"):
        assert label in render_force(found, command="c")
    plain = render_force(replace(estimate(known=False), contacts=None, thresholds=()), command="c")
    assert "Contacts" not in plain and "known" not in plain.split("What the words mean")[0]


def test_pictures_hold_long_logs_and_clocks_of_an_epoch(tmp_path):
    found = estimate(n=200_000, start=1.7e9)
    text = render_force(found, command="c")
    assert len(text) < 250_000 and "from 1700000000.000 s on" in text
    save_force(tmp_path / "f.svg", found)
    assert "<svg" in (tmp_path / "f.svg").read_text()
    six = ForceEstimate(joints=tuple(estimate(f"j{k}").joints[0] for k in range(6)))
    assert render_force(six, command="c").count("<section") == 7


def test_a_wrench_has_a_section_of_its_own():
    found = estimate()
    t, n = found.joints[0].time, found.joints[0].time.size
    wrench = np.outer(np.sin(t), [10.0, 5.0, 2.0, 1.0, 0.5, 0.2])
    at = WrenchEstimate(
        frame=HOSTILE,
        time=t,
        wrench=wrench,
        covariance=np.broadcast_to(np.diag([4.0, 4.0, 4.0, 0.01, 0.01, 0.01]), (n, 6, 6)),
        singular=np.arange(n) < n // 4,
        known=wrench + 1.0,
    )
    text = render_force(replace(found, wrench=at), command="c")
    plain = re.sub(r"<[^>]+>", " ", text)
    assert "Wrench at" in plain and "<script" not in text and "For 25.0 % of the time" in plain
    assert re.search(r"fx\s+[67]\.\d+ N\s+10\.00 N\s+2\.00 N\s+1\.00 N", plain)
    assert text.count("<svg viewBox") > render_force(found, command="c").count("<svg viewBox")


M, BANDS = 0.5, Bands(moving=Band(half_width=0.2, samples=100), reversing=Band(half_width=0.5, samples=100))


def warm_model(temperature=(10.0, 50.0)) -> FrictionModel:
    """Return a model whose friction thins as it warms."""
    law = Law(
        rate=LoadTemperature(
            coulomb=1.0,
            coulomb_load=0.0,
            stribeck=0.0,
            stribeck_load=0.0,
            stribeck_temperature=0.0,
            stribeck_velocity=0.1,
            stribeck_velocity_temperature=0.0,
            viscous=0.5,
            viscous_temperature=4.0,
            thinning=20.0,
        )
    )
    validity = Validity(velocity=(-4.0, 4.0), temperature=temperature)
    one = JointFriction(
        joint=Joint(name="j1"),
        law=law,
        dynamics={"inertia": Estimate(value=M, unit="kg.m^2")},
        validity=validity,
        bands=BANDS,
    )
    return FrictionModel(joints=(one,))


def warm_log(model, celsius, channel=True) -> Log:
    """Return a log of free motion at a temperature, with a hole in its channel."""
    t = np.arange(0.0, 8.0, 1e-3)
    q, dq, ddq = np.sin(2.0 * t), 2.0 * np.cos(2.0 * t), -4.0 * np.sin(2.0 * t)
    temp = np.broadcast_to(np.asarray(celsius, dtype=float), t.shape).copy()
    tau = M * ddq + model.joints[0].law.torque(dq, temperature=temp)
    temp[1000:1200] = np.nan
    return Log(
        time=t,
        position=q[:, None],
        torque=tau[:, None],
        temperature=temp[:, None] if channel else None,
        joints=(Joint(name="j1"),),
    )


def test_a_law_of_temperature_runs_at_that_of_the_log():
    model = warm_model()
    for celsius in (15.0, 45.0, np.linspace(15.0, 45.0, 8000)):
        one = estimate_force(model, warm_log(model, celsius), method="momentum", bandwidth=60.0)
        assert not any("temperature" in line for line in one.remarks)
        moving = one.joints[0].state == 0
        assert np.abs(one.joints[0].force[moving]).max() < 0.15


def test_without_a_channel_it_says_which_temperature_it_took():
    for covered, words in (((40.0, 50.0), "45 degC"), (None, "20 degC")):
        model = warm_model(covered)
        log = warm_log(model, 45.0, channel=False)
        found = estimate_force(model, log, method="momentum", bandwidth=60.0)
        assert any(words in line and "assumed" in line and "--map temp" in line for line in found.remarks)
        moving = found.joints[0].state == 0
        error = np.abs(found.joints[0].force[moving]).max()
        assert error < 0.15 if covered else error > 0.5
    beyond = estimate_force(warm_model((10.0, 20.0)), warm_log(warm_model(), 45.0), bandwidth=60.0)
    assert any("extrapolates" in line and "45" in line for line in beyond.remarks)


def test_the_estimator_takes_one_temperature_or_one_a_sample():
    law = warm_model().joints[0].law
    made = ExternalForce(inertia=M, friction=FrictionEstimator(law=law), method="momentum")
    q, u = np.cumsum(np.full(500, 1e-3)), np.zeros(500)
    cold = made.run(q, u, 1e-3, velocity=1.0, temperature=10.0)[1]
    assert np.array_equal(cold, made.run(q, u, 1e-3, velocity=1.0, temperature=np.full(500, 10.0))[1])
    assert np.array_equal(
        made.run(q, u, 1e-3, velocity=1.0)[1], made.run(q, u, 1e-3, velocity=1.0, temperature=20.0)[1]
    )
    assert cold[-1] > made.run(q, u, 1e-3, velocity=1.0)[1][-1]
    for wrong in (np.nan, np.zeros(3)):
        with pytest.raises(InvalidInput, match="temperature"):
            made.run(q, u, 1e-3, temperature=wrong)


def test_creeping_starting_and_stopping_count_as_reversing():
    t = np.arange(0.0, 10.0, 1e-3)
    v = np.clip(np.minimum(t - 1.0, 9.0 - t), 0.0, 1.0)
    v = np.where((t > 4.0) & (t < 5.0), 0.01, v)
    log = Log(time=t, position=(np.cumsum(v) * 1e-3)[:, None], torque=v[:, None], joints=(Joint(name="j"),))
    s = prepare(log, 0)[0]
    plain, creeping = states(s), states(s, creep=0.02)
    assert plain[4500] == 0 and creeping[4500] == 1 and creeping[3000] == 0
    assert (creeping == 2).sum() == (plain == 2).sum() > 1000
    first = 500 + np.flatnonzero(creeping[500:] != 2)[0]
    assert np.all(creeping[first : first + 40] == 1)


def test_the_picture_explains_band_rest_and_contact_in_one_legend():
    from matplotlib.text import Text

    from backdrive.report import show

    two = replace(estimate(), joints=(estimate().joints[0], estimate("wrist", known=False).joints[0]))
    figure = show.picture(two)
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == ["estimated", "95 % band", "known", "at rest", "contact"]
    written = [text.get_text() for text in figure.findobj(Text)]
    assert written.count("external torque [N·m]") == 2
    assert {"elbow", "wrist"} <= set(written)
    plain = show.picture(replace(estimate(known=False), contacts=None))
    assert "contact" not in [text.get_text() for text in plain.legends[0].get_texts()]
