"""Readings: what an engine makes of an element of a file, each a ``Reading`` declared in a module of this package.

A reading gives the tree that the engine computes with, as its documentation or source says. What it concerns follows from what
changes. The truth of the tree that all readings give is what a plain engine has to answer; that of one alone is its effect.
No list is kept: the ``READINGS`` of every module here are found; modules whose names begin with an underscore hold what several
share. Nothing an engine answers enters a tree.
"""

from __future__ import annotations

import contextlib
import functools
import graphlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from lxml import etree

from harness.environments.folders import split_name
from harness.files.document.xml import read_any
from harness.files.tree import Body, Given, Inertia, Joint, Place, Pose, Solid, Tree
from harness.registry import Registry
from harness.trees.bodies.bounds import bounded
from harness.trees.robot import Robot

_PARTS = ("bodies", "joints", "inertia", "solids", "springs", "couplings", "place")


@dataclass(frozen=True)
class Reading:
    """What an engine makes of one kind of element.

    Attributes:
        name: as in a table. engine, formats: whose reader, of which formats.
        sentence: for the reader of a report, the engine first.
        concerns: what is counted, in the plural: "joints", "links".
        source: the documentation or source that says so.
        tree: the tree that the engine computes with; the very tree where the reading does not apply.
        supplied: whether an aided engine gets from the harness what it leaves out.
        after: names of the engine's readings whose tree this one reads; the others are read in the order of their names.
    """

    name: str
    engine: str
    formats: tuple[str, ...]
    sentence: str
    concerns: str
    source: str
    tree: Callable[[Robot], Tree]
    supplied: bool = False
    after: tuple[str, ...] = ()

    def read(self, robot: Robot) -> Robot:
        """The robot that the engine computes with; the very robot where the reading does not apply."""
        tree = self.tree(robot)
        return robot if tree is robot.tree or tree == robot.tree else with_tree(robot, tree)

    def places(self, robot: Robot) -> list[Place]:
        """Where the elements stand that it concerns, in the order of the file."""
        return changed_places(bounded(robot.tree), bounded(self.read(robot).tree))


# A reading that an engine has, from its name, its formats, the sentence and the source; see ``law``.
Declare = Callable[[str, Sequence[str], str, str], Reading]


def law(name: str, concerns: str, supplied: bool = False, after: tuple[str, ...] = ()) -> Callable[[Callable[[Robot], Tree]], Declare]:
    """Declares what a function makes of a robot, which any number of engines have as a ``Reading`` with these attributes."""

    def declaring(tree: Callable[[Robot], Tree]) -> Declare:
        return lambda engine, formats, sentence, source: Reading(
            name, engine, tuple(formats), sentence, concerns, source, tree, supplied, after
        )

    return declaring


def find_readings(engine: str, model_format: str, reader: str = "") -> list[Reading]:
    """The readings of an engine for a format, in the order in which they are read; ``reader`` is the engine whose reader it has, if any.

    Those of a version, ``engine@version``, are those of the engine.
    """
    found = Registry(__name__, Reading, "reading", lambda reading: f"{reading.engine} {reading.formats}: {reading.name}").all().values()
    named = {one.name: one for one in found if one.engine in (split_name(engine)[0], reader) and model_format in one.formats}
    order = graphlib.TopologicalSorter({name: named[name].after for name in sorted(named)})
    return [named[name] for name in order.static_order() if name in named]


def with_tree(robot: Robot, tree: Tree) -> Robot:
    """The robot with another tree; joints that move by themselves there keep the order of the file."""
    return replace(robot, tree=tree, joints=tuple(joint.name for joint in tree.joints if not joint.follows))


def with_bodies(tree: Tree, change: Callable[[Body], Body]) -> Tree:
    """The tree with each body as ``change`` gives it."""
    return replace(tree, bodies=tuple(map(change, tree.bodies)))


def with_joints(tree: Tree, change: Callable[[Joint], Joint]) -> Tree:
    """The tree with each joint as ``change`` gives it."""
    return with_bodies(tree, lambda body: replace(body, joints=tuple(map(change, body.joints))))


def with_solids(tree: Tree, change: Callable[[tuple[Solid, ...]], tuple[Solid, ...]]) -> Tree:
    """The tree with the solids of each body as ``change`` gives them."""
    return with_bodies(tree, lambda body: replace(body, solids=change(body.solids)) if body.solids else body)


def with_poses(tree: Tree, change: Callable[[Pose], Pose]) -> Tree:
    """The tree with the poses of bodies, inertias and solids as ``change`` gives them."""

    def read(body: Body) -> Body:
        inertia = body.inertia and replace(body.inertia, pose=change(body.inertia.pose))
        solids = tuple(replace(solid, pose=change(solid.pose)) for solid in body.solids)
        return replace(body, pose=change(body.pose), inertia=inertia, solids=solids)

    return with_bodies(tree, read)


def freed(joint: Joint) -> Joint:
    """A joint that moves by itself, whichever it mimics in the file."""
    return replace(joint, follows="", multiplier=Fraction(1), offset=Fraction(0)) if joint.follows else joint


def with_inertias(tree: Tree, change: Callable[[Body], Inertia | None]) -> Tree:
    """The tree with the inertia of each body as ``change`` gives it."""
    return with_bodies(tree, lambda body: replace(body, inertia=change(body)))


def without_bodies(tree: Tree, names: Iterable[str]) -> Tree:
    """The tree without these bodies and all that they carry, and without the springs and couplings of these."""
    gone, joints = set(names), set()
    if not gone:
        return tree
    for body in tree.bodies:
        if body.parent in gone or body.name in gone:
            gone.add(body.name)
            joints |= {joint.name for joint in body.joints}
    return replace(
        tree,
        bodies=tuple(body for body in tree.bodies if body.name not in gone),
        springs=tuple(spring for spring in tree.springs if not gone & {end for end, _ in spring.ends}),
        couplings=tuple(one for one in tree.couplings if not joints & {name for name, _ in one.joints}),
    )


def element_at(place: Place | None) -> etree._Element | None:
    """The element of a file that stands at a place, for what a reading needs of it and no tree holds; None where the place is none."""
    if place is None:
        return None
    return _elements(place.path)[place.element]


def mujoco_settings(robot: Robot, tag: str) -> Mapping[str, list[Given]]:
    """The attributes of that part of a URDF's element ``<mujoco>`` that are numbers; MuJoCo takes one that is not finite for none."""
    place = robot.tree.place
    root = element_at(place)
    found: dict[str, list[Given]] = {}
    if place is None or root is None or (part := root.find(f"mujoco/{tag}")) is None:
        return found
    for name, text in part.attrib.items():
        with contextlib.suppress(ValueError, OverflowError):
            found[str(name)] = [Given(float(word), place, f"mujoco/{tag} {name}", index) for index, word in enumerate(text.split())]
    return found


@functools.lru_cache(maxsize=4)
def _elements(path: Path) -> list[etree._Element]:
    return list(read_any(path, "a model").lines)


def changed_places(before: Tree, after: Tree) -> list[Place]:
    """Where the parts stand that differ: the number, or the element where the file does not give it. Once each."""
    others = {body.name: body for body in after.bodies}
    found = [_changed(before, after)]
    for one in before.bodies:
        found += _changed_in_body(one, others[one.name]) if one.name in others else [one.place]
    found += [spring.place for spring in before.springs if spring not in after.springs]
    found += [coupling.place for coupling in before.couplings if coupling not in after.couplings]
    return list(dict.fromkeys(place for place in found if place is not None))


def _changed_in_body(one: Body, other: Body) -> list[Place | None]:
    kept = {joint.name: joint for joint in other.joints}
    found = [_changed(one, other), _changed(one.inertia or one, other.inertia if one.inertia else other)]
    found += [_changed(joint, kept.get(joint.name)) for joint in one.joints]
    if len(one.solids) == len(other.solids):
        return found + [_changed(solid, its_like) for solid, its_like in zip(one.solids, other.solids, strict=True)]
    gone = [solid.place for solid in one.solids if solid not in other.solids]
    return found + (gone or [one.place])


def _changed(one: Any, other: Any) -> Place | None:
    """Where a part of a tree differs from ``other``, of which the parts have places of their own: a number if one does, or its element."""
    if other is None or one == other:
        return one.place if other is None else None
    own = [part.name for part in fields(one) if part.name not in _PARTS and getattr(one, part.name) != getattr(other, part.name)]
    places = [one.places.get(name, one.place) for name in own]
    return next((place for place in places if place != one.place), one.place) if places else None
