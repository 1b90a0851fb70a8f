"""A body's mass stands in its parent too, in part, or without its parallel axes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from harness.arrays import Array
from harness.diagnosis.hypotheses._changes import FixedChange, FreeChange, Write, Writes, hypothesis, plus
from harness.diagnosis.hypotheses._inertia import ROUNDING, parallel_axis, with_added
from harness.diagnosis.hypotheses._rotations import matrix_of
from harness.models.anatomy.parts import Anatomy, Body

# Of a child's mass, what a mistake leaves in its parent; of a moment, what it loses without its parallel axes.
_SHARE, _LOST = 0.5, 0.25


def _counted_in_parent(parts: Anatomy, parent: Body, child: Body, sign: int, parallel: bool) -> list[Write]:
    """The parent with the child's inertial, in the pose where all joints are zero, put in or taken out again."""
    assert parent.inertial is not None and child.inertial is not None and child.offset is not None and child.rotation is not None
    turn = matrix_of(child.rotation, parts)
    own, added = (float(body.inertial.mass.values[0]) for body in (parent, child) if body.inertial is not None)
    centre, hung = parent.inertial.centre.values, child.offset.values + turn @ child.inertial.centre.values
    total = own + sign * added
    # A parent without mass of its own, or with as little as the engine accepts, has no centre.
    total = 0.0 if abs(total) <= float(ROUNDING) * added else total
    if total < 0:
        return []
    moved = (own * centre + sign * added * hung) / total if total else np.zeros(3)
    frame, axes = matrix_of(parent.inertial.rotation, parts), turn @ matrix_of(child.inertial.rotation, parts)
    inertia: Array = sign * axes @ child.inertial.matrix @ axes.T
    if parallel:
        inertia = inertia + parallel_axis(own, centre - moved) + sign * parallel_axis(added, hung - moved)
    return [
        (parent.inertial.mass, plus(parent.inertial.mass.words, child.inertial.mass.words, sign)),
        (parent.inertial.centre, [repr(float(part)) for part in moved]),
        *with_added(parent.inertial, frame.T @ inertia @ frame, 1, parts.model.format),
    ]


def _pairs(parts: Anatomy) -> Iterator[tuple[Body, Body]]:
    for child in parts.bodies:
        parent = parts.body(child.parent)
        if parent is not None and parent.inertial is not None and child.inertial is not None and child.offset is not None:
            yield parent, child


def _with_children(parts: Anatomy, sign: int) -> Iterator[FixedChange]:
    for parent, child in _pairs(parts):
        for parallel, how in ((True, ""), (False, ", without its parallel axes")):
            writes = _counted_in_parent(parts, parent, child, sign, parallel)
            if writes:
                yield FixedChange(f"{child.name} counted in {parent.name} too{how}", writes)


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    return _with_children(parts, -1)


def _moved_mass(parent: Body, child: Body, words: tuple[list[str], list[str]]) -> list[Write]:
    assert parent.inertial is not None and child.inertial is not None
    return [(parent.inertial.mass, words[0]), (child.inertial.mass, words[1])]


def _free(parts: Anatomy) -> Iterator[FreeChange]:
    for parent, child in _pairs(parts):
        assert parent.inertial is not None and child.inertial is not None

        def moved(value: float, parent: Body = parent, child: Body = child) -> Writes:
            assert parent.inertial is not None and child.inertial is not None
            shares = [repr(value)]
            words = plus(parent.inertial.mass.words, shares, -1), plus(child.inertial.mass.words, shares)
            return _moved_mass(parent, child, words)

        yield FreeChange(f"mass of {child.name} in {parent.name}", moved, float(max(child.inertial.mass.values[0], 1e-3 * parts.mass)))
    for body, term in _along_centres(parts):

        def completed(value: float, body: Body = body, term: Array = term) -> Writes:
            assert body.inertial is not None
            return with_added(body.inertial, value * term, 1, parts.model.format)

        yield FreeChange(f"parts of {body.name} without their parallel axes", completed, 1.0)


def _along_centres(parts: Anatomy) -> Iterator[tuple[Body, Array]]:
    """Bodies with what mass away from the centre, along the line from the joint, adds to their moments."""
    for body in parts.bodies:
        if body.inertial is not None and body.inertial.centre.values.any():
            arm = matrix_of(body.inertial.rotation, parts).T @ body.inertial.centre.values
            yield body, parallel_axis(float(body.inertial.mass.values[0]), arm)


def _plants(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _with_children(parts, 1)
    for parent, child in _pairs(parts):
        assert parent.inertial is not None and child.inertial is not None
        share = [repr(_SHARE * float(child.inertial.mass.values[0]))]
        words = plus(parent.inertial.mass.words, share), plus(child.inertial.mass.words, share, -1)
        yield FixedChange(f"half the mass of {child.name} in {parent.name}", _moved_mass(parent, child, words))
    for body, term in _along_centres(parts):
        assert body.inertial is not None
        # As much as the smallest moment that it changes allows.
        largest = float(np.linalg.eigvalsh(term)[-1])
        lost = _LOST * float(np.linalg.eigvalsh(body.inertial.matrix)[0])
        if lost > 1e-9 * largest:
            writes = with_added(body.inertial, lost / largest * term, -1, parts.model.format)
            yield FixedChange(f"parts of {body.name} fused without their parallel axes", writes)


HYPOTHESIS = hypothesis(
    "bodies_fused",
    "bodies fused wrongly: mass counted twice, in part in the parent, or without its parallel axes",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13; MuJoCo, XML reference, compiler/fusestatic",
    _changes,
    _free,
    _plants,
)
