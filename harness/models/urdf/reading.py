"""From a URDF to its tree of bodies.

A planar joint is two prismatic joints and a revolute one in its place: x and y in its plane, then the turn about its axis. The
directions of x and y are those of the joint's frame, after the least rotation that turns its z axis into the joint's axis (half a
turn about x for -z).

Source: http://wiki.ros.org/urdf/XML, ``link`` and ``joint``; for what stands beside links and joints, as
``harness.models.model_file`` says.
"""

from __future__ import annotations

from collections import deque
from fractions import Fraction

from lxml import etree

from harness.files.joint_kinds import JointKind
from harness.files.tree import ORIGIN, WORLD, Body, Given, Inertia, Joint, Placement, Pose, Tree, Turn, vector
from harness.models.source import Source
from harness.models.urdf.beside import Beside, read_beside
from harness.models.urdf.mimics import follow
from harness.models.values import not_negative, not_zero
from harness.models.xml import MAXIMUM_DEPTH, describe, literal_tag

FLOATING_BASE = "floating_base"
KINDS = {
    "revolute": JointKind.HINGE,
    "continuous": JointKind.HINGE,
    "prismatic": JointKind.SLIDE,
    "floating": JointKind.FREE,
    "ball": JointKind.BALL,
    "planar": JointKind.PLANAR,
}
_FIXED = "fixed"
_UNITS = (vector((1, 0, 0)), vector((0, 1, 0)), vector((0, 0, 1)))
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
# Drake's element for a joint of a kind that URDF does not know, and the one kind of those that is read.
_DRAKE_JOINT, _DRAKE_KIND = "drake:joint", "ball"


def read_tree(source: Source, root: etree._Element, gravity: float, floating_base: bool = False) -> Tree:
    """The tree of a URDF, whose format holds no gravity [m/s^2, along -z].

    ``floating_base`` puts a free joint between the world and the root link.

    Raises:
        InvalidModel: what has no meaning, such as a joint without axis, a number that is none, or links that are no tree.
    """
    return _Reader(source, root).tree(gravity, floating_base)


class _Reader:
    """Links and joints of one file by name."""

    def __init__(self, source: Source, root: etree._Element) -> None:
        self._source, self._root = source, root
        self._links = self._named(list(root.iterchildren("link")))
        if not self._links:
            source.refuse(root, "has no link; expected the bodies of a robot")
        joints = [joint for joint in root.iterchildren("*") if literal_tag(joint) in ("joint", _DRAKE_JOINT)]
        self._joints = self._named(joints)
        self._above: dict[str, etree._Element] = {}
        self._below: dict[str, list[str]] = {}
        for joint in joints:
            self._connect(joint)

    def tree(self, gravity: float, floating_base: bool) -> Tree:
        place = self._source.place(self._root)
        beside = read_beside(self._source, self._root, self._links, self._joints)
        bodies: list[Body] = []
        order = self._order()
        for name in order:
            bodies.append(self._body(name, beside, floating_base and name == order[0]))
        down = Given(-gravity, place, "gravity")
        return Tree(follow(self._source, self._joints, bodies), (Fraction(0), Fraction(0), down), beside.springs, place=place)

    def _named(self, elements: list[etree._Element]) -> dict[str, etree._Element]:
        found: dict[str, etree._Element] = {}
        for element in elements:
            name = element.get("name")
            if not name:
                self._source.refuse(element, f"<{literal_tag(element)}> has no name; add one, for it is referred to by name")
            if name in found:
                line = self._source.place(found[name]).line
                self._source.refuse(element, f"{describe(element)} repeats the name of line {line}; give each its own")
            found[name] = element
        return found

    def _connect(self, joint: etree._Element) -> None:
        parent, child = self._link_of(joint, "parent"), self._link_of(joint, "child")
        if child in self._above:
            other = describe(self._above[child])
            self._source.refuse(
                joint, f"{describe(joint)} carries link {child!r}, and so does {other}; expected one joint, for links are a tree"
            )
        self._above[child] = joint
        self._below.setdefault(parent, []).append(child)

    def _link_of(self, joint: etree._Element, tag: str) -> str:
        part = joint.find(tag)
        if part is None:
            self._source.refuse(joint, f"{describe(joint)} has no <{tag}>; add it with the name of a link")
        name = str(part.get("link"))
        # Drake's joints know the world by itself.
        if name not in self._links and not (literal_tag(joint) == _DRAKE_JOINT and name == WORLD):
            self._source.refuse(
                part, f'<{tag} link="{name}"> of {describe(joint)} is no link of this file; correct the name, or add the link'
            )
        return name

    def _order(self) -> list[str]:
        """The links, each behind its parent; raises InvalidModel where they are no tree."""
        roots = [name for name in self._links if name not in self._above or self._link_of(self._above[name], "parent") not in self._links]
        if not roots:
            first = next(iter(self._joints.values()))
            self._source.refuse(first, "every link is the child of a joint, so the joints form a cycle; expected a tree with one root")
        for name in roots[1:]:
            self._source.refuse(
                self._links[name], f"link {name!r} hangs on no joint, nor does {roots[0]!r}; expected one root, join the other to it"
            )
        depth = {roots[0]: 1}
        waiting = deque(roots)
        while waiting:
            name = waiting.popleft()
            if depth[name] > MAXIMUM_DEPTH:
                self._source.refuse(
                    self._links[name], f"link {name!r} is more than {MAXIMUM_DEPTH} joints from the root; no robot needs that"
                )
            for child in self._below.get(name, ()):
                depth[child] = depth[name] + 1
                waiting.append(child)
        for name in self._links:
            if name not in depth:
                joint = self._above[name]
                self._source.refuse(joint, f"{describe(joint)} is part of a cycle that link {roots[0]!r} does not reach; expected a tree")
        return list(depth)

    def _body(self, name: str, beside: Beside, floats: bool) -> Body:
        link, above = self._links[name], self._above.get(name)
        place, inertia = self._source.place(link), self._inertia(link)
        base = (Joint(self._free_name(), JointKind.FREE, place=place),) if floats else ()
        if above is None:
            # The root link is fixed; one called world is the world itself.
            return Body(name, WORLD, (), base, inertia, place)
        joints = (*base, *self._joint(above, beside))
        return Body(name, self._link_of(above, "parent"), self._pose(above), joints, inertia, place)

    def _free_name(self) -> str:
        if FLOATING_BASE in self._joints:
            joint = self._joints[FLOATING_BASE]
            self._source.refuse(joint, f"{describe(joint)} has the name of the joint that a floating base adds; give it another one")
        return FLOATING_BASE

    def _inertia(self, link: etree._Element) -> Inertia | None:
        inertial = self._one(link, "inertial")
        if inertial is None:
            return None
        mass, moments = self._one(inertial, "mass"), self._one(inertial, "inertia")
        if mass is None or moments is None:
            missing = "mass" if mass is None else "inertia"
            self._source.refuse(inertial, f"<inertial> of {describe(link)} has no <{missing}>; add it, or remove the <inertial>")
        values = tuple(self._source.number(moments, name, None) for name in _MOMENTS)
        return Inertia(self._pose(inertial), self._source.number(mass, "value", None), values, self._source.place(inertial))

    def _joint(self, element: etree._Element, beside: Beside) -> tuple[Joint, ...]:
        name, kind = str(element.get("name")), str(element.get("type"))
        if kind == _FIXED:
            return ()
        if kind not in KINDS or (kind == _DRAKE_KIND) != (literal_tag(element) == _DRAKE_JOINT):
            self._source.refuse(
                element,
                f"{describe(element)} is of type {kind!r}; expected one of {', '.join((_FIXED, *list(KINDS)[:4], *list(KINDS)[5:]))}",
            )
        place = self._source.place(element)
        if not KINDS[kind].has_axis:
            return (Joint(name, KINDS[kind], place=place),)
        parts = {tag: self._one(element, tag) for tag in ("axis", "dynamics", "limit")}
        axis = ORIGIN[:0] if parts["axis"] is None else self._source.numbers(parts["axis"], "xyz", (1, 0, 0), not_zero)
        dynamics = parts["dynamics"]
        damping, friction = (
            Fraction(0) if dynamics is None else self._source.number(dynamics, attribute, 0.0, not_negative)
            for attribute in ("damping", "friction")
        )
        single = KINDS[kind].is_single
        joint = Joint(
            name=name,
            kind=KINDS[kind],
            axis=vector(axis or (1, 0, 0)),
            damping=damping if single else Fraction(0),
            friction_loss=friction,
            limits=self._limits(parts["limit"]) if kind in ("revolute", "prismatic") else None,
            place=place,
            **(beside.of_joints.get(name, {}) if single else {}),
        )
        return (joint,)

    def _limits(self, limit: etree._Element | None) -> tuple[Fraction, Fraction] | None:
        """(lower, upper), which are 0 by default; None where the one is not below the other."""
        if limit is None:
            return None
        lower, upper = (self._source.number(limit, attribute, 0.0) for attribute in ("lower", "upper"))
        return (lower, upper) if lower < upper else None

    def _one(self, element: etree._Element, tag: str) -> etree._Element | None:
        """The part of that tag; raises InvalidModel where there are two, of which readers take the one or the other."""
        found = list(element.iterchildren(tag))
        if len(found) > 1:
            self._source.refuse(found[1], f"second <{tag}> in {describe(element)}; expected one, keep the right one")
        return found[0] if found else None

    def _pose(self, element: etree._Element) -> Pose:
        """The ``<origin>`` of an element; its roll, pitch and yaw are about axes that stay."""
        origin = self._one(element, "origin")
        if origin is None:
            return ()
        angles = self._source.numbers(origin, "rpy", (0, 0, 0))
        turns = [Turn(axis, angle) for axis, angle in zip(_UNITS, angles, strict=True) if angle]
        return (Placement(vector(self._source.numbers(origin, "xyz", (0, 0, 0))), tuple(reversed(turns))),)
