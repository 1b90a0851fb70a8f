"""The mass matrix, bias and inverse dynamics of a mechanism by its own equations of motion, certified entry by entry.

Those of a mechanism under constraints are of the tree that is left without them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from harness.programs.program import StraightLineProgram, without_unused
from harness.programs.states import States
from harness.programs.terms import Builder, Term, Vector, symmetric, vector
from harness.truth.blocks import Between, QuantityKernel
from harness.truth.compare import Certified
from harness.truth.reference import ReferenceKernel

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
    builder = Builder(program.inputs)
    return _written(builder, MASS_MATRIX, symmetric(builder.append(program)["mass"], nv).flat)


def _bias(program: StraightLineProgram, nq: int, nv: int) -> StraightLineProgram:
    builder = Builder(program.inputs)
    return _written(builder, BIAS, _sums(builder.append(program)))


def _inverse_dynamics(program: StraightLineProgram, nq: int, nv: int) -> StraightLineProgram:
    """M a + c + g - p, with the accelerations a in the place of tau."""
    builder = Builder(program.inputs)
    equations = builder.append(program)
    inertial = symmetric(equations["mass"], nv) @ builder.inputs_at(range(nq + nv, nq + 2 * nv))
    opposed = _sums(equations) - vector(equations["passive"])
    return _written(builder, INVERSE_DYNAMICS, inertial + opposed)


def _sums(equations: Mapping[str, Sequence[Term]]) -> Vector:
    """Velocity and gravity terms together."""
    return vector(equations["velocity"]) + vector(equations["gravity"])


def _written(builder: Builder, name: str, terms: Iterable[Term]) -> StraightLineProgram:
    return without_unused(builder.program({name: terms}))


_WRITTEN: Mapping[str, Callable[[StraightLineProgram, int, int], StraightLineProgram]] = {
    MASS_MATRIX: _mass_matrix,
    BIAS: _bias,
    INVERSE_DYNAMICS: _inverse_dynamics,
}
