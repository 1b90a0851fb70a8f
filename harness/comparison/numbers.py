"""Two trees of one shape, as those of a file and an edited copy of it: the numbers that differ, and what each of them alone does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from harness.comparison.truth import STATES_OF_EFFECTS, Meant, change_by_numbers, read_as, reference_of
from harness.files.tree import Body, Given, Inertia, Joint, Place, Tree
from harness.results.comparison import FileDifference
from harness.results.table import number_text
from harness.trees.bodies.spatial import parameter_name
from harness.trees.robot import Robot

# What is said of a number by the field of a tree that holds it.
_NAMES = {
    "mass": "mass",
    "moments": "moments of inertia",
    "axis": "axis",
    "anchor": "anchor",
    "pose": "origin",
    "damping": "damping",
    "stiffness": "stiffness",
    "spring_reference": "spring reference",
    "friction_loss": "friction",
    "limits": "limits",
    "armature": "armature",
    "reference": "reference",
    "multiplier": "multiplier of the mimic",
    "offset": "offset of the mimic",
    "gravity": "gravity",
}
# Numbers that no equation of motion holds.
_NOT_FELT = ("friction_loss", "limits")


class OtherShape(Exception):
    """The trees are made of other parts."""


@dataclass(frozen=True)
class NumberPair:
    """One number of a tree and that of another at its place; ``what`` says of which part."""

    what: str
    first: Fraction
    second: Fraction


def different_numbers(first: Tree, second: Tree) -> list[NumberPair]:
    """The numbers that differ, in the order of the first.

    Raises:
        OtherShape: bodies, joints or rotations are other ones.
    """
    return [pair for pair in _pairs(first, second, "", "") if pair.first != pair.second]


def _pairs(one: Any, other: Any, owner: str, what: str) -> Iterator[NumberPair]:
    if isinstance(one, Fraction) and isinstance(other, Fraction):
        yield NumberPair(what, one, other)
    elif is_dataclass(one) and type(one) is type(other):
        owner = _owner(one, owner)
        for field in fields(one):
            if field.name not in ("place", *_NOT_FELT):
                named = f"{_NAMES.get(field.name, field.name)} of {owner}" if isinstance(one, Tree | Body | Joint | Inertia) else what
                yield from _pairs(getattr(one, field.name), getattr(other, field.name), owner, named)
    elif isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        for part, its_like in zip(one, other, strict=True):
            yield from _pairs(part, its_like, owner, what)
    elif one != other:
        raise OtherShape(what)


def _owner(part: Any, owner: str) -> str:
    if isinstance(part, Joint):
        return f"joint {part.name}"
    if isinstance(part, Body):
        return f"link {part.name}"
    return owner or "the world"


def ranked(first: Meant, second: Robot, pairs: Sequence[NumberPair]) -> list[FileDifference]:
    """The differences, the one that alone moves the accelerations of the first file most first."""
    effects: dict[int, float | None] = {}
    other = read_as(first, second)
    for meant, numbers in ((first, [(pair.first, pair.second) for pair in pairs]), (other, [(pair.second, pair.first) for pair in pairs])):
        effects |= {place: effect for place, effect in _effects(meant, numbers).items() if place not in effects}
    found = [_difference(pair, effects.get(number)) for number, pair in enumerate(pairs)]
    return sorted(found, key=lambda one: -(one.alone or 0.0))


def _effects(meant: Meant, numbers: Sequence[tuple[Fraction, Fraction]]) -> dict[int, float | None]:
    """What it does to set one number of a robot to another value: by the place of those that are parameters of its equations."""
    reference = reference_of(meant.robot)
    columns = {name: column for column, (name, _, _) in enumerate(reference.mechanism.parameters)}
    states = meant.states[np.arange(min(STATES_OF_EFFECTS, len(meant.states)))]
    own = np.array(reference.mechanism.parameter_values)
    found: dict[int, float | None] = {}
    for place, (number, value) in enumerate(numbers):
        if isinstance(number, Given) and parameter_name(number) in columns:
            changed = own.copy()
            changed[columns[parameter_name(number)]] = float(value)
            found[place] = change_by_numbers(reference, states, own, changed)
    return found


def _difference(pair: NumberPair, alone: float | None) -> FileDifference:
    one, other = (number.place if isinstance(number, Given) else None for number in (pair.first, pair.second))
    return FileDifference(
        what=pair.what,
        first=_shown(pair.first),
        second=_shown(pair.second),
        first_place=place_text(one),
        second_place=place_text(other),
        alone=alone,
    )


def _shown(number: Fraction) -> str:
    value = number_text(float(number))
    return f"{number.attribute}[{number.index}] {value}" if isinstance(number, Given) and number.attribute else value


def place_text(place: Place | None) -> str:
    """ "robot.urdf:12"; "" for none."""
    return "" if place is None else f"{Path(place.path).name}:{place.line}"
