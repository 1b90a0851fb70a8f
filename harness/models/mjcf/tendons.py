"""The springs and dampers of tendons: those that run straight from one site to another, and those on sums of joint positions.

Source: MuJoCo documentation, XML reference, ``tendon/spatial`` and ``tendon/fixed``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

from lxml import etree

from harness.files.tree import Coupling, Given, Joint, Pose, Spring
from harness.models.mjcf.defaults import resolved
from harness.models.mjcf.numbers import Attributes
from harness.models.source import Source
from harness.models.xml import describe


def read_tendons(
    source: Source, root: etree._Element, attributes: Attributes, name: Callable[[etree._Element], str], joints: Mapping[str, Joint]
) -> tuple[tuple[Spring, ...], tuple[Coupling, ...]]:
    """The springs and dampers of a file's tendons; ``name`` gives the name of a body, ``joints`` are those of the file by name.

    Raises:
        InvalidModel: a spring or damper on another path, or between two lengths, and what speaks of nothing in the file.
    """
    sites = {str(site.get("name")): site for world in root.iterchildren("worldbody") for site in world.iter("site")}
    springs: list[Spring] = []
    couplings: list[Coupling] = []
    for tendon in tendons(root):
        stiffness, damping = (attributes.coefficient(tendon, *of) for of in (("stiffness", "spring"), ("damping", "damper")))
        if attributes.number(tendon, "armature", 0.0):
            source.refuse(tendon, f"{describe(tendon)} has armature, an inertia in a tendon, which is not read; remove it")
        if not stiffness and not damping:
            continue
        rest = _rest(source, attributes, tendon) if stiffness else Fraction(0)
        if tendon.tag == "fixed":
            terms = tuple(_terms(source, tendon, joints))
            couplings.append(Coupling(terms, stiffness, damping, rest, source.place(tendon)))
            continue
        if rest is None:
            source.refuse(tendon, f"{describe(tendon)} leaves its springlength to the reader; write it")
        first, second = _ends(source, attributes, tendon, sites, name)
        springs.append(Spring((first, second), rest, stiffness, damping, source.place(tendon)))
    return tuple(springs), tuple(couplings)


def tendons(root: etree._Element) -> Iterator[etree._Element]:
    """The tendons of a file."""
    for section in root.iterchildren("tendon"):
        yield from section.iterchildren("*")


def _rest(source: Source, attributes: Attributes, tendon: etree._Element) -> Fraction | None:
    """The length of a tendon's spring at rest; None for that where the joints' springs are."""
    lower, upper = attributes.numbers(tendon, "springlength", (-1, -1))
    written = resolved(tendon, "springlength")
    if written is not None and len(written.text.split()) == 1:
        upper = lower
    if lower != upper:
        source.refuse(tendon, f"{describe(tendon)} is slack between two lengths, which is not read; write one springlength")
    return None if lower < 0 else lower


def _terms(source: Source, tendon: etree._Element, joints: Mapping[str, Joint]) -> Iterator[tuple[str, Given]]:
    for part in tendon.iterchildren("joint"):
        name = str(part.get("joint"))
        if name not in joints or not joints[name].kind.is_single:
            source.refuse(part, f'<joint joint="{name}"> names no hinge or slide of this file; correct the name')
        yield name, source.number(part, "coef", None)


def _ends(
    source: Source,
    attributes: Attributes,
    tendon: etree._Element,
    sites: Mapping[str, etree._Element],
    name: Callable[[etree._Element], str],
) -> list[tuple[str, Pose]]:
    """Body and place of either end of a tendon."""
    path = [*tendon.iterchildren("*")]
    if [part.tag for part in path] != ["site", "site"]:
        problem = "has a spring or damper and does not run straight from one site to another, which is not read"
        source.refuse(tendon, f"{describe(tendon)} {problem}")
    ends = []
    for part in path:
        site = sites.get(str(part.get("site")))
        if site is None:
            source.refuse(part, f'<site site="{part.get("site")}"> names no site of this file; correct the name')
        ends.append((name(next(site.iterancestors("body", "worldbody"))), attributes.pose(site)))
    return ends
