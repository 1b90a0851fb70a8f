"""The mass matrix, bias and inverse dynamics of a mechanism by its own equations of motion, certified entry by entry.

Those of a mechanism under constraints are of the tree that is left without them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from harness.certify.certified import Certified
from harness.certify.quantity import Between, QuantityKernel
from harness.certify.reference import ReferenceKernel
from harness.equations.calculus import ProgramWriter
from harness.equations.program import StraightLineProgram, upper_triangle, without_unused
from harness.equations.states import States

MASS_MATRIX, BIAS, INVERSE_DYNAMICS = "mass_matrix", "bias", "inverse_dynamics"


class EquationValues:
    """Certified values of one mechanism, each entry a block of its own; a kind of values is compiled once.

    ``reference`` chooses the chart of each state, and the frame of the linear velocity of a free joint.
    """

    def __init__(self, reference: ReferenceKernel) -> None:
        self._reference = reference
        self._kernels: dict[tuple[str, str], QuantityKernel] = {}

    def evaluate(self, name: str, states: States) -> Certified:
        """The values ``name`` at ``states``, whose ``tau`` holds the accelerations of inverse dynamics; entries of M by rows."""
        mechanism, parts, places = self._reference.mechanism, [], []
        for chart, chosen in self._reference.by_chart(states):
            if (name, chart.program.key) not in self._kernels:
                program = _WRITTEN[name](chart.program, mechanism.nq, mechanism.nv)
                blocks = [[place] for place in range(len(program.outputs[name]))]
                self._kernels[name, chart.program.key] = QuantityKernel(program, blocks)
            inputs = np.ascontiguousarray(mechanism.inputs(states[chosen]).T)
            parts.append(self._kernels[name, chart.program.key].evaluate(inputs, Between.none(*inputs.shape)))
            places.append(chosen)
        return Certified.concatenate(parts)[np.argsort(np.concatenate(places))]


def _mass_matrix(program: StraightLineProgram, nq: int, nv: int) -> StraightLineProgram:
    writer = ProgramWriter(program)
    return _written(writer, MASS_MATRIX, [entry for row in _rows(writer, nv) for entry in row])


def _bias(program: StraightLineProgram, nq: int, nv: int) -> StraightLineProgram:
    writer = ProgramWriter(program)
    return _written(writer, BIAS, _sums(writer))


def _inverse_dynamics(program: StraightLineProgram, nq: int, nv: int) -> StraightLineProgram:
    """M a + c + g - p, with the accelerations a in the place of tau."""
    writer = ProgramWriter(program)
    given = [writer.add("input", place) for place in range(nq + nv, nq + 2 * nv)]
    inertial = [writer.dot(row, given) for row in _rows(writer, nv)]
    opposed = [writer.difference(*pair) for pair in zip(_sums(writer), writer.outputs["passive"], strict=True)]
    return _written(writer, INVERSE_DYNAMICS, [writer.sum(*pair) for pair in zip(inertial, opposed, strict=True)])


def _rows(writer: ProgramWriter, nv: int) -> list[list[int]]:
    entries = dict(zip(upper_triangle(nv), writer.outputs["mass"], strict=True))
    return [[entries[min(i, j), max(i, j)] for j in range(nv)] for i in range(nv)]


def _sums(writer: ProgramWriter) -> list[int]:
    """Velocity and gravity terms together."""
    return [writer.sum(*pair) for pair in zip(writer.outputs["velocity"], writer.outputs["gravity"], strict=True)]


def _written(writer: ProgramWriter, name: str, places: Sequence[int]) -> StraightLineProgram:
    return without_unused(writer.program({name: places}))


_WRITTEN: Mapping[str, Callable[[StraightLineProgram, int, int], StraightLineProgram]] = {
    MASS_MATRIX: _mass_matrix,
    BIAS: _bias,
    INVERSE_DYNAMICS: _inverse_dynamics,
}
