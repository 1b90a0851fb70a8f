"""Entries of an inertia are in the wrong order, or two bodies have each other's."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis, is_zero
from harness.models.anatomy.parts import ENTRIES, Anatomy

# Moments, and products where they are not all zero.
_GROUPS = (ENTRIES[:3], ENTRIES[3:])
# MuJoCo writes moments first, URDF row by row.
_BY_ROWS = ("xx", "xy", "xz", "yy", "yz", "zz")


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    for body in parts.bodies:
        if body.inertial is None:
            continue
        words = body.inertial.words
        for group in _GROUPS:
            if is_zero([words[name] for name in group]):
                continue
            for one, other in itertools.combinations(group, 2):
                swapped = body.inertial.rewritten({one: words[other], other: words[one]})
                yield FixedChange(f"{one} and {other} exchanged in {body.name}", swapped)
            for shift in (1, 2):
                turned = {name: words[group[(place + shift) % 3]] for place, name in enumerate(group)}
                yield FixedChange(f"{', '.join(group)} in another order in {body.name}", body.inertial.rewritten(turned))
        if not is_zero([words[name] for name in _GROUPS[1]]):
            for source, target in ((ENTRIES, _BY_ROWS), (_BY_ROWS, ENTRIES)):
                reordered = body.inertial.rewritten(dict(zip(source, (words[name] for name in target), strict=True)))
                yield FixedChange(f"entries in the order of another format in {body.name}", reordered)
    bodies = [body for body in parts.bodies if body.inertial is not None]
    for first, second in itertools.combinations(bodies, 2):
        assert first.inertial is not None and second.inertial is not None
        writes = [*first.inertial.rewritten(second.inertial.words), *second.inertial.rewritten(first.inertial.words)]
        yield FixedChange(f"inertias of {first.name} and {second.name} exchanged", writes)


HYPOTHESIS = hypothesis(
    "inertia_entries",
    "entries of an inertia swapped, or the inertias of two bodies exchanged",
    "MuJoCo, XML reference, inertial/fullinertia (xx yy zz xy xz yz), against URDF's ixx ixy ixz iyy iyz izz",
    _changes,
)
