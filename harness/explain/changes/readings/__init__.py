"""Readings: what an engine makes of an element of a file, each a ``Reading`` declared in a module of this package.

A reading is a ``Law`` that an engine has: it gives the tree that the engine computes with, as its documentation or source says. What it
concerns follows from what changes. The truth of the tree that all readings give is what a plain engine has to answer; that of one alone is
its effect. No list is kept: the readings that a module here holds are found; modules whose names begin with an underscore hold what several
share. Nothing an engine answers enters a tree.
"""

from __future__ import annotations

import functools
import graphlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
from lxml import etree
from packaging.specifiers import SpecifierSet

from harness.arrays import Array
from harness.environments import NEWEST, split_name
from harness.files.given import Given, Place, Pose
from harness.files.kept_document import kept_document
from harness.files.tree import WORLD, Body, Inertia, Joint, Solid, Tree
from harness.registry import declared
from harness.results.readings import page_of
from harness.results.table import grouped
from harness.trees.bodies.inertias import bounded
from harness.trees.robot import Robot

# Places of xx, yy, zz, xy, xz, yz in a matrix.
_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
_PARTS = ("bodies", "joints", "inertia", "solids", "springs", "couplings", "actuators", "force_limits", "place")


@dataclass(frozen=True)
class Law:
    """A way of reading one kind of element; any number of engines may have it.

    Attributes:
        name: as in a table. concerns: what is counted, in the plural: "joints", "links".
        tree: the tree that the engine computes with; an equal one where the law does not apply.
        supplied: whether an aided engine gets from the harness what it leaves out.
        after: names of the engine's readings whose tree this one reads; the others are read in the order of their names.
        first: whether it reads the file anew, and so goes before all others.
        quantity: the one quantity whose answers it bears on; "" for all.
    """

    name: str
    concerns: str
    tree: Callable[[Robot], Tree]
    supplied: bool = False
    after: tuple[str, ...] = ()
    first: bool = False
    quantity: str = ""


@dataclass(frozen=True, kw_only=True)
class Reading(Law):
    """A law that an engine's reader has.

    Attributes:
        engine, formats: whose reader, of which formats.
        sentence: for the reader of a report, the engine first. remedy: what the engine's user can do about it, an imperative.
        source: the documentation or source that says so.
        versions: of the engine's program that have it, as "<3.14"; "" for all that the harness knows.
        is_misread: whether the reader accepts what it does not read as the format's documentation says, and no documentation of the engine
            tells; False for what the engine says that it leaves out or does.
        is_of_program: whether it is what the engine computes of what its reader has read, and no reading of engines with that reader.
    """

    engine: str
    formats: tuple[str, ...]
    sentence: str
    remedy: str
    source: str
    versions: str = ""
    is_misread: bool = False
    is_of_program: bool = False

    @property
    def page(self) -> str:
        """The name of its page in the documentation."""
        return page_of(self.engine, self.name)

    def read(self, robot: Robot) -> Robot:
        """The robot that the engine computes with; the very robot where the reading does not apply."""
        tree = self.tree(robot)
        return robot if tree == robot.tree else with_tree(robot, tree)

    def places(self, robot: Robot) -> tuple[int, list[Place]]:
        """The number of elements that it concerns, and where they stand, in the order of the file and once each."""
        parts = changed_parts(bounded(robot.tree), bounded(self.read(robot).tree))
        return len(parts), list(dict.fromkeys(place for own in parts.values() for place in own))


def law(
    name: str,
    concerns: str,
    supplied: bool = False,
    after: tuple[str, ...] = (),
    each: Callable[[Tree, Callable[..., Any]], Tree] | None = None,
    **more: Any,
) -> Callable[[Callable[..., Any]], Law]:
    """Declares what a function makes of a robot, or with ``each``, as ``with_joints``, of each of its elements, as a ``Law``.

    ``more`` has other attributes of the law.
    """

    def declared(change: Callable[..., Any]) -> Law:
        return Law(name, concerns, change if each is None else lambda robot: each(robot.tree, change), supplied, after, **more)

    return declared


def readings_of(
    engine: str,
    laws: Mapping[tuple[str, ...], Mapping[Law, tuple[str, str, str]]],
    versions: str = "",
    is_misread: bool = False,
    is_of_program: bool = False,
) -> tuple[Reading, ...]:
    """The laws that an engine's reader of some formats has in some versions, each with its sentence, remedy and source."""
    about: dict[str, Any] = {"engine": engine, "versions": versions, "is_misread": is_misread, "is_of_program": is_of_program}
    return tuple(
        Reading(**vars(one), **about, formats=formats, sentence=sentence, remedy=remedy, source=source)
        for formats, of_formats in laws.items()
        for one, (sentence, remedy, source) in of_formats.items()
    )


def find_all() -> list[Reading]:
    """Every reading that is declared."""
    return list(_declared_in(_folders()))


# Folders with the times of their last change.
_Folders = tuple[tuple[str, int], ...]


def _folders() -> _Folders:
    return tuple((folder, os.stat(folder).st_mtime_ns) for folder in __path__)  # noqa: PTH116 (each question about a file asks)


@functools.lru_cache(maxsize=8)
def _declared_in(folders: _Folders) -> tuple[Reading, ...]:
    found = declared(__name__, Reading, "reading", lambda reading: f"{reading.engine} {reading.formats}: {reading.name}")
    return tuple(found.values())


def find_readings(engine: str, model_format: str, reader: str = "", quantity: str = "") -> list[Reading]:
    """The readings of an engine for a format, in the order in which they are read; ``reader`` is the engine whose reader it has, if any.

    Those that bear on one quantity alone are found for answers about that ``quantity``.
    An engine without a version, as the one beside the harness, is the newest; ``engine@version`` has what that version has.
    """
    return list(_found_readings(_folders(), engine, model_format, reader, quantity))


# Each file is read by the readings of each of its subjects, again for each that is asked about it.
@functools.lru_cache(maxsize=256)
def _found_readings(folders: _Folders, engine: str, model_format: str, reader: str, quantity: str) -> tuple[Reading, ...]:
    name, version = split_name(engine)
    readers = [one for one in _declared_in(folders) if one.engine == name or (one.engine == reader and not one.is_of_program)]
    own = (one for one in readers if model_format in one.formats and one.quantity in ("", quantity))
    named = {one.name: one for one in own if (version or NEWEST) in SpecifierSet(one.versions, prereleases=True)}
    order = graphlib.TopologicalSorter({name: named[name].after for name in sorted(named)})
    return tuple(sorted((named[name] for name in order.static_order() if name in named), key=lambda reading: not reading.first))


def with_tree(robot: Robot, tree: Tree) -> Robot:
    """The robot with another tree; joints that move by themselves there keep the order of the file."""
    return replace(robot, tree=tree, joints=tuple(joint.name for joint in tree.joints if not joint.follows))


def with_bodies(tree: Tree, change: Callable[[Body], Body]) -> Tree:
    """The tree with each body as ``change`` gives it."""
    return replace(tree, bodies=tuple(map(change, tree.bodies)))


def with_joints(tree: Tree, change: Callable[[Joint], Joint]) -> Tree:
    """The tree with each joint as ``change`` gives it; the very joint where that is equal."""

    def read(joint: Joint) -> Joint:
        changed = change(joint)
        return joint if changed == joint else changed

    return with_bodies(tree, lambda body: replace(body, joints=tuple(map(read, body.joints))))


def with_solids(tree: Tree, change: Callable[[Solid], Solid | None]) -> Tree:
    """The tree with each solid as ``change`` gives it, without those for which that is None."""
    return with_bodies(tree, lambda body: replace(body, solids=tuple(filter(None, map(change, body.solids)))))


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


def moving(tree: Tree) -> set[str]:
    """The names of the bodies that some joint moves."""
    found: set[str] = set()
    for body in tree.bodies:
        if body.joints or (body.parent != WORLD and body.parent in found):
            found.add(body.name)
    return found


def matrix_of(inertia: Inertia) -> Array:
    """(3, 3) about the centre of mass, in the frame of the inertia [kg m^2]."""
    matrix = np.zeros((3, 3))
    matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = [float(moment) for moment in inertia.moments]
    return matrix


def moments_of(matrix: Array) -> tuple[float, ...]:
    """xx, yy, zz, xy, xz, yz of a matrix (3, 3)."""
    return tuple(matrix[_ROWS, _COLUMNS].tolist())


def computed(value: float, body: Body, what: str, index: int = 0) -> Fraction:
    """A number that a reader computes for a body, and rounds as it does one of the file; ``index`` among those called ``what``."""
    place = body.place if body.inertia is None else body.inertia.place
    return Fraction(value) if place is None else Given(value, place, what, index)


def element_at(place: Place | None) -> etree._Element | None:
    """The element of a file that stands at a place, for what a reading needs of it and no tree holds; None where the place is none.

    Included files are in the place of what includes them: their options are the file's.
    """
    return None if place is None else kept_document(place.path).element(place)


def changed_parts(before: Tree, after: Tree) -> dict[tuple[str, ...], list[Place]]:
    """Places of the parts that differ, by their names: of the number, or of the element where the file does not give it.

    Parts that inherit a number from one element have one place.
    """
    others = {body.name: body for body in after.bodies}
    found: list[tuple[tuple[str, ...], Place | None]] = [((), _changed(before, after))]
    for one in before.bodies:
        found += _changed_in_body(one, others[one.name]) if one.name in others else [(("body", one.name), one.place)]
    kept = (*after.springs, *after.couplings, *after.actuators)
    gone = [part for part in (*before.springs, *before.couplings, *before.actuators) if part not in kept]
    found += [(("force", str(number)), part.place) for number, part in enumerate(gone)]
    return grouped((part, place) for part, place in found if place is not None)


def _changed_in_body(one: Body, other: Body) -> Iterator[tuple[tuple[str, ...], Place | None]]:
    kept = {joint.name: joint for joint in other.joints}
    yield ("body", one.name), _changed(one, other)
    yield ("body", one.name), _changed(one.inertia or one, other.inertia if one.inertia else other)
    yield ("body", one.name), one.place if one.inertia is None and other.inertia is not None else None
    names = {joint.name: joint for joint in one.joints}
    in_order = [name for name in names if name in kept] == [name for name in kept if name in names]
    yield ("body", one.name), None if in_order else one.place
    for joint in one.joints:
        yield ("joint", joint.name), _changed(joint, kept.get(joint.name))
    if len(one.solids) == len(other.solids):
        places = [_changed(solid, its_like) for solid, its_like in zip(one.solids, other.solids, strict=True)]
    else:
        places = [solid.place for solid in one.solids if solid not in other.solids] or [one.place]
    yield from ((("solid", one.name, str(number)), place) for number, place in enumerate(places))


def _changed(one: Any, other: Any) -> Place | None:
    """Place at which a part of a tree differs from ``other``, parts of which have places of their own: of a number, or of its element."""
    if other is None or one == other:
        return one.place if other is None else None
    own = [part.name for part in fields(one) if part.name not in _PARTS and getattr(one, part.name) != getattr(other, part.name)]
    places = [one.places.get(name, one.place) for name in own]
    return next((place for place in places if place != one.place), one.place) if places else None
