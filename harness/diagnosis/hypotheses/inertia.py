"""Entries of an inertia are in the wrong order or of the wrong sign, or it was given about another point.

Source: Featherstone, Rigid Body Dynamics Algorithms, section 2.13, equation 2.63.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.diagnosis.hypotheses._changes import FixedChange, Writes, hypothesis, is_zero, times
from harness.diagnosis.hypotheses.rotations import matrix_of
from harness.models.anatomy.parts import ENTRIES, Anatomy, Inertial

MOMENTS, PRODUCTS = ENTRIES[:3], ENTRIES[3:]
# MuJoCo writes moments first, URDF row by row.
_BY_ROWS = ("xx", "xy", "xz", "yy", "yz", "zz")
# What is left of a mass or moment after another is taken off, and is rounding.
ROUNDING = Fraction(1, 2**48)
# A moving body needs this much in MuJoCo.
_LEAST = {"mjcf": "1e-15", "urdf": "0"}


def parallel_axis(mass: float, centre: Array) -> Array:
    """m (r^2 1 - r r'), (3, 3) [kg m^2]: what an inertia about a point r away from the centre of mass has more."""
    return mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))


def with_added(inertial: Inertial, model_format: str, added: Array, factor: float = 1.0) -> Writes:
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
        negligible = ROUNDING * (max(abs(change), Fraction(least)) if row == column else largest)
        words[name] = least if abs(total - Fraction(least)) <= negligible else repr(float(total))
    return inertial.rewritten(words)


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
            added = parallel_axis(float(inertial.mass.values[0]), arm)
            for sign, statement in ((-1, "parallel axis counted twice"), (1, "parallel axis taken off twice")):
                yield FixedChange(f"{statement} in {body.name}", with_added(inertial, parts.model.format, added, sign))


ENTRIES_SWAPPED = hypothesis(
    "inertia_entries",
    "entries of an inertia swapped, or the inertias of two bodies exchanged",
    "MuJoCo, XML reference, inertial/fullinertia (xx yy zz xy xz yz), against URDF's ixx ixy ixz iyy iyz izz",
    _reordered,
)
PRODUCTS_FLIPPED = hypothesis(
    "products",
    "signs of off-diagonal inertia entries flipped",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13: products of inertia are the negatives of the matrix entries",
    _flipped,
)
PARALLEL_AXIS = hypothesis(
    "parallel_axis",
    "inertia about the joint instead of the centre of mass, or the parallel axis taken off twice",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13; http://wiki.ros.org/urdf/XML/link, inertial",
    _about_another_point,
)
