"""How far two engines' numbers of one model are apart, in units in the last place of the larger one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.crosscheck.held_quantities import OF_BODIES, OF_JOINTS, OF_SPRINGS
from harness.engines import HeldBody, HeldJoint, HeldSpring
from harness.files.joint_kinds import JointKind
from harness.files.text import lines as quantities

numbers = st.one_of(st.just(0.0), st.floats(1e-3, 1e3), st.floats(-1e3, -1e-3))
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
BODY = HeldBody(2.0, np.array([3.0, -4.0, 0.0]), np.diag([1.0, 2.0, 2.5]))
NOWHERE = np.zeros(3)
JOINT = HeldJoint(JointKind.HINGE, "", NOWHERE, NOWHERE, np.array([0.0, 0.0, 1.0]), 0.5, 0.2, 7.0, 0.3, np.eye(3))
SPRING = HeldSpring(np.array([[0.0, 0.0, 3.0], [1.0, 2.0, 2.0]]), 30.0, 0.4, 0.5)
# A quantity, an item that has it, and the field that is changed, as far as halves of it are no other thing.
SCALED: list[tuple[Any, Any, str]] = [
    (OF_BODIES[quantities.MASS], BODY, "mass"),
    (OF_BODIES[quantities.CENTRE], BODY, "centre"),
    (OF_BODIES[quantities.INERTIA], BODY, "inertia"),
    (OF_JOINTS[quantities.ARMATURE], JOINT, "armature"),
    (OF_JOINTS[quantities.DAMPING], JOINT, "damping"),
    (OF_JOINTS[quantities.STIFFNESS], JOINT, "stiffness"),
    (OF_JOINTS[quantities.SPRING_REFERENCE], JOINT, "spring_reference"),
    (OF_SPRINGS[quantities.SPRING_ENDS], SPRING, "points"),
    (OF_SPRINGS[quantities.SPRING_STIFFNESS], SPRING, "stiffness"),
    (OF_SPRINGS[quantities.SPRING_DAMPING], SPRING, "damping"),
    (OF_SPRINGS[quantities.SPRING_LENGTH], SPRING, "free_length"),
]


@pytest.mark.parametrize(("quantity", "item", "field"), SCALED, ids=[field for _, _, field in SCALED])
@pytest.mark.parametrize("factor", [0.5, 1.0, 1 - 2.0**-30])
def test_a_part_of_a_number_is_so_many_units_in_its_last_place(quantity: Any, item: Any, field: str, factor: float) -> None:
    """Whichever of the two has it."""
    other = replace(item, **{field: factor * getattr(item, field)})
    value = np.atleast_2d(getattr(item, field))
    # Of a moment of inertia the largest counts, of two points the one that is further apart, of a vector its length.
    size = float(np.abs(value).max()) if field == "inertia" else float(np.linalg.norm(value, axis=1).max())
    expected = (1 - factor) * size / np.spacing(size)
    assert quantity.ulps(item, other, 0.0) == quantity.ulps(other, item, 0.0) == pytest.approx(expected, rel=1e-6)


@given(one=vectors, other=vectors)
def test_the_order_of_two_bodies_does_not_matter(one: np.ndarray, other: np.ndarray) -> None:
    ulps = OF_BODIES[quantities.CENTRE].ulps
    bodies = replace(BODY, centre=one), replace(BODY, centre=other)
    assert ulps(*bodies, 1.0) == ulps(*reversed(bodies), 1.0)


def test_another_kind_of_joint_or_number_of_points_is_no_rounding() -> None:
    assert OF_JOINTS[quantities.JOINT].ulps(JOINT, replace(JOINT, kind=JointKind.SLIDE), 1.0) == np.inf
    assert OF_JOINTS[quantities.JOINT].ulps(JOINT, replace(JOINT, parent="other"), 1.0) == np.inf
    assert OF_SPRINGS[quantities.SPRING_ENDS].ulps(SPRING, replace(SPRING, points=np.zeros((3, 3))), 1.0) == np.inf
    # The ends of a spring may be named the other way round; it is no longer where its ends are.
    assert OF_SPRINGS[quantities.SPRING_ENDS].ulps(SPRING, replace(SPRING, points=SPRING.points[::-1]), 1.0) == 0.0


def test_an_axis_may_pass_through_any_of_its_points() -> None:
    ulps = OF_JOINTS[quantities.ANCHOR].ulps
    assert ulps(JOINT, replace(JOINT, anchor=np.array([0.0, 0.0, 5.0])), 1.0) == 0.0
    assert ulps(JOINT, replace(JOINT, anchor=np.array([0.0, 2.0**-52, 5.0])), 1.0) == 1.0
    assert ulps(replace(JOINT, kind=JointKind.SLIDE), replace(JOINT, anchor=np.ones(3)), 1.0) == 0.0
