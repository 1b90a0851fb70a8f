"""The springs and dampers of tendons that run straight from one site to another.

Source: MuJoCo documentation, XML reference, ``tendon/spatial``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from lxml import etree

from harness.models.mjcf_defaults import writings
from harness.models.xml import describe
from harness.robots.mjcf_numbers import Attributes
from harness.robots.source import Source
from harness.robots.tree import Pose, Spring


def springs(source: Source, root: etree._Element, attributes: Attributes, name: Callable[[etree._Element], str]) -> Iterator[Spring]:
    """The springs of a file; ``name`` gives the name of a body.

    Raises:
        InvalidModel: a tendon whose stiffness or damping acts on another path, or whose length is left to the reader.
    """
    sites = {site.get("name"): site for world in root.iterchildren("worldbody") for site in world.iter("site")}
    for tendon in tendons(root):
        stiffness, damping = (attributes.coefficient(tendon, *of) for of in (("stiffness", "spring"), ("damping", "damper")))
        if any(attributes.numbers(tendon, "armature", (0,))):
            source.refuse(tendon, f"{describe(tendon)} has armature, an inertia in a tendon, which is not read; remove it")
        if not stiffness and not damping:
            continue
        path = [*tendon.iterchildren("*")]
        if tendon.tag != "spatial" or [part.tag for part in path] != ["site", "site"]:
            source.refuse(
                tendon, f"{describe(tendon)} has a spring or damper and does not run straight from one site to another, which is not read"
            )
        ends = []
        for part in path:
            site = sites.get(part.get("site"))
            if site is None:
                source.refuse(part, f'<site site="{part.get("site")}"> names no site of this file; correct the name')
            pose: Pose = attributes.pose(site)
            ends.append((name(next(site.iterancestors("body", "worldbody"))), pose))
        lengths = attributes.numbers(tendon, "springlength", (-1, -1))
        if len([*writings(tendon, "springlength")]) and lengths[1] == -1:
            lengths = (lengths[0], lengths[0])
        if stiffness and min(lengths) < 0:
            source.refuse(tendon, f"{describe(tendon)} leaves its springlength to the reader; write it")
        if stiffness and lengths[0] != lengths[1]:
            source.refuse(tendon, f"{describe(tendon)} is slack between two lengths, which is not read; write one springlength")
        yield Spring((ends[0], ends[1]), max(lengths[0], 0 * lengths[0]), stiffness, damping, source.place(tendon))


def tendons(root: etree._Element) -> Iterator[etree._Element]:
    """The tendons of a file."""
    for section in root.iterchildren("tendon"):
        yield from section.iterchildren("*")
