"""From a USD stage to its tree of bodies.

Bodies are prims with ``PhysicsRigidBodyAPI``, and their frames are those of the prims. Where every joint stands at zero, the frames of a
joint in its two bodies are one: that places the bodies, wherever their prims stand. A joint without one of its bodies, or with a prim that
is in no body, hangs on the world. Joints that close a loop, and those that are excluded from articulations, tie the tree; a body that no
joint leads to from the world floats, and so does all that hangs on it. The root of what floats is the body with
``PhysicsArticulationRootAPI``, else one that no joint has for its second.

Several joints of one pair of bodies add their degrees of freedom where ``newton:jointsAddMobility`` says so above them, or where all are
joints of MuJoCo's schema; elsewhere they would constrain one another.

Source: OpenUSD documentation, UsdPhysics; newton-usd-schemas, NewtonArticulationRootAPI.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import Any

from harness.errors import InvalidModel
from harness.files.document.source import Unread
from harness.files.document.stage import Prim, UsdDocument, applied
from harness.files.document.xml import Document
from harness.files.equalities import Equality
from harness.files.findings import LeftOut
from harness.files.given import ORIGIN, Given, Placement, Pose
from harness.files.joint_kinds import JointKind
from harness.files.left_out import Declared
from harness.files.tree import WORLD, Actuator, Body, Bounds, Coupling, ForceLimits, Joint, Spring, SpringDampers, Tree
from harness.files.usd import ROOTS
from harness.files.usd.actuators import MUJOCO, actuator_of, drives_of, limited
from harness.files.usd.beside import BesideTree
from harness.files.usd.frames import Frames, joint_frame, reversed_placement
from harness.files.usd.joints import JOINTS, JointReader
from harness.files.usd.masses import BODY, Masses, gravity_of, gravity_share
from harness.files.usd.tendons import TENDON, spring_of, terms_of

FLOATING_BASE = "floating_base"
# By the field of a joint, MuJoCo's flag that switches it off.
_FLAGS = (("stiffness", "spring"), ("damping", "damper"))
_SCENE = "PhysicsScene"


@dataclass(frozen=True)
class _Link:
    """A joint prim between two bodies, paths of which "" is the world, with its frame in each."""

    prim: Prim
    bodies: tuple[str, str]
    ends: tuple[Pose, Pose]

    def other(self, body: str) -> str:
        return self.bodies[self.bodies[0] == body]


@dataclass
class _Found:
    """The parts of the tree while it grows; ``moving``: names of joints by path."""

    bodies: list[Body] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    moving: dict[str, str] = field(default_factory=dict)
    placed: dict[str, str] = field(default_factory=lambda: {"": WORLD})
    moves: dict[str, bool] = field(default_factory=lambda: {"": False})


@dataclass(frozen=True)
class StageMeaning:
    """The parts of ``Meaning`` that a stage gives."""

    tree: Tree
    equalities: tuple[Equality, ...]
    left_out: tuple[LeftOut, ...]
    declared: tuple[Declared, ...]
    actuators: tuple[Actuator, ...]
    force_limits: ForceLimits
    spring_dampers: SpringDampers
    unread: tuple[Unread, ...]


class StageReader:
    """Reads one stage.

    Raises:
        InvalidModel: from all that reads, at the line of what has no meaning.
    """

    def __init__(self, document: UsdDocument) -> None:
        self._document, self._path = document, document.path
        self._prims = {prim.path: prim for prim in document.prims}
        self._scenes = [prim for prim in document.prims if prim.kind == _SCENE]
        self._frames, bodies = Frames(document), [prim for prim in document.prims if BODY in prim.schemas]
        self._bodies = {prim.path: prim for prim in bodies if prim.is_on("physics:rigidBodyEnabled")}
        if not self._bodies:
            raise InvalidModel(document.path, None, "has no prim with PhysicsRigidBodyAPI that is enabled; expected the bodies of a robot")
        in_degrees = next((one.word("mjc:compiler:angle") for one in self._scenes if one.word("mjc:compiler:angle")), "degree") == "degree"
        self._joints, self._masses = JointReader(self._frames.units, in_degrees), Masses(document, self._frames)
        prims = [prim for prim in document.prims if prim.kind in JOINTS and prim.is_on("physics:jointEnabled")]
        self._links = [self._link(prim) for prim in prims]
        # A body and a joint may have one name.
        self._names = _names(self._bodies.values()) | _names(prims)

    def read(self) -> StageMeaning:
        """The tree, and what stands beside it."""
        found, scene = self._tree(), next(iter(self._scenes), None)
        joints = {joint.name: joint for body in found.bodies for joint in body.joints}
        kinds = {name: joint.kind for name, joint in joints.items()}
        loops = [link for link in self._links if link.prim.path not in found.used]
        equalities = [
            self._joints.equality(link.prim, (found.placed[link.bodies[0]], found.placed[link.bodies[1]]), link.ends) for link in loops
        ]
        moving = {path: self._prims[path] for path in found.moving}
        for prim in moving.values():
            equalities += self._joints.mimics(prim, found.moving, kinds)
        actuators = [own for path, name in found.moving.items() for own in drives_of(moving[path], joints[name], self._frames.units)]
        driven = {path: ((name, Fraction(1)),) for path, name in found.moving.items() if kinds[name].is_single}
        tendons = [prim for prim in self._document.prims if prim.kind == TENDON]
        fixed = {prim.path: terms_of(prim, found.moving) for prim in tendons if prim.word("mjc:type") == "fixed"}
        actuators += [actuator_of(prim, driven | fixed) for prim in self._document.prims if prim.kind == MUJOCO]
        springs = [spring_of(prim, found.moving, self._prims, partial(self._placed, found)) for prim in tendons]
        actuators = [replace(one, number=number) for number, one in enumerate(actuators)]
        beside = BesideTree(self._path, self._prims, self._names, found.bodies, list(moving.values()), equalities, actuators, self._joints)
        ranges = ((name, limited(moving[path], "mjc:actuatorfrclimited", "mjc:actuatorfrcrange")) for path, name in found.moving.items())
        return StageMeaning(
            tree=replace(
                _whole(scene, found.bodies, springs),
                gravity=gravity_of(self._scenes, self._document, self._frames),
                place=self._document.prims[0].place,
            ),
            equalities=tuple(equalities),
            left_out=beside.left_out(),
            declared=tuple(beside.declared()),
            actuators=tuple(actuators),
            force_limits=tuple((name, bounds) for name, bounds in ranges if bounds is not None),
            spring_dampers=_spring_dampers(scene, {name: moving[path] for path, name in found.moving.items()}),
            unread=tuple(one for one in springs if isinstance(one, Unread)),
        )

    def _placed(self, found: _Found, prim: Prim) -> tuple[str, Pose]:
        """The body of a prim, and its frame there."""
        holder = next((one for one in applied(self._prims, prim.path, BODY) if one.path in self._bodies), None)
        body = "" if holder is None else holder.path
        return found.placed[body], self._frames.between(body, prim.path)

    # Bodies and joints.

    def _link(self, prim: Prim) -> _Link:
        sides = [self._end(prim, side) for side in (0, 1)]
        (first, one), (second, other) = sides
        if first == second:
            what = f"body <{first}>" if first else "the world"
            prim.refuse(f"joins {what} to itself; name two bodies in physics:body0 and physics:body1", "physics:body1")
        return _Link(prim, (first, second), (one, other))

    def _end(self, prim: Prim, side: int) -> tuple[str, Pose]:
        """The body of one side, "" for the world, and the joint's frame in it."""
        name = f"physics:body{side}"
        targets, own = prim.words(name), joint_frame(prim, side, self._frames.units)
        placed = (own,) if any(own.position) or own.rotation else ()
        if not targets:
            return "", placed
        if len(targets) > 1 or targets[0] not in self._prims:
            found = " and ".join(f"<{one}>" for one in targets)
            prim.refuse(f"{name} names {found}; expected one prim of this stage", name)
        holder = next((one for one in applied(self._prims, targets[0], BODY) if one.path in self._bodies), None)
        body = "" if holder is None else holder.path
        return body, (*self._frames.between(body, targets[0]), *placed)

    def _tree(self) -> _Found:
        found = _Found()
        still = [path for path, prim in self._bodies.items() if prim.is_on("physics:kinematicEnabled", False)]
        for path in still:
            self._add(
                found, path, Body(self._names[path], WORLD, self._frames.between("", path), (), None, self._bodies[path].place), False
            )
        self._grow(found, ["", *still])
        number = 1
        for path in self._bodies:
            if path in found.placed:
                continue
            root = self._root(path)
            name = FLOATING_BASE if number == 1 else f"{FLOATING_BASE}_{number}"
            number += 1
            place = self._bodies[root].place
            base = Joint(name, JointKind.FREE, place=place)
            start = self._frames.between("", root)
            self._add(found, root, Body(self._names[root], WORLD, (), (base,), None, place, start=start), True)
            self._grow(found, [root])
        return found

    def _root(self, path: str) -> str:
        """The body on which all hangs that joints connect with one."""
        together, waiting = {path}, deque([path])
        tying = [link for link in self._links if not link.prim.is_on("physics:excludeFromArticulation", False)]
        while waiting:
            one = waiting.popleft()
            for link in tying:
                if one in link.bodies and (other := link.other(one)) not in together:
                    together.add(other)
                    waiting.append(other)
        roots = [one for one in self._bodies if one in together and not ROOTS.isdisjoint(self._bodies[one].schemas)]
        seconds = {link.bodies[1] for link in tying}
        firsts = [one for one in self._bodies if one in together and one not in seconds]
        return next(iter([*roots, *firsts, path]))

    def _add(self, found: _Found, path: str, body: Body, moves: bool) -> None:
        prim = self._bodies[path]
        # Raises where a scale above the body, or its own, is one by which its numbers would have to be taken.
        self._frames.between("", path)
        share = gravity_share(prim)
        whole = self._masses.of_body(prim, replace(body, gravity_compensation=share) if share else body, moves)
        found.bodies.append(whole)
        found.placed[path], found.moves[path] = body.name, moves

    def _grow(self, found: _Found, starts: Iterable[str]) -> None:
        """Hang on bodies what joints lead to."""
        by_body: dict[str, list[_Link]] = {}
        for link in self._links:
            if not link.prim.is_on("physics:excludeFromArticulation", False):
                for one in link.bodies:
                    by_body.setdefault(one, []).append(link)
        waiting = deque(starts)
        while waiting:
            body = waiting.popleft()
            groups: dict[str, list[_Link]] = {}
            for link in by_body.get(body, ()):
                groups.setdefault(link.other(body), []).append(link)
            for other, links in groups.items():
                if other not in found.placed:
                    self._hang(found, body, other, links)
                    waiting.append(other)

    def _hang(self, found: _Found, body: str, other: str, links: list[_Link]) -> None:
        """Hang a body on another by their joints, of which the first is the nearest to the one that is there."""
        if len(links) > 1 and not self._add_mobility(links):
            _refuse_constrained(links)
        joints: list[Joint] = []
        for link in links:
            is_reversed = link.bodies[0] == other
            joint = self._joints.joint(link.prim, self._names[link.prim.path], link.ends[not is_reversed], is_reversed)
            found.used.add(link.prim.path)
            if joint is not None:
                joints.append(joint)
                found.moving[link.prim.path] = joint.name
        first = links[0]
        is_reversed = first.bodies[0] == other
        near, far = first.ends[is_reversed], first.ends[not is_reversed]
        back = tuple(part for placement in reversed(far) for part in _inverted(placement))
        place = self._bodies[other].place
        moves = found.moves[body] or bool(joints)
        self._add(found, other, Body(self._names[other], found.placed[body], (*near, *back), tuple(joints), None, place), moves)

    def _add_mobility(self, links: list[_Link]) -> bool:
        roots = [one for link in links for body in link.bodies for name in ROOTS for one in applied(self._prims, body, name)]
        return any(one.is_on("newton:jointsAddMobility", False) for one in roots) or all(
            "MjcJointAPI" in link.prim.schemas for link in links
        )


def meaning_of_stage(document: Document) -> StageMeaning:
    """The meaning of a document that ``harness.files.document.stage`` has read; raises InvalidModel as ``StageReader``."""
    assert isinstance(document, UsdDocument)
    return StageReader(document).read()


def _whole(scene: Prim | None, bodies: Iterable[Body], springs: Iterable[object]) -> Tree:
    """The tree without gravity; MuJoCo's options of a scene switch springs and dampers off, and bound inertias."""
    names = ("boundMass", "boundInertia", "setTotalMass")
    mass, moment, total = ((None if scene is None else scene.number(f"mjc:compiler:{name}")) or Fraction(0) for name in names)
    balances = scene is not None and scene.is_on("mjc:compiler:balanceInertia", False)
    off: dict[str, Any] = {name: Fraction(0) for name, flag in _FLAGS if scene is not None and not scene.is_on(f"mjc:flag:{flag}")}
    own = [replace(one, **off) if isinstance(one, Spring | Coupling) else one for one in springs]
    return Tree(
        tuple(replace(body, joints=tuple(replace(one, **off) for one in body.joints)) for body in bodies),
        ORIGIN,
        tuple(one for one in own if isinstance(one, Spring)),
        tuple(one for one in own if isinstance(one, Coupling)),
        total_mass=total if total > 0 else None,
        bounds=Bounds(mass, moment, balances) if mass > 0 or moment > 0 or balances else None,
    )


def _spring_dampers(scene: Prim | None, moving: Mapping[str, Prim]) -> SpringDampers:
    given: dict[str, tuple[Given, Given]] = {}
    for name, prim in moving.items():
        numbers = prim.finite("mjc:springdamper")
        if len(numbers) == 2 and all(number > 0 for number in numbers):
            given[name] = numbers[0], numbers[1]
    springs, dampers = (scene is None or scene.is_on(f"mjc:flag:{flag}") for _, flag in _FLAGS)
    return SpringDampers(given, springs, dampers)


def _refuse_constrained(links: list[_Link]) -> None:
    first, second = links[:2]
    second.prim.refuse(
        f"joins the bodies that <{first.prim.path}> joins, so that each holds what the other leaves free; exclude it from the "
        "articulation, or say newton:jointsAddMobility at its root where they are to add their degrees of freedom"
    )


def _inverted(placement: Placement) -> Pose:
    if placement.is_inverse:
        return (replace(placement, is_inverse=False),)
    return reversed_placement(placement)


def _names(prims: Iterable[Prim]) -> dict[str, str]:
    """A name for each prim by its path: that which people read, with as many of the prims above as tell it from others."""
    listed = list(prims)
    counts = Counter(prim.name for prim in listed)
    found = {}
    for prim in listed:
        parts = prim.path.strip("/").split("/")
        found[prim.path] = prim.name if counts[prim.name] == 1 else "/".join([*parts[-2:-1], prim.name])
    again = Counter(found.values())
    return {path: name if again[name] == 1 else path.strip("/") for path, name in found.items()}
