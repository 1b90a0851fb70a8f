"""The springs and dampers of tendons: those that run straight from one site to another, and those on sums of joint positions.

Source: MuJoCo documentation, XML reference, ``tendon/spatial`` and ``tendon/fixed``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

from lxml import etree

from harness.files.document.source import Elements, Source
from harness.files.document.xml import describe
from harness.files.findings import Unread
from harness.files.mjcf.defaults import resolved
from harness.files.mjcf.numbers import Attributes
from harness.files.tree import Coupling, Given, Joint, Pose, Spring


def read_tendons(
    source: Source, root: etree._Element, attributes: Attributes, name: Callable[[etree._Element], str], joints: Mapping[str, Joint]
) -> tuple[tuple[Spring, ...], tuple[Coupling, ...]]:
    """The springs and dampers of a file's tendons; ``name`` gives the name of a body, ``joints`` are those of the file by name.

    Raises:
        InvalidModel: one speaks of nothing in the file. A spring or damper on another path, or between two lengths, is left unread.
    """
    sites = {str(site.get("name")): site for world in root.iterchildren("worldbody") for site in world.iter("site")}
    springs: list[Spring] = []
    couplings: list[Coupling] = []
    for tendon in tendons(root):
        if armature := attributes.number(tendon, "armature", 0.0):
            attributes.leave_unread(tendon, "armature", armature, "is an inertia in a tendon", "remove it")
            continue
        stiffness, damping = (attributes.coefficient(tendon, *of) for of in (("stiffness", "spring"), ("damping", "damper")))
        if not stiffness and not damping:
            continue
        lower, upper = _rest(attributes, tendon) if stiffness else (Fraction(0), Fraction(0))
        path, place = list(tendon.iterchildren("*")), source.place(tendon)
        if lower != upper:
            source.unread.append(Unread(place, f"{describe(tendon)} is slack between two lengths", "write one springlength"))
        elif tendon.tag == "fixed":
            terms = tuple(_terms(source, tendon, joints))
            couplings.append(Coupling(terms, stiffness, damping, None if lower < 0 else lower, place))
        elif [part.tag for part in path] != ["site", "site"]:
            what = f"{describe(tendon)} does not run straight from one site to another"
            source.unread.append(Unread(place, what, "lead it through two sites"))
        elif lower < 0:
            source.unread.append(Unread(place, f"{describe(tendon)} leaves its springlength to the reader", "write it"))
        else:
            first, second = (_end(source, attributes, part, sites, name) for part in path)
            springs.append(Spring((first, second), lower, stiffness, damping, place))
    return tuple(springs), tuple(couplings)


def tendons(root: etree._Element) -> Iterator[etree._Element]:
    """The tendons of a file."""
    for section in root.iterchildren("tendon"):
        yield from section.iterchildren("*")


def _rest(attributes: Attributes, tendon: etree._Element) -> tuple[Given, Given]:
    """The two lengths between which a tendon's spring is at rest; negative where those of the joints' springs are."""
    lower, upper = attributes.numbers(tendon, "springlength", (-1, -1))
    written = resolved(tendon, "springlength")
    return (lower, lower) if written is not None and len(written.text.split()) == 1 else (lower, upper)


def _terms(source: Source, tendon: etree._Element, joints: Mapping[str, Joint]) -> Iterator[tuple[str, Given]]:
    for part in tendon.iterchildren("joint"):
        name = str(part.get("joint"))
        if name not in joints or not joints[name].kind.is_single:
            source.refuse(part, f'<joint joint="{name}"> names no hinge or slide of this file; correct the name')
        yield name, source.number(part, "coef", None)


def _end(
    source: Source, attributes: Attributes, part: etree._Element, sites: Elements, name: Callable[[etree._Element], str]
) -> tuple[str, Pose]:
    """Body and place of one end of a tendon."""
    site = sites[source.resolve(part, "site", sites)]
    return name(next(site.iterancestors("body", "worldbody"))), attributes.pose(site)
