"""Off-diagonal entries of an inertia with the other sign: products of inertia, or entries of the matrix."""

from __future__ import annotations

from collections.abc import Iterator

from harness.diagnosis.hypotheses._changes import FixedChange, hypothesis, times
from harness.models.anatomy.parts import ENTRIES, Anatomy


def _changes(parts: Anatomy) -> Iterator[FixedChange]:
    for body in parts.bodies:
        if body.inertial is None:
            continue
        flipped = {name: times([body.inertial.words[name]], "-1")[0] for name in ENTRIES[3:] if float(body.inertial.words[name])}
        if not flipped:
            continue
        yield FixedChange(f"signs of all products flipped in {body.name}", body.inertial.rewritten(flipped))
        for name, word in flipped.items():
            yield FixedChange(f"sign of {name} flipped in {body.name}", body.inertial.rewritten({name: word}))


HYPOTHESIS = hypothesis(
    "products",
    "signs of off-diagonal inertia entries flipped",
    "Featherstone, Rigid Body Dynamics Algorithms, section 2.13: products of inertia are the negatives of the matrix entries",
    _changes,
)
