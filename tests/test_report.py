"""The report: self-contained, safe from hostile names, the same bytes every time, and its numbers the model's."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from _example_identification import COMMAND, HOSTILE, ORDINARY, curve_of, example, truths
from backdrive.errors import InvalidInput, MissingExtra
from backdrive.identification.quality import grade
from backdrive.identification.result import Curve, Samples
from backdrive.model import Validity
from backdrive.model.file import decode, encode
from backdrive.report import render, write_report
from backdrive.report.figures import distance
from backdrive.report.sheet import CSS
from backdrive.report.words import number, plain

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Page(HTMLParser):
    """Reads a page strictly: every tag closed in order, every attribute kept."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.attributes, self.texts, self.rows = [], [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, key, value) for key, value in attrs]
        if tag == "tr":
            self.rows.append([])
        if tag in {"td", "th"} and self.rows:
            self.rows[-1].append("")
        if tag == "br":
            self.handle_data("\n")
        if tag not in VOID:
            self.open.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert tag not in VOID
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        inside = [t for t, _ in self.open]
        self.texts.append((inside, data))
        if self.rows and inside and {"td", "th"} & set(inside):
            self.rows[-1][-1] += data

    def values(self, key):
        return [value for _, k, value in self.attributes if k == key]

    def text(self, tag):
        return "".join(data for inside, data in self.texts if tag in inside)


@pytest.fixture(scope="module")
def result():
    return example()


@pytest.fixture(scope="module")
def page(result):
    return render(result, command=COMMAND)


@pytest.fixture(scope="module")
def hostile():
    found = example(HOSTILE)
    return found, render(
        found, command="backdrive identify '<img src=x>'.csv", title=HOSTILE[1], compare=truths(found)
    )


@pytest.fixture(scope="module")
def one():
    return example(("elbow",))


def test_names_no_address_and_runs_nothing(page, hostile):
    for text in (page, hostile[1]):
        read = Page(text)
        assert not {"script", "link", "img", "iframe", "object", "embed", "base", "form", "style"} & (
            set(read.tags) - {"style"}
        )
        assert read.tags.count("style") == 1
        assert all(value.startswith("#") for value in read.values("href"))
        assert not {"src", "srcset", "data", "action", "xmlns", "xlink:href"} & {
            k for _, k, _ in read.attributes
        }
        assert not [k for _, k, _ in read.attributes if k.startswith("on")]
        assert set(re.findall(r"url\(([^)]{2})", text)) <= {"#j"}
        assert "@import" not in text
    assert "//" not in page
    assert not re.search(r"https?:|xmlns|DOCTYPE svg", page)
    policy = dict(
        (k, v) for t, k, v in Page(page).attributes if t == "meta" and k == "content" and "src" in v
    )
    assert policy["content"].startswith("default-src 'none'; style-src 'unsafe-inline'")


def test_identifiers_are_unique_and_lead_somewhere(page):
    read = Page(page)
    ids = read.values("id")
    assert len(ids) == len(set(ids))
    targets = {v[1:] for v in read.values("href")} | set(re.findall(r"url\(#([^)]+)\)", page))
    assert targets
    assert targets <= set(ids)
    assert not [i for i in ids if not re.fullmatch(r"[a-z][a-z0-9-]*", i)]


def test_hostile_names_are_text_only(hostile):
    _, text = hostile
    read = Page(text)
    shown = read.text("bdi")
    for name in HOSTILE:
        assert plain(name)[:59] in shown
        assert name not in text or not set(name) & set("<>&\"'\x00")
    assert HOSTILE[3] in shown
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f\u202a-\u202e\u2066-\u2069]", text)
    assert "<img src=x>" in read.text("pre")
    assert Page(text).text("title") == HOSTILE[1]
    assert "&lt;not&gt; to be trusted" in text


def test_what_cannot_be_encoded_is_replaced(one):
    odd = replace(one, model=replace(one.model, options={"path": "a\udcff<b>"}))
    text = render(odd, command="x \udcff")
    assert "a?&lt;b&gt;" in text
    text.encode("utf-8")


def test_same_result_same_bytes(one, page, result):
    import matplotlib

    first = render(one, command=COMMAND)
    with matplotlib.rc_context({"font.size": 30, "axes.facecolor": "red", "svg.fonttype": "path"}):
        assert render(one, command=COMMAND) == first
        assert matplotlib.rcParams["font.size"] == 30
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from _example_identification import *\nfrom backdrive.report import render\n"
        "sys.stdout.buffer.write(render(example(('elbow',)), command=COMMAND).encode())"
    )
    other = subprocess.run(
        [sys.executable, "-c", code, str(Path(__file__).parent)], capture_output=True, check=True, timeout=120
    )
    assert other.stdout.decode() == first


def test_six_joints_stay_small_and_their_text_is_text(page):
    assert len(page.encode()) < 1_500_000
    read = Page(page)
    assert read.tags.count("svg") > 6 * 4
    drawn = read.text("svg")
    for words in (
        "friction [N·m]",
        "friction [N]",
        "velocity [rad/s]",
        "residual [N·m]",
        "position [rad]",
        "time [s]",
    ):
        assert words in drawn
    assert "friction, magnitude" in drawn
    assert read.tags.count("section") == len(ORDINARY) + 1


def test_colours_are_variables_that_exist(page):
    drawn = "".join(re.findall(r"<svg.*?</svg>", page, re.S))
    assert not re.search("#0a0b", page)
    assert not re.findall(r"(?:fill|stroke):\s*#[0-9a-f]{3,6}", drawn)
    used = set(re.findall(r"var\((--[a-z-]+)\)", page))
    defined = set(re.findall(r"(--[a-z-]+):", CSS))
    assert {"--ink", "--fitted", "--held-out", "--band"} <= used
    assert used <= defined


def test_every_dot_is_a_thinned_sample(one):
    text = render(one, command=COMMAND)
    samples = one.evidence[0].samples
    seen = np.count_nonzero(np.isfinite(samples.friction))
    assert seen == 4000
    figures = re.findall(r"<svg viewBox=\"0 0 [^>]*aria-label=\"([^\"]*)\">(.*?)</svg>", text, re.S)
    counts = {label.split(",")[0]: body.count("h0") for label, body in figures}
    assert 1470 <= counts["Friction against velocity"] <= 1500
    assert all(
        1470 <= counts[f"Residual torque against {k}"] <= 1500 for k in ("time", "velocity", "position")
    )


def shown_numbers(text):
    """Read `+1.25 ± 0.03` back as (1.25, 0.03); (1.25, nan) without an error."""
    pattern = r"([+\u2212]?\d+(?:\.\d+)?)(?: ± (\d+(?:\.\d+)?))?"
    return [
        (float(value.replace("\u2212", "-")), float(error) if error else math.nan)
        for value, error in re.findall(pattern, text)
    ]


def test_summary_shows_the_models_numbers(page, result):
    rows = [row for row in Page(page).rows if len(row) == 7 and row[0] in ORDINARY]
    assert [row[0] for row in rows] == list(ORDINARY)
    for row, friction, evidence in zip(rows, result.model.joints, result.evidence, strict=True):
        assert row[1] == grade(friction).word
        reach = {1: friction.validity.velocity[1], -1: -friction.validity.velocity[0]}
        low = 0.02 * max(reach.values())
        for cell, speeds in ((row[2], {1: low, -1: low}), (row[3], reach)):
            lines = cell.split("\n")
            for line, (sign, speed) in zip(lines, speeds.items(), strict=False):
                ((value, error),) = shown_numbers(line)
                curve = evidence.curve
                side = np.sign(curve.velocity) == sign
                expected = np.interp(sign * speed, curve.velocity[side], curve.torque[side])
                expected_error = np.interp(sign * speed, curve.velocity[side], curve.standard_error[side])
                assert value == pytest.approx(expected, rel=2e-3)
                assert error == pytest.approx(expected_error, rel=0.06, nan_ok=True)
            at = " and ".join(dict.fromkeys(map(number, speeds.values())))
            assert f"{at} {friction.joint.unit}/s" in lines[2]
        for cell, quality in ((row[4], friction.fitted), (row[5], friction.held_out)):
            assert cell == ("—" if quality is None else f"{number(quality.residual)} %")
        assert row[6] == (str(len(friction.warnings)) if friction.warnings else "none")


def test_parameters_and_knots_show_the_models_numbers(page, result):
    rows = Page(page).rows
    rate = result.model.joints[0].law.rate
    errors = result.model.joints[0].standard_errors["positive"]
    table = [row for row in rows if len(row) == 3 and re.fullmatch(r"[\d.]+", row[0])][: len(rate.velocity)]
    for row, v, f, s in zip(table, rate.velocity, rate.positive, errors, strict=True):
        assert float(row[0]) == pytest.approx(v, rel=1e-3)
        ((value, error),) = shown_numbers(row[1])
        assert value == pytest.approx(f, rel=1e-2)
        assert error == pytest.approx(s, rel=0.05)
    bound = next(row for row in rows if row[0].startswith("viscous coefficient along \u2212q"))
    assert "at its bound" in bound[1]
    assert bound[2] == "≥ 0"
    inertia = [row for row in rows if row[0] == "inertia"]
    for row, friction in zip(inertia, result.model.joints, strict=True):
        ((value, error), *_) = shown_numbers(row[1])
        assert value == pytest.approx(friction.dynamics["inertia"].value, rel=1e-2)
        assert error == pytest.approx(friction.dynamics["inertia"].standard_error, rel=0.05)


def test_says_what_it_does_not_know(page, result):
    sections = re.split(r'<section class="joint"', page)[1:]
    assert "The log holds no position." in sections[1]
    assert "No band: the standard errors are not known." in sections[2]
    assert "±2 standard errors" not in sections[2]
    assert "±2 standard errors" in sections[0]
    assert "during a ramp" in sections[3]
    assert "displacement [" in sections[3]
    assert "No data were held out" in sections[4]
    assert "not judged" in sections[5]
    assert "not recorded" in sections[5]
    assert "on the motor side, gear ratio 101" in sections[0]
    for section, friction in zip(sections, result.model.joints, strict=True):
        assert section.count("<li>") == len(friction.warnings)


def test_depth_is_folded_but_for_knots_and_the_model_can_be_taken_out(page, result):
    read = Page(page)
    assert read.tags.count("details") == 5 + 2  # five polylines; the model file and the words
    unfolded = [k for t, k, _ in read.attributes if t == "details" and k == "open"]
    assert len(unfolded) == 5  # knots are the result of a polyline
    text = "".join(d for inside, d in read.texts if "pre" in inside and "details" in inside)
    assert encode(decode(text.encode())) == encode(result.model)
    assert COMMAND in read.text("pre")
    for source in result.model.sources:
        assert source.path in read.text("code")
        assert source.sha256 in read.text("code")


def test_the_verdict_counts(page, one):
    assert "Of 6 joints, 5 are good and 1 is not judged. Read 4 warnings" in page
    assert "<title>Friction of elbow</title>" in render(one, command="x")
    poor = replace(one.model.joints[0], held_out=replace(one.model.joints[0].held_out, residual=64.0))
    text = render(
        replace(one, model=replace(one.model, joints=(poor,)), warnings=()), command="x", title="Bench 3"
    )
    assert "The result is poor." in text
    assert '<span class="chip poor">poor</span>' in text
    assert "<title>Bench 3</title>" in text


def test_distance_to_the_truth(one):
    curve = one.evidence[0].curve
    truth = truths(one)["elbow"]
    rms, worst = distance(curve, truth)
    assert rms == pytest.approx(0.03 * np.sqrt(np.mean(curve.torque**2)))
    assert worst == pytest.approx(0.03 * np.max(np.abs(curve.torque)))
    coarse = Curve(velocity=np.array([-5.0, -4.0]), torque=np.zeros(2), standard_error=np.zeros(2))
    assert np.isnan(distance(curve, coarse)).all()
    assert f"RMS {number(rms, 2)} N·m, at most {number(worst, 2)} N·m" in render(
        one, command="x", compare={"elbow": truth}
    )


def test_refuses_what_does_not_belong(one, result):
    with pytest.raises(InvalidInput, match="evidence"):
        render(replace(one, evidence=result.evidence[:1]), command="x")
    with pytest.raises(InvalidInput, match="knee"):
        render(one, command="x", compare={"knee": one.evidence[0].curve})


def test_writes_whole_or_not_at_all(one, tmp_path, monkeypatch):
    written = write_report(one, tmp_path / "report.html", command=COMMAND)
    assert written.read_text(encoding="utf-8") == render(one, command=COMMAND)
    with pytest.raises(InvalidInput, match="no"):
        write_report(one, tmp_path / "no" / "report.html", command="x")
    for name in [m for m in sys.modules if m.split(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtra, match=r'pip install "backdrive\[report\]"'):
        write_report(one, tmp_path / "other.html", command="x")
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def empty_samples(n=0):
    return Samples(
        **{f.name: np.full(n, np.nan) for f in fields(Samples) if f.name != "fitted"}, fitted=np.ones(n, bool)
    )


@pytest.mark.parametrize(
    "case", ["no samples", "all NaN", "one sample", "one direction", "rest", "no friction"]
)
def test_strange_evidence_is_still_shown(one, case):
    friction, evidence = one.model.joints[0], one.evidence[0]
    if case in {"no samples", "all NaN"}:
        evidence = replace(evidence, samples=empty_samples(0 if case == "no samples" else 50))
    elif case == "one sample":
        evidence = replace(
            evidence,
            samples=Samples(**{f.name: getattr(evidence.samples, f.name)[:1] for f in fields(Samples)}),
        )
    elif case == "one direction":
        friction = replace(friction, validity=Validity(velocity=(0.1, 2.0)))
        curve = evidence.curve
        side = curve.velocity > 0
        evidence = replace(
            evidence, curve=Curve(**{f.name: getattr(curve, f.name)[side] for f in fields(Curve)})
        )
    elif case == "rest":
        friction = replace(friction, validity=Validity(velocity=(0.0, 0.0)))
        none = np.empty(0)
        evidence = replace(evidence, curve=Curve(velocity=none, torque=none, standard_error=none))
    else:
        law = replace(
            friction.law, rate=replace(friction.law.rate, positive=(0.0,) * 10, negative=(0.0,) * 10)
        )
        friction = replace(friction, law=law)
        evidence = replace(evidence, curve=curve_of(law, 2.0, 0.0))
    odd = replace(one, model=replace(one.model, joints=(friction,)), evidence=(evidence,))
    text = render(odd, command="x")
    Page(text)
    assert not re.search(r"\b(nan|inf|None)\b", re.sub(r"<pre.*?</pre>", "", text, flags=re.S))


def test_paths_are_short_and_say_the_same():
    from backdrive.report.pictures.svg import _path

    assert _path("M 10.04 -0.04 \nL 20.96 5 \nz") == "M10 0L21 5z"
    assert _path("M 3.14159 2 L 3.14159 2 M 1 2 L 3 4") == "M3.1 2h0M1 2L3 4"
    assert _path("M 0 0 C 1.25 2.5 3 4 5 6 Q 100.0 -0 -10.05 7") == "M0 0C1.2 2.5 3 4 5 6Q100 0 -10.1 7"


@pytest.mark.parametrize("frozen", [False, True])
def test_the_collector_is_left_as_it_was(frozen):
    import gc

    from backdrive.report.pictures.canvas import house_style

    if frozen:
        gc.freeze()
    try:
        with house_style(), house_style():
            assert gc.get_freeze_count() > 0
        assert (gc.get_freeze_count() > 0) == frozen
    finally:
        gc.unfreeze()
