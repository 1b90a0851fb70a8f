"""What an MJCF says besides the equations of motion of its tree.

Source: MuJoCo documentation, XML reference.
"""

from __future__ import annotations

from lxml import etree

from harness.robots.findings import LeftOut
from harness.robots.source import Source


def left_out(source: Source, root: etree._Element) -> tuple[LeftOut, ...]:
    """What is left out, what bears on the motion first."""
    found: dict[tuple[str, bool], list[etree._Element]] = {}
    return tuple(LeftOut(what, source.lines(elements), bears) for (what, bears), elements in found.items())
