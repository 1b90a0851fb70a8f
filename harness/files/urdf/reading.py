"""From a URDF to its tree of bodies.

A planar joint is two prismatic joints and a revolute one in its place: x and y in its plane, then the turn about its axis. The
directions of x and y are those of the joint's frame, after the least rotation that turns its z axis into the joint's axis (half a
turn about x for -z).

Source: http://wiki.ros.org/urdf/XML, ``link`` and ``joint``; for what stands beside links and joints, as
``harness.files.model_file`` says.
"""

from __future__ import annotations

from collections import deque
from fractions import Fraction

from lxml import etree

from harness.files.document.source import Source, children, not_negative, not_zero
from harness.files.document.xml import MAXIMUM_DEPTH, describe, literal_tag
from harness.files.equalities import Equality
from harness.files.given import Given, Placement, Pose, Turn, vector
from harness.files.joint_kinds import JointKind
from harness.files.tree import WORLD, Body, Inertia, Joint, Tree
from harness.files.urdf.beside import Beside
from harness.files.urdf.kinds import DRAKE_JOINT, JOINT_TAGS, LIMITED, kind_of, needs_axis

FLOATING_BASE = "floating_base"
# What is left out of a robot's file.
DAMPING_OF_SEVERAL = "damping of joints of several degrees of freedom"
_UNITS = (vector((1, 0, 0)), vector((0, 1, 0)), vector((0, 0, 1)))
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


class UrdfReader:
    """Links and joints of one file by name.

    Raises:
        InvalidModel: what has no meaning, such as a joint without axis, a number that is none, or links that are no tree.
    """

    def __init__(self, source: Source) -> None:
        self._source, root = source, source.root
        self._links = source.document.by_name(root.iterchildren("link"))
        # Of the joint that a floating base adds, which is none of the file.
        self.floating_base = ""
        if not self._links:
            source.refuse(root, "has no link; expected the bodies of a robot")
        joints = list(children(root, *JOINT_TAGS))
        self._joints = source.document.by_name(joints)
        self._kinds = {str(joint.get("name")): kind_of(source, joint) for joint in joints}
        # The joint that carries a link, with the parent of that.
        self._above: dict[str, tuple[etree._Element, str]] = {}
        self._below: dict[str, list[str]] = {}
        for joint in joints:
            parent, child = self._link_of(joint, "parent"), self._link_of(joint, "child")
            if child in self._above:
                found = f"carries link {child!r}, and so does {describe(self._above[child][0])}"
                source.refuse(joint, f"{describe(joint)} {found}; expected one joint, for links are a tree")
            self._above[child] = joint, parent
            self._below.setdefault(parent, []).append(child)

    def read(self, gravity: float, floating_base: bool) -> tuple[Tree, tuple[Equality, ...]]:
        """The tree of the file, whose format holds no gravity [m/s^2, along -z], and what it ties beside its joints.

        ``floating_base`` puts a free joint between the world and the root link.
        """
        source, place = self._source, self._source.place(self._source.root)
        order = self._order()
        if floating_base:
            self._refuse_floating(order[0])
            names = (FLOATING_BASE, *(f"{FLOATING_BASE}_{number}" for number in range(2, len(self._joints) + 3)))
            self.floating_base = next(name for name in names if name not in self._joints)
        beside = Beside(source, self._links, self._joints, self._kinds)
        bodies = tuple(self._body(name, beside, floating_base and name == order[0]) for name in order)
        down = Fraction(0), Fraction(0), Given(-gravity, place, "gravity")
        return Tree(bodies, down, beside.springs, place=place), beside.equalities()

    def _refuse_floating(self, root: str) -> None:
        """Refuse a floating base where links without mass, each with one joint, lead from the root to a free joint."""
        link = root
        while self._links[link].find("inertial") is None and len(self._below.get(link, ())) == 1:
            (link,) = self._below[link]
            joint = self._above[link][0]
            if (kind := self._kinds[str(joint.get("name"))]) == JointKind.FREE:
                self._source.refuse(joint, f"{describe(joint)} lets the robot float already; leave the floating base out")
            if kind is not None:
                return

    def _link_of(self, joint: etree._Element, tag: str) -> str:
        part = joint.find(tag)
        if part is None:
            self._source.refuse(joint, f"{describe(joint)} has no <{tag}>; add it with the name of a link")
        # Drake's joints know the world by itself.
        if literal_tag(joint) == DRAKE_JOINT and part.get("link") == WORLD:
            return WORLD
        return self._source.resolve(part, "link", self._links)

    def _order(self) -> list[str]:
        """The links, each behind its parent; raises InvalidModel where they are no tree."""
        source, links = self._source, self._links
        roots = [name for name in links if name not in self._above or self._above[name][1] not in links]
        if not roots:
            first = next(iter(self._joints.values()))
            source.refuse(first, "every link is the child of a joint, so the joints form a cycle; expected a tree with one root")
        for name in roots[1:]:
            found = f"link {name!r} hangs on no joint, nor does {roots[0]!r}"
            source.refuse(links[name], f"{found}; expected one root, join the other to it")
        depth = {roots[0]: 1}
        waiting = deque(roots)
        while waiting:
            name = waiting.popleft()
            if depth[name] > MAXIMUM_DEPTH:
                source.refuse(links[name], f"link {name!r} is more than {MAXIMUM_DEPTH} joints from the root; no robot needs that")
            for child in self._below.get(name, ()):
                depth[child] = depth[name] + 1
                waiting.append(child)
        for name in links:
            if name not in depth:
                found = f"{describe(self._above[name][0])} is part of a cycle that link {roots[0]!r} does not reach"
                source.refuse(self._above[name][0], f"{found}; expected a tree")
        return list(depth)

    def _body(self, name: str, beside: Beside, floats: bool) -> Body:
        link = self._links[name]
        place, inertia, base = self._source.place(link), self._inertia(link), tuple[Joint, ...]()
        if floats:
            base = (Joint(self.floating_base, JointKind.FREE, place=place),)
        if name not in self._above:
            # The root link is fixed; one called world is the world itself.
            return Body(name, WORLD, (), base, inertia, place)
        above, parent = self._above[name]
        joints = (*base, *map(beside.following, self._joint(above, beside)))
        return Body(name, parent, self._pose(above), joints, inertia, place)

    def _inertia(self, link: etree._Element) -> Inertia | None:
        inertial = self._source.one(link, "inertial")
        if inertial is None:
            return None
        mass, moments = self._source.one(inertial, "mass"), self._source.one(inertial, "inertia")
        if mass is None or moments is None:
            missing = "mass" if mass is None else "inertia"
            self._source.refuse(inertial, f"<inertial> of {describe(link)} has no <{missing}>; add it, or remove the <inertial>")
        values = tuple(self._source.number(moments, name, None) for name in _MOMENTS)
        return Inertia(self._pose(inertial), self._source.number(mass, "value", None), values, self._source.place(inertial))

    def _joint(self, element: etree._Element, beside: Beside) -> tuple[Joint, ...]:
        name, source = str(element.get("name")), self._source
        kind, place = self._kinds[name], source.place(element)
        if kind is None:
            return ()
        axis, dynamics, limit = (source.one(element, tag) for tag in ("axis", "dynamics", "limit"))
        damping, friction = (
            Fraction(0) if dynamics is None else source.number(dynamics, attribute, 0.0, not_negative)
            for attribute in ("damping", "friction")
        )
        if damping and not kind.is_single:
            source.pass_over(dynamics, needs_axis(element, "a damper"), DAMPING_OF_SEVERAL)
        if not kind.has_axis:
            return (Joint(name, kind, place=place),)
        joint = Joint(
            name=name,
            kind=kind,
            axis=_UNITS[0] if axis is None else vector(source.numbers(axis, "xyz", (1, 0, 0), not_zero)),
            damping=damping if kind.is_single else Fraction(0),
            friction_loss=friction,
            limits=self._limits(limit) if element.get("type") in LIMITED else None,
            place=place,
            **(beside.of_joints.get(name, {}) if kind.is_single else {}),
        )
        return (joint,)

    def _limits(self, limit: etree._Element | None) -> tuple[Fraction, Fraction] | None:
        """(lower, upper), which are 0 by default; None where the one is not below the other."""
        if limit is None:
            return None
        lower, upper = (self._source.number(limit, attribute, 0.0) for attribute in ("lower", "upper"))
        return (lower, upper) if lower < upper else None

    def _pose(self, element: etree._Element) -> Pose:
        """The ``<origin>`` of an element; its roll, pitch and yaw are about axes that stay."""
        origin = self._source.one(element, "origin")
        if origin is None:
            return ()
        angles = self._source.numbers(origin, "rpy", (0, 0, 0))
        turns = [Turn(axis, angle) for axis, angle in zip(_UNITS, angles, strict=True) if angle]
        return (Placement(vector(self._source.numbers(origin, "xyz", (0, 0, 0))), tuple(reversed(turns))),)
