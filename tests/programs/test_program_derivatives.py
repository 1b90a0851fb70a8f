"""Derivatives of programs, as programs, are those of the forward sweep over numbers."""

from __future__ import annotations

import numpy as np
import pytest

from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.derivatives import derivative_name, differentiate
from harness.programs.evaluation import jacobians, values, values_and_spread
from harness.programs.loops.encoding import encode_program
from harness.programs.loops.interpreter import moved_outputs
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import StraightLineProgram
from harness.truth.sampling import generic_sample

OUTPUTS = ["velocity", "passive"]
# Both sides round some thousand times, and cancel some digits.
NEAR = 2.0**-32


def columns_of(mechanism: Mechanism) -> np.ndarray:
    return mechanism.inputs(generic_sample(mechanism, 5, 1))


def test_derivatives_by_velocities_are_those_of_the_forward_sweep(built_in_name: str) -> None:
    mechanism = load_mechanism(Library.built_in(), built_in_name)
    program, inputs = mechanism.program, columns_of(mechanism)
    rates = range(mechanism.nq, mechanism.nq + mechanism.nv)
    found = values(differentiate(program, OUTPUTS, rates), inputs)
    expected = jacobians(program, inputs)
    for name in OUTPUTS:
        assert np.array_equal(found[name], values(program, inputs)[name])
        size = np.abs(expected[name]).max(initial=0.0) + np.abs(found[name]).max(initial=0.0)
        assert np.abs(found[derivative_name(name)].reshape(mechanism.nv, mechanism.nv, -1) - expected[name][:, rates]).max() <= NEAR * size


def test_loops_move_outputs_as_the_forward_sweep_does(built_in_name: str) -> None:
    mechanism = load_mechanism(Library.built_in(), built_in_name)
    inputs = columns_of(mechanism)
    by_loops = moved_outputs(mechanism.program, inputs, np.abs(inputs))
    if by_loops is None:
        assert encode_program(mechanism.program) is None
        return
    for own, each in zip(by_loops, values_and_spread(mechanism.program, inputs, np.abs(inputs)), strict=True):
        expected = np.concatenate(list(each.values())).T
        assert (np.abs(own - expected) <= NEAR * np.maximum(by_loops[1], np.abs(expected))).all()


def test_an_angle_that_is_too_large_for_the_loops_is_told() -> None:
    program = StraightLineProgram(("x",), (("input", 0), ("sin", 0), ("mul", 0, 0)), {"sine": (1,), "square": (2,)})
    by_loops = moved_outputs(program, np.array([[2.0**19, 2.0**21]]), np.ones((1, 2)))
    assert by_loops is not None
    assert np.isfinite(by_loops).all(axis=0).tolist() == [[True, True], [False, True]]


def test_the_rates_of_a_direction_may_be_instructions() -> None:
    # x y and y along x' = y, y' = 1 - 1, which the writer simplifies.
    program = StraightLineProgram(
        ("x", "y"),
        (("input", 0), ("input", 1), ("mul", 0, 1), ("rational", "1", "1"), ("sub", 3, 3), ("mul", 1, 3)),
        {"f": (2, 1)},
    )
    found = values(differentiate(program, ["f"], [{0: 5, 1: 4}, 1]), np.array([[2.0], [3.0]]))
    assert found["f"][:, 0].tolist() == [6.0, 3.0]
    assert found["d(f)"][:, 0].tolist() == [9.0, 2.0, 0.0, 1.0]


def test_what_moves_must_be_an_input() -> None:
    program = StraightLineProgram(("x",), (("input", 0), ("neg", 0)), {"f": (1,)})
    with pytest.raises(ValueError, match=r"move the inputs \[1\]; the program has 1"):
        differentiate(program, ["f"], [1])
