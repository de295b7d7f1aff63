"""Pictures of a page against matplotlib's own: the same paths and texts at the same places, and the same ticks."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from backdrive.report.pictures import canvas, svg
from backdrive.report.pictures.ticks import Ticks

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


def points_of(d):
    """Return the points of a path as it is written, a stroke without length as its two ends."""
    d = re.sub(r"M(\S+) (\S+?)h0", r"M\1 \2L\1 \2", d)
    d = re.sub(r"M(\S+) (\S+?)H(\S+?)V(\S+?)H\3?(\S*?)z", r"M\1 \2L\3 \2L\3 \4L\1 \4z", d)
    return np.array([float(x) for x in NUMBER.findall(d)]).reshape(-1, 2)


def figure_of_everything():
    figure = canvas.new_figure(canvas.CSS)
    axes = canvas.axes_of(figure, canvas.CSS)
    x = np.linspace(-1.0, 1.3, 40)
    y = np.where(np.abs(x) < 0.1, np.nan, np.sin(3.0 * x))
    axes.plot(x, y, color=canvas.CSS.ink, linewidth=1.7, linestyle=canvas.DASHED)
    axes.plot(x[::8], x[::8], **canvas.markers(canvas.CSS, 4.0, canvas.CSS.fitted))
    axes.fill_between(x, x - 0.2, x + 0.3, color=canvas.CSS.band, alpha=0.3, linewidth=0)
    canvas.dots(axes, canvas.CSS, np.repeat(x, 5), np.tile(y, 5), canvas.CSS.held_out)
    axes.annotate("<a & b>", (0.5, 0.5), xytext=(3, 4), textcoords="offset points", fontweight="bold")
    axes.text(0.2, 0.1, "turned", rotation=90, color="#123456")
    axes.set_xlim(-1.1, 1.4)
    canvas.name_axes(axes, canvas.CSS, x="speed [rad/s]", y="friction [N·m]")
    return figure


def test_a_page_has_what_matplotlib_draws():
    with canvas.house_style():
        text = svg.inline(figure_of_everything(), "p", "everything & more")
        own = canvas.content(figure_of_everything(), "svg").decode()
    page = ElementTree.fromstring(text)
    theirs = ElementTree.fromstring(
        re.sub(r' xmlns(:\w+)?="[^"]+"|xlink:', "", own.partition("<svg")[1] + own.partition("<svg")[2])
    )
    assert page.get("viewBox") == "0 0 324 220" and page.get("aria-label") == "everything & more"
    size = [float(w) for w in page.get("viewBox").split()[2:]]
    drawn = [p for p in page.iter("path")]
    wanted = [p.get("d", "") for p in theirs.iter("path")]
    wanted = [w for w in (points_of(d) for d in wanted) if len(w)]
    for path in drawn:
        found = points_of(path.get("d"))
        # a fill is a marker for matplotlib, with a place of its own
        near = [
            w
            for w in wanted
            if w.shape == found.shape
            and min(np.abs(w - found).max(), np.abs(w - w[0] - found + found[0]).max() - 0.05) < 0.0501
        ]
        clip = [[44.0, 24.0], [314.0, 24.0], [314.0, 182.0], [44.0, 182.0]]  # of the axes
        assert near or np.array_equal(found, clip), path.get("d")[:80]
    strokes = [p for p in drawn if "stroke:var(--ink);stroke-width:1.7" in (p.get("style") or "")]
    assert len(strokes) == 1 and "stroke-dasharray" in strokes[0].get("style")
    assert strokes[0].get("d").count("M") == 2  # one gap
    texts = {t.text: t for t in page.iter("text")}
    for theirs_ in theirs.iter("text"):
        mine = texts.pop(theirs_.text)
        at = [float(mine.get(k)) for k in "xy"]
        if theirs_.get("x"):
            assert np.allclose(at, [float(theirs_.get(k)) for k in "xy"], atol=0.06)
        assert 0.0 <= at[0] <= size[0] and 0.0 <= at[1] <= size[1]
    assert not texts
    assert "font-weight:bold" in next(t for t in page.iter("text") if t.text == "<a & b>").get("style")
    assert "rotate(-90 " in next(t for t in page.iter("text") if t.text == "turned").get("transform")
    used = {u.get("href")[1:] for u in page.iter("use")} | set(re.findall(r"url\(#([^)]+)\)", text))
    names = [e.get("id") for e in page.iter() if e.get("id")]
    assert used == set(names) and len(names) == len(set(names)) and all(n.startswith("p-") for n in names)
    assert len([u for u in page.iter("use")]) == 5


@pytest.mark.parametrize(
    ("x", "y", "scale"),
    [
        ((-0.31, 1.17), (-3.0, 1.7), "linear"),
        ((1.0, 4e7), (1e-6, 9e-6), "linear"),
        ((1.0, 4e7), (2.0, 3.0), "log"),
        ((5.0, 5.0), (2.0, 3.0), "linear"),
    ],
)
def test_ticks_are_those_of_matplotlib(x, y, scale):
    with canvas.house_style():
        plain = Figure(figsize=(4.5, 3.0), dpi=72)
        theirs = plain.add_axes((0.2, 0.2, 0.7, 0.7))
        figure = canvas.new_figure(canvas.LIGHT, 324.0, 216.0)
        mine = canvas.axes_of(figure, canvas.LIGHT, (0.2 * 324.0, 0.2 * 216.0, 0.7 * 324.0, 0.7 * 216.0))
        for axes in (theirs, mine):
            axes.plot(x, y)
            axes.set_xscale(scale)
        written = []
        ticks = next(a for a in mine.artists if isinstance(a, Ticks))
        ticks._write = lambda renderer, word, x, y, side, color: written.append((word, x, y, side))
        canvas.content(plain, "svg")
        canvas.content(figure, "svg")
        wanted = []
        for axis in (theirs.xaxis, theirs.yaxis):
            side = 0 if axis is theirs.xaxis else 1
            low, high = theirs.bbox.intervalx if side == 0 else theirs.bbox.intervaly
            for tick in axis.get_major_ticks():
                at = theirs.transData.transform([tick.get_loc()] * 2)[side]
                if low - 0.5 <= at <= high + 0.5 and tick.label1.get_text():
                    wanted.append((tick.label1.get_text(), round(at, 2)))
        powers = [axis.get_offset_text().get_text() for axis in (theirs.xaxis, theirs.yaxis)]
    found = [
        (word, round(at[0] if side == "center" else at[1] + 4.0, 2))
        for word, *at, side in written
        if word not in ("", *powers)
    ]
    assert sorted(found) == sorted(wanted) and len(found) >= 2
    assert {word for word, *_ in written if word in powers} == set(powers)


def test_labels_can_be_left_out_and_pixels_are_refused():
    with canvas.house_style():
        figure = canvas.new_figure(canvas.CSS)
        axes = canvas.axes_of(figure, canvas.CSS)
        axes.plot([0.0, 1.0], [2.0, 5.0])
        before = svg.inline(figure, "p", "")
        canvas.hide_labels(axes)
        after = svg.inline(figure, "p", "")
        assert before.count("text-anchor:middle") > 3 and after.count("text-anchor:middle") == 0
        assert before.count("text-anchor:end") == after.count("text-anchor:end") > 2
        axes.imshow(np.eye(3))
        with pytest.raises(NotImplementedError):
            svg.inline(figure, "p", "")
