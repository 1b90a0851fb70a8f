"""Entries of an inertia are in the wrong order or of the wrong sign; it was given about another point, or with another body's.

Source: Featherstone, Rigid Body Dynamics Algorithms, section 2.13, equation 2.63.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from fractions import Fraction
from functools import partial

import numpy as np

from harness.arrays import Array
from harness.explain.changes.mistakes import FixedChange, FreeChange, Mistake, Write, Writes, is_zero, plus, times
from harness.explain.changes.mistakes.frames import matrix_of
from harness.files.text.slots import ENTRIES, Anatomy, BodySlots, InertialSlots

MOMENTS, PRODUCTS = ENTRIES[:3], ENTRIES[3:]
# MuJoCo writes moments first, URDF row by row.
_BY_ROWS = ("xx", "xy", "xz", "yy", "yz", "zz")
# What is left of a mass or moment after another is taken off, and is rounding.
_ROUNDING = Fraction(1, 2**48)
# Ulps of the sum of a flat body's moments: by so many they may miss their equation, and so many more MuJoCo needs. Of 6,000 flat bodies it
# refused 199 with 1 ulp, 15 with 2, 2 with 3 and none with 4.
_MISSED, _ALLOWED = 8, 4
# A moving body needs this much in MuJoCo.
_LEAST = {"mjcf": "1e-15", "urdf": "0"}
# Of a child's mass, what a mistake leaves in its parent; of a moment, what it loses without its parallel axes.
_SHARE, _LOST = 0.5, 0.25


def _parallel_axis(mass: float, centre: Array) -> Array:
    """m (r^2 1 - r r'), (3, 3) [kg m^2]: what an inertia about a point r away from the centre of mass has more."""
    return mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))


def _with_added(inertial: InertialSlots, model_format: str, added: Array, factor: float = 1.0) -> Writes:
    """The writes for another inertia matrix, the one that stands there plus ``factor`` times ``added``."""
    added = factor * added
    largest = Fraction(float(np.abs(added).max()))
    words = {}
    for name in ENTRIES:
        row, column = map("xyz".index, name)
        change = Fraction(float(added[row, column]))
        if not change:
            continue
        total = Fraction(inertial.words[name]) + change
        least = _LEAST[model_format] if row == column else "0"
        # A product of inertia beside moments far above it is their rounding.
        negligible = _ROUNDING * (max(abs(change), Fraction(least)) if row == column else largest)
        words[name] = least if abs(total - Fraction(least)) <= negligible else _without_rounding(float(total))
    return inertial.rewritten(words)


def _without_rounding(value: float) -> str:
    """The decimal that one rounding has changed into ``value``: a flat body has no moments but those that were written."""
    short = float(f"{value:.15g}")
    return repr(short if abs(short - value) <= math.ulp(value) else value)


def _reordered(parts: Anatomy) -> Iterator[FixedChange]:
    for inertial in parts.inertials:
        words = inertial.words
        for group in (MOMENTS, PRODUCTS):
            if is_zero([words[name] for name in group]):
                continue
            for one, other in itertools.combinations(group, 2):
                swapped = inertial.rewritten({one: words[other], other: words[one]})
                yield FixedChange(f"{one} and {other} exchanged in {inertial.body}", swapped)
            for shift in (1, 2):
                turned = {name: words[group[(place + shift) % 3]] for place, name in enumerate(group)}
                yield FixedChange(f"{', '.join(group)} in another order in {inertial.body}", inertial.rewritten(turned))
        if not is_zero([words[name] for name in PRODUCTS]):
            for source, target in ((ENTRIES, _BY_ROWS), (_BY_ROWS, ENTRIES)):
                reordered = inertial.rewritten(dict(zip(source, (words[name] for name in target), strict=True)))
                yield FixedChange(f"entries in the order of another format in {inertial.body}", reordered)
    for first, second in itertools.combinations(parts.inertials, 2):
        writes = [*first.rewritten(second.words), *second.rewritten(first.words)]
        yield FixedChange(f"inertias of {first.body} and {second.body} exchanged", writes)


def _flipped(parts: Anatomy) -> Iterator[FixedChange]:
    for inertial in parts.inertials:
        flipped = {name: times([inertial.words[name]], "-1")[0] for name in PRODUCTS if float(inertial.words[name])}
        yield FixedChange(f"signs of all products flipped in {inertial.body}", inertial.rewritten(flipped))
        for name, word in flipped.items():
            yield FixedChange(f"sign of {name} flipped in {inertial.body}", inertial.rewritten({name: word}))


def _about_another_point(parts: Anatomy) -> Iterator[FixedChange]:
    for body in parts.bodies:
        if body.inertial is None:
            continue
        inertial = body.inertial
        anchors = {tuple(joint.anchor): joint.anchor for joint in body.joints} or {(): np.zeros(3)}
        for anchor in anchors.values():
            arm = matrix_of(inertial.rotation, parts).T @ (inertial.centre.values - anchor)
            added = _parallel_axis(float(inertial.mass.values[0]), arm)
            for sign, statement in ((-1, "parallel axis counted twice"), (1, "parallel axis taken off twice")):
                yield FixedChange(f"{statement} in {body.name}", _with_added(inertial, parts.model.format, added, sign))


def _counted_in_parent(
    parts: Anatomy, parent: InertialSlots, child: InertialSlots, body: BodySlots, sign: int, parallel: bool
) -> list[Write]:
    """The parent with the child's inertial, in the pose where all joints are zero, put in or taken out again."""
    assert body.offset is not None and body.rotation is not None
    turn = matrix_of(body.rotation, parts)
    own, added = (float(inertial.mass.values[0]) for inertial in (parent, child))
    centre, hung = parent.centre.values, body.offset.values + turn @ child.centre.values
    total = own + sign * added
    # A parent without mass of its own, or with as little as the engine accepts, has no centre.
    total = 0.0 if abs(total) <= float(_ROUNDING) * added else total
    if total < 0:
        return []
    moved = (own * centre + sign * added * hung) / total if total else np.zeros(3)
    frame, axes = matrix_of(parent.rotation, parts), turn @ matrix_of(child.rotation, parts)
    inertia: Array = sign * axes @ child.matrix @ axes.T
    if parallel:
        inertia = inertia + _parallel_axis(own, centre - moved) + sign * _parallel_axis(added, hung - moved)
    return [
        (parent.mass, plus(parent.mass.words, child.mass.words, sign)),
        (parent.centre, [repr(float(part)) for part in moved]),
        *_with_added(parent, parts.model.format, frame.T @ inertia @ frame),
    ]


def _pairs(parts: Anatomy) -> Iterator[tuple[InertialSlots, InertialSlots, BodySlots]]:
    """The inertials of parent and child, and the child."""
    for child in parts.bodies:
        parent = parts.body(child.parent)
        if parent is not None and parent.inertial is not None and child.inertial is not None:
            yield parent.inertial, child.inertial, child


def _with_children(parts: Anatomy, sign: int) -> Iterator[FixedChange]:
    for parent, child, body in _pairs(parts):
        for parallel, how in ((True, ""), (False, ", without its parallel axes")):
            writes = _counted_in_parent(parts, parent, child, body, sign, parallel)
            if writes:
                yield FixedChange(f"{child.body} counted in {parent.body} too{how}", writes)


def _moved_mass(parent: InertialSlots, child: InertialSlots, mass: float) -> list[Write]:
    """A mass [kg] moved from the parent to the child."""
    share = [repr(mass)]
    return [(parent.mass, plus(parent.mass.words, share, -1)), (child.mass, plus(child.mass.words, share))]


def _left_in_parent(parts: Anatomy) -> Iterator[FreeChange]:
    for parent, child, _ in _pairs(parts):
        size = float(max(child.mass.values[0], 1e-3 * parts.mass))
        yield FreeChange(f"mass of {child.body} in {parent.body}", partial(_moved_mass, parent, child), size)
    for inertial, term in _along_centres(parts):
        completed = partial(_completed, inertial, parts.model.format, term)
        yield FreeChange(f"parts of {inertial.body} without their parallel axes", completed, 1.0)


def _completed(inertial: InertialSlots, model_format: str, term: Array, share: float) -> Writes:
    """The writes for an inertia with a share of a parallel-axis term.

    Of a flat body one moment is the sum of the others, and rounding makes it more than that, which MuJoCo refuses without a tolerance.
    """
    added = share * term
    least, middle, greatest = np.linalg.eigvalsh(inertial.matrix + added)
    ulp = math.ulp(least + middle + greatest)
    is_flat = share and abs(least + middle - greatest) <= _MISSED * ulp
    return _with_added(inertial, model_format, added + _ALLOWED * ulp * np.eye(3) if is_flat else added)


def _along_centres(parts: Anatomy) -> Iterator[tuple[InertialSlots, Array]]:
    """Inertials with what mass away from the centre, along the line from the joint, adds to their moments."""
    for inertial in parts.inertials:
        if inertial.centre.values.any():
            arm = matrix_of(inertial.rotation, parts).T @ inertial.centre.values
            yield inertial, _parallel_axis(float(inertial.mass.values[0]), arm)


def _fused(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _with_children(parts, 1)
    for parent, child, _ in _pairs(parts):
        writes = _moved_mass(parent, child, -_SHARE * float(child.mass.values[0]))
        yield FixedChange(f"half the mass of {child.body} in {parent.body}", writes)
    for inertial, term in _along_centres(parts):
        # As much as the smallest moment that it changes allows.
        largest = float(np.linalg.eigvalsh(term)[-1])
        lost = _LOST * float(np.linalg.eigvalsh(inertial.matrix)[0])
        if lost > 1e-9 * largest:
            fused = _with_added(inertial, parts.model.format, term, -lost / largest)
            yield FixedChange(f"parts of {inertial.body} fused without their parallel axes", fused)


ENTRIES_SWAPPED = Mistake(
    "inertia_entries",
    "entries of an inertia swapped, or the inertias of two bodies exchanged",
    "MuJoCo, XML reference, inertial/fullinertia (xx yy zz xy xz yz), against URDF's ixx ixy ixz iyy iyz izz",
    _reordered,
)
PRODUCTS_FLIPPED = Mistake(
    "products",
    "signs of off-diagonal inertia entries flipped",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13: products of inertia are the negatives of the matrix entries",
    _flipped,
)
PARALLEL_AXIS = Mistake(
    "parallel_axis",
    "inertia about the joint instead of the centre of mass, or the parallel axis taken off twice",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13; http://wiki.ros.org/urdf/XML/link, inertial",
    _about_another_point,
)
BODIES_FUSED = Mistake(
    "bodies_fused",
    "bodies fused wrongly: mass counted twice, in part in the parent, or without its parallel axes",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13; MuJoCo, XML reference, compiler/fusestatic",
    lambda parts: _with_children(parts, -1),
    _left_in_parent,
    _fused,
)
