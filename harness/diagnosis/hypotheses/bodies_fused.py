"""A body's mass stands in its parent too, in part, or without its parallel axes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from harness.arrays import Array
from harness.diagnosis.hypotheses._changes import FixedChange, FreeChange, Write, hypothesis, plus
from harness.diagnosis.hypotheses.inertia import ROUNDING, parallel_axis, with_added
from harness.diagnosis.hypotheses.rotations import matrix_of
from harness.models.anatomy.parts import Anatomy, Body, Inertial

# Of a child's mass, what a mistake leaves in its parent; of a moment, what it loses without its parallel axes.
_SHARE, _LOST = 0.5, 0.25


def _counted_in_parent(parts: Anatomy, parent: Inertial, child: Inertial, body: Body, sign: int, parallel: bool) -> list[Write]:
    """The parent with the child's inertial, in the pose where all joints are zero, put in or taken out again."""
    assert body.offset is not None and body.rotation is not None
    turn = matrix_of(body.rotation, parts)
    own, added = (float(inertial.mass.values[0]) for inertial in (parent, child))
    centre, hung = parent.centre.values, body.offset.values + turn @ child.centre.values
    total = own + sign * added
    # A parent without mass of its own, or with as little as the engine accepts, has no centre.
    total = 0.0 if abs(total) <= float(ROUNDING) * added else total
    if total < 0:
        return []
    moved = (own * centre + sign * added * hung) / total if total else np.zeros(3)
    frame, axes = matrix_of(parent.rotation, parts), turn @ matrix_of(child.rotation, parts)
    inertia: Array = sign * axes @ child.matrix @ axes.T
    if parallel:
        inertia = inertia + parallel_axis(own, centre - moved) + sign * parallel_axis(added, hung - moved)
    return [
        (parent.mass, plus(parent.mass.words, child.mass.words, sign)),
        (parent.centre, [repr(float(part)) for part in moved]),
        *with_added(parent, parts.model.format, frame.T @ inertia @ frame),
    ]


def _pairs(parts: Anatomy) -> Iterator[tuple[Inertial, Inertial, Body]]:
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


def _moved_mass(parent: Inertial, child: Inertial, mass: float) -> list[Write]:
    """A mass [kg] moved from the parent to the child."""
    share = [repr(mass)]
    return [(parent.mass, plus(parent.mass.words, share, -1)), (child.mass, plus(child.mass.words, share))]


def _free(parts: Anatomy) -> Iterator[FreeChange]:
    for parent, child, _ in _pairs(parts):
        size = float(max(child.mass.values[0], 1e-3 * parts.mass))
        yield FreeChange(f"mass of {child.body} in {parent.body}", partial(_moved_mass, parent, child), size)
    for inertial, term in _along_centres(parts):
        completed = partial(with_added, inertial, parts.model.format, term)
        yield FreeChange(f"parts of {inertial.body} without their parallel axes", completed, 1.0)


def _along_centres(parts: Anatomy) -> Iterator[tuple[Inertial, Array]]:
    """Inertials with what mass away from the centre, along the line from the joint, adds to their moments."""
    for inertial in parts.inertials:
        if inertial.centre.values.any():
            arm = matrix_of(inertial.rotation, parts).T @ inertial.centre.values
            yield inertial, parallel_axis(float(inertial.mass.values[0]), arm)


def _plants(parts: Anatomy) -> Iterator[FixedChange]:
    yield from _with_children(parts, 1)
    for parent, child, _ in _pairs(parts):
        writes = _moved_mass(parent, child, -_SHARE * float(child.mass.values[0]))
        yield FixedChange(f"half the mass of {child.body} in {parent.body}", writes)
    for inertial, term in _along_centres(parts):
        # As much as the smallest moment that it changes allows.
        largest = float(np.linalg.eigvalsh(term)[-1])
        lost = _LOST * float(np.linalg.eigvalsh(inertial.matrix)[0])
        if lost > 1e-9 * largest:
            fused = with_added(inertial, parts.model.format, term, -lost / largest)
            yield FixedChange(f"parts of {inertial.body} fused without their parallel axes", fused)


HYPOTHESIS = hypothesis(
    "bodies_fused",
    "bodies fused wrongly: mass counted twice, in part in the parent, or without its parallel axes",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13; MuJoCo, XML reference, compiler/fusestatic",
    lambda parts: _with_children(parts, -1),
    _free,
    _plants,
)
