"""Markup that others made, as far as it is known to be harmless: equations, drawings, and drawings as thumbnails.

Pages allow no style of an element's own, so the colours of a drawing become classes, which ``tints`` defines.
"""

from __future__ import annotations

import re
from html.entities import html5
from xml.etree import ElementTree

from markupsafe import Markup

from harness.report.figures import COLOURS

_MATHML = {
    "math", "mrow", "mi", "mn", "mo", "mtext", "mspace", "mfrac", "msqrt", "mroot", "mstyle", "mpadded", "mphantom",
    "msub", "msup", "msubsup", "munder", "mover", "munderover", "mtable", "mtr", "mtd",
}  # fmt: skip
_MATHML_ATTRIBUTES = {
    "display", "mathvariant", "accent", "stretchy", "columnalign", "columnspacing", "rowspacing", "linethickness",
}  # fmt: skip
_SVG = {"svg", "title", "path", "circle", "text"}
_SVG_ATTRIBUTES = {"class", "viewBox", "role", "d", "cx", "cy", "r", "x", "y", "text-anchor", "style"}
_COLOUR = re.compile("(fill|stroke):(#[0-9a-f]{6})")
# Classes of a drawing that a thumbnail leaves out: what nobody can read in it, and the shadow of another configuration.
_SMALL = {"shadow", "axes", "gravity", "sense", "scale", "centre", "quarters"}
_MARGIN = 14.0


def equations(markup: str) -> Markup | None:
    """``markup`` where it is well-formed presentation MathML and nothing else, otherwise None.

    Attributes that MathML Core does not need are dropped. Entities are replaced by their characters,
    since XML knows only five.
    """
    known = {name for name in html5 if name.endswith(";")} - {"amp;", "lt;", "gt;", "quot;", "apos;"}
    text = re.sub(r"&(\w+;)", lambda match: html5[match[1]] if match[1] in known else match[0], markup)
    return _written(_pure(text, "math", _MATHML, _MATHML_ATTRIBUTES))


def picture(markup: str) -> Markup | None:
    """``markup`` where it is a drawing as ``harness show`` makes them and nothing else, otherwise None."""
    return _written(_drawing(markup))


def thumbnail(markup: str) -> Markup:
    """A drawing without words and small parts, cut to what is left of it; "" where there is none."""
    root = _drawing(markup)
    if root is None:
        return Markup()
    svg = root[0]
    for part in list(svg):
        if part.tag not in ("path", "circle") or _SMALL & {*part.get("class", "").split()}:
            svg.remove(part)
        part[:] = []
    places = [place for part in svg for place in _places(part)]
    if not places:
        return Markup()
    (left, right), (top, bottom) = ((min(axis) - _MARGIN, max(axis) + _MARGIN) for axis in zip(*places, strict=True))
    box = f"{left:g} {top:g} {right - left:g} {bottom - top:g}"
    svg.attrib = {"class": "mechanism thumbnail", "viewBox": box, "aria-hidden": "true"}
    return _written(svg) or Markup()


def tint(colour: str) -> str:
    """The class of one of the colours."""
    return f"tint-{COLOURS.index(colour)}"


def tints() -> str:
    """The classes of colours, as a style sheet."""
    return "".join(f".{tint(colour)} {{ --tint: {colour}; }}\n" for colour in COLOURS)


def _drawing(markup: str) -> ElementTree.Element | None:
    root = _pure(markup, "svg", _SVG, _SVG_ATTRIBUTES)
    for element in () if root is None else root.iter():
        match = _COLOUR.fullmatch(element.attrib.pop("style", ""))
        if match and match[2] in COLOURS:
            element.set("class", f"{element.get('class', '')} {match[1]} {tint(match[2])}".strip())
    return root


def _places(part: ElementTree.Element) -> list[tuple[float, float]]:
    """The points of a path of straight lines, or of a circle."""
    numbers = [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", part.get("d", f"{part.get('cx', 0)} {part.get('cy', 0)}"))]
    return list(zip(numbers[::2], numbers[1::2], strict=False))


def _pure(markup: str, outer: str, tags: set[str], attributes: set[str]) -> ElementTree.Element | None:
    """``markup`` in a ``<div>`` where it is ``outer`` elements that hold ``tags`` alone, without other attributes; else None."""
    try:
        root = ElementTree.fromstring(f"<div>{markup}</div>")
    except ElementTree.ParseError:
        return None
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        if element is not root and element.tag not in tags:
            return None
        element.attrib = {name: value for name, value in element.attrib.items() if name in attributes}
    return root if len(root) and all(child.tag == outer for child in root) else None


def _written(root: ElementTree.Element | None) -> Markup | None:
    return None if root is None else Markup(ElementTree.tostring(root, encoding="unicode", short_empty_elements=False))
