"""A figure as SVG, inside an HTML page or in a file of its own."""

from __future__ import annotations

import re
from dataclasses import fields
from html import escape
from typing import Any
from xml.etree import ElementTree

from backdrive.report.pictures.canvas import CSS, content

_VARIABLES = {getattr(CSS, f.name): f"var(--{f.name.replace('_', '-')})" for f in fields(CSS)}
_KEPT = {"path", "g", "text", "tspan", "use", "defs", "clipPath", "rect"}
_FONT = re.compile(r"font(-family|-stretch|-variant|-style)?$")
_DOT = re.compile(r"M(\S+ \S+)L\1(?=M|$)")
_D = re.compile(r' d="([^"]*)"')
_WAY = re.compile("[MLCQz]")
#: Letter of a path as matplotlib writes it -> itself, with places for the points that follow it.
_POINTS = {
    "M": "M%.1f %.1f",
    "L": "L%.1f %.1f",
    "Q": "Q" + " ".join(4 * ["%.1f"]),
    "C": "C" + " ".join(6 * ["%.1f"]),
    "z": "z",
}
_WHOLE, _ZERO = re.compile(r"\.0(?!\d)"), re.compile(r"-0(?![\d.])")
_NUMBER = re.compile(r"-?\d+\.\d+")
_DEFAULTS = {
    ("stroke-linejoin", "miter"),
    ("stroke-linecap", "butt"),
    ("fill-opacity", "1"),
    ("opacity", "1"),
}


def inline(figure: Any, prefix: str, label: str) -> str:
    """Return a figure as an `<svg>` element for an HTML page.

    It contains no address, since HTML needs no namespace. Colours are the page's CSS variables, the font is the page's, and
    text remains text. All identifiers begin with `prefix`, so that one page can contain several figures.

    Args:
        figure: drawn in the theme `canvas.CSS`.
        prefix: unique in the page, an identifier.
        label: what the picture shows, for those who do not see it.
    """
    root = ElementTree.fromstring(content(figure, "svg"))  # our own picture: no entities, no links
    names: dict[str, str] = {}
    body = "".join(_element(child, prefix, names) for child in root)
    return f'<svg viewBox="{escape(root.get("viewBox", ""))}" role="img" aria-label="{escape(label)}">{body}</svg>'


def compact(picture: bytes) -> bytes:
    """Return an SVG file whose paths are as short as those of `inline`, for a notebook that holds it whole."""
    return _D.sub(lambda d: f' d="{_path(d[1])}"', picture.decode()).encode()


def _element(node: ElementTree.Element, prefix: str, names: dict[str, str]) -> str:
    tag = node.tag.rpartition("}")[2] if isinstance(node.tag, str) else ""
    if tag not in _KEPT:
        return ""
    children = "".join(_element(child, prefix, names) for child in node)
    text = escape(node.text) if node.text and node.text.strip() else ""
    attributes = "".join(
        f' {key}="{escape(value)}"' for key, value in _attributes(node, tag, prefix, names) if value
    )
    if tag in {"g", "defs"} and not children:
        return ""
    if tag == "g" and not attributes:
        return children
    if tag == "path" and " d=" not in attributes:
        return ""
    return f"<{tag}{attributes}>{text}{children}</{tag}>"


def _attributes(node: ElementTree.Element, tag: str, prefix: str, names: dict[str, str]):
    for name, value in node.attrib.items():
        key = name.rpartition("}")[2]
        if key == "id":
            if tag not in {"g", "text"}:  # nothing refers to the names of the groups
                yield "id", _rename(value, prefix, names)
        elif key == "href":
            yield key, "#" + _rename(value.lstrip("#"), prefix, names)
        elif key == "clip-path":
            yield key, f"url(#{_rename(value[5:-1], prefix, names)})"
        elif key == "style":
            yield key, _style(value)
        elif key == "d":
            yield key, _path(value)
        elif key == "transform" and value.startswith("rotate(-0 "):
            continue
        else:
            yield key, _NUMBER.sub(_short, value)


def _rename(name: str, prefix: str, names: dict[str, str]) -> str:
    return names.setdefault(name, f"{prefix}-{len(names)}")


def _style(style: str) -> str:
    kept = []
    for item in style.split(";"):
        key, _, value = (part.strip() for part in item.partition(":"))
        if key == "font":  # "10.5px 'DejaVu Sans', ...": the size stays, the face is the page's
            key, value = "font-size", next((w for w in value.split() if w.endswith("px")), "10px")
        elif _FONT.match(key):
            continue
        if key and (key, value) not in _DEFAULTS:
            kept.append(f"{key}:{_VARIABLES.get(value, value)}")
    return ";".join(kept)


def _path(d: str) -> str:
    """Shorten a path: a tenth of a point is finer than any screen, and `h0` is a stroke without length."""
    numbers = tuple(map(float, _WAY.sub(" ", d).split()))
    short = "".join(map(_POINTS.__getitem__, _WAY.findall(d))) % numbers  # all at once: there are many
    short = _ZERO.sub("0", _WHOLE.sub("", short))
    return _DOT.sub(r"M\1h0", short) if "L" in short else short


def _short(match: re.Match[str]) -> str:
    text = f"{float(match.group()):.1f}".removesuffix(".0")
    return "0" if text == "-0" else text
