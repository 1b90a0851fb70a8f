"""What two versions hold is compared by its meaning: rounding, signs of quaternions and longer rows are no change."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from comparison.robots import FILES

from harness.comparison.robot_library import RobotLibrary
from harness.engines import Subject
from harness.engines.interface import AXES, QUATERNION, CompiledNumber
from harness.results.upgrade import CompiledChange
from harness.upgrade.portraits import ROUNDED, Portrait, changes_between, portray


def changes(before: list[CompiledNumber], now: list[CompiledNumber]) -> list[CompiledChange]:
    moved, found = changes_between("bar", "toy/urdf", Portrait(before), Portrait(now))
    assert not moved
    return found


def number(values: tuple[float | str, ...], parts: tuple[str, ...] = (), owner: str = "pin") -> list[CompiledNumber]:
    return [CompiledNumber("quantity", owner, values, parts)]


HALF = math.sqrt(0.5)
ALIKE = [
    (number((1.0,)), number((1.0 + 0.9 * ROUNDED,))),
    (number((HALF, -HALF, 0.0, 0.0), QUATERNION), number((-HALF, HALF, 0.0, 0.0), QUATERNION)),
    # Beside a component of 1, 1e-17 is rounding; beside nothing it is a number.
    (number((1.0, 0.0, 0.0), AXES), number((1.0, 1e-17, 0.0), AXES)),
    (number((1.0, 2.0)), number((1.0, 2.0, 0.0, 0.0))),
    (number(("hinge",)), number(("hinge",))),
    # A quantity that a version does not know.
    (number((1.0,)), [*number((1.0,)), CompiledNumber("other", "pin", (3.0,))]),
]


@pytest.mark.parametrize(("before", "now"), ALIKE)
def test_what_means_the_same_is_no_change(before: list[CompiledNumber], now: list[CompiledNumber]) -> None:
    assert changes(before, now) == [] == changes(now, before)


OTHERWISE = [
    (number((1.0,)), number((1.0 + 1.2 * ROUNDED,)), "quantity", 1.2 * ROUNDED),
    (number((0.0, -100.0, -21.0)), number((0.0, -100.0, -12.6)), "quantity[2]", 0.4),
    (number((HALF, HALF, 0.0, 0.0), QUATERNION), number((HALF, -HALF, 0.0, 0.0), QUATERNION), "quantity.x", 2.0),
    (number((1.0, 0.0, 0.0), AXES), number((1.0, 0.01, 0.0), AXES), "quantity.y", 0.01),
    (number((0.0,)), number((1e-17,)), "quantity", 1.0),
    (number(("hinge",)), number(("slide",)), "quantity", math.inf),
    (number((1.0,)), [*number((1.0,)), *number((2.0,), owner="new")], "quantity", math.inf),
]


@pytest.mark.parametrize(("before", "now", "name", "size"), OTHERWISE)
def test_what_does_not_is_one(before: list[CompiledNumber], now: list[CompiledNumber], name: str, size: float) -> None:
    [found] = changes(before, now)
    assert (f"{found.quantity}{found.part}", found.size) == (name, pytest.approx(size, rel=0.2))


def test_equal_changes_of_several_objects_are_one() -> None:
    owners = ["a", "b", "c", "d", "e", "f"]
    before, now = ([one for owner in owners for one in number((value,), owner=owner)] for value in (0.1, 10.0))
    [found] = changes(before, now)
    assert found.owners == owners and found.name == "quantity of a, b, c, d and 2 more"
    assert (found.old, found.new, found.change) == ("0.1", "10", "99 %")


def test_accelerations_move_by_more_than_their_rounding() -> None:
    one, roundoff = np.array([[1.0, 0.0], [0.6, 0.8]]), np.array([1e-15, 1e-15])
    moved, _ = changes_between("bar", "toy/urdf", Portrait((), one, roundoff), Portrait((), one * (1 + 1e-14), roundoff))
    assert moved == []
    [moved] = changes_between("bar", "toy/urdf", Portrait((), one, roundoff), Portrait((), one * (1 + 1e-12), roundoff))[0]
    assert (moved.what, moved.size) == ("accelerations", pytest.approx(1e-12, rel=1e-3))
    # A state without a certified truth says nothing.
    nowhere = np.array([np.inf, np.inf])
    assert changes_between("bar", "toy/urdf", Portrait((), one, nowhere), Portrait((), 2 * one, nowhere))[0] == []


@pytest.mark.parametrize(("name", "off"), [("arm.xml", {}), ("driven.xml", {"actuators": (26,)}), ("firm.xml", {})])
def test_what_acts_in_both_answers_is_compared(name: str, off: dict[str, tuple[int, ...]]) -> None:
    """Dry friction, limits and equalities are on; an actuator that is not read is told with its line."""
    path = str(FILES / name)
    found = portray(RobotLibrary.of([path], anywhere=True, acts=True), path, Subject("mujoco", "mjcf"), 0, lambda text: None)
    assert {one.what: one.lines for one in found.left_out} == off and len(found.accelerations)


def test_accelerations_of_a_portrait_feel_what_acts(tmp_path: Path) -> None:
    """Where the shoulder's friction is another, so are they; where it is not asked about, they are the same."""
    files = [FILES / "arm.xml", tmp_path / "arm.xml"]
    files[1].write_text(files[0].read_text().replace('frictionloss="0.125"', 'frictionloss="0.25"'))
    moved = {}
    for acts in (False, True):
        libraries = [RobotLibrary.of([str(path)], anywhere=True, acts=acts) for path in files]
        pair = [portray(one, one.system_names()[0], Subject("mujoco", "mjcf"), 0, lambda text: None) for one in libraries]
        moved[acts] = float(np.abs(pair[0].accelerations - pair[1].accelerations).max())
    assert moved[False] < 1e-12 and moved[True] > 1e-3, moved
