"""The rows of a system's constraints as a program: what they leave, how rates change them, and their bias."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from harness.equations.constraint import Constraint
from harness.equations.constraints import BIAS, JACOBIAN, RATE, RESIDUAL, Constraints
from harness.equations.derivatives import along, gradient
from harness.equations.expressions import assemble
from harness.equations.program import StraightLineProgram, without_unused
from harness.equations.system import System
from harness.equations.term import Builder, dot


def constraints_of(system: System, tree: StraightLineProgram) -> Constraints:
    """The constraints of a system whose equations of motion without them are ``tree``, in the positions of its joints."""
    system = system.in_joint_positions() if system.measured_from else system
    order, rates = list(system.coordinates), system.rates
    holding = [(name, one) for name, one in system.constraints.items() if not one.is_rolling(rates)]
    rolling = [(name, one) for name, one in system.constraints.items() if one.is_rolling(rates)]
    both = [*holding, *rolling]

    def places(constraints: Sequence[tuple[str, Constraint]]) -> tuple[int, ...]:
        return tuple(order.index(q) for _, one in constraints for q in one.determines)

    return Constraints(
        rows=tuple(name for name, one in both for _ in one.rows),
        redundant=tuple(number in one.redundant for _, one in both for number in range(len(one.rows))),
        holonomic=sum(len(one.rows) for _, one in holding),
        positions=places(holding),
        rates=places(both),
        assembly=tuple(float(system.assembly.get(q, 0.0)) for q in order),
        program=_rows(system, tree.inputs, *([row for _, one in some for row in one.rows] for some in (holding, rolling))),
        tree=tree,
    )


def _rows(system: System, names: Sequence[str], holding: Sequence[sp.Expr], rolling: Sequence[sp.Expr]) -> StraightLineProgram:
    nv = len(system.coordinates)
    # The inputs of the mechanism, of which the first are the coordinates and then their rates.
    inputs = [sp.Symbol(name, real=True) for name in names]
    symbols = dict(zip([*system.rates, *system.coordinates], [*inputs[nv : 2 * nv], *inputs[:nv]], strict=True))
    symbols |= {parameter: inputs[names.index(parameter.name)] for parameter in system.parameters}
    expressions = [[row.xreplace(symbols) for row in some] for some in (holding, rolling)]
    program = assemble(inputs, dict(zip((RESIDUAL, "rolling"), expressions, strict=True)))
    builder = Builder(program.inputs)
    written = builder.append(program)
    q, v = builder.inputs[:nv], builder.inputs[nv : 2 * nv]
    jacobian = [gradient(row, q) for row in written[RESIDUAL]] + [gradient(row, v) for row in written["rolling"]]
    velocities = [dot(row, v, builder.number(0)) for row in jacobian]
    bias = along(velocities, dict(zip(q, v, strict=True)))
    outputs = {RESIDUAL: written[RESIDUAL], JACOBIAN: [entry for row in jacobian for entry in row], RATE: velocities, BIAS: bias}
    return without_unused(builder.program(outputs))
