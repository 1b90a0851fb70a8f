"""Contacts of different states have one program where their rows differ in measured numbers alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from harness.files.contacts import FoundContact, contacts_of, structure_of
from harness.files.given import Place
from harness.files.touching import ConeKind, Touch

FOUND = FoundContact(
    ("world", "ball"), (0.3, 0.2, 0.0), (0.0, 0.6, 0.8, 1.0, 0.0, 0.0, 0.0, 0.8, -0.6), -0.001, 0.0, (0.7, 0.7), shapes=("floor", "ball")
)
PLACE = Place(Path("robot.xml"), 1)


def structure(found: FoundContact) -> object:
    return structure_of(contacts_of([found], PLACE, ConeKind.ELLIPTIC))


def test_other_measured_numbers_have_the_structure_and_are_its_numbers() -> None:
    moved = replace(FOUND, point=(0.1, -0.2, 0.0), distance=-0.002)
    assert structure(moved) == structure(FOUND)
    [one] = contacts_of([moved], PLACE, ConeKind.ELLIPTIC)
    assert isinstance(one.says, Touch)
    assert one.says.numbers == (*moved.point, *moved.frame, moved.distance, moved.margin)


@pytest.mark.parametrize(
    "other",
    [
        # A number of 0 is none of a program.
        {"point": (0.0, 0.2, 0.0)},
        {"point": (0.3, 0.2, 0.1)},
        {"margin": 0.01},
        {"friction": (0.7, 0.6)},
        {"friction": (0.7, 0.7, 0.01)},
        {"bodies": ("world", "box")},
        {"sliding": (0.02, 1.0)},
        {"solref": (0.01, 1.0)},
    ],
)
def test_what_makes_other_rows_is_another_structure(other: dict[str, Any]) -> None:
    assert structure(replace(FOUND, **other)) != structure(FOUND)
