"""The programs of a system: its equations of motion and its energies, in the positions and velocities of the joints.

There are two ways to the program of the equations. ``program_of`` writes down SymPy's, which can be simplified and read.
``lagrange_program`` differentiates the programs of T and V instead, which is quicker and leaves about half as many
instructions of a long arm.

A text that measures coordinates from the world, as the absolute angles of a chain, has a kinetic energy of few terms; in the angles of
the joints every term depends on all joints before it, and the equations of n bars hold n^4 of them. So the equations are derived in
the text's coordinates q, and the program is then put into the joints' positions u:

    q = S u,    M_u = S' M S,    f_u = S' f,

where S adds to each joint's position those of the joints that it is measured from. S' sums over whatever is measured from a
joint, so that the program grows by about 2 n^2 additions.

Sources: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., equation 1.57; Greenwood, Principles of Dynamics, 2nd ed., section 6-4
(generalised forces under a change of coordinates).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from harness.lagrange.constraint import Constraint
from harness.lagrange.equations import EnergiesInSymbols, EquationsOfMotion, in_symbols, split_potential
from harness.lagrange.euler_angles import (
    ChangeOfVariables,
    change_of_variables,
    energies_in_joints,
    equations_in_joints,
    functions_of_angles,
    rates_of_positions,
)
from harness.lagrange.expressions import assemble
from harness.lagrange.system import TIME, System
from harness.programs.derivatives import along, depending_on, gradient
from harness.programs.mechanisms.mechanism import BIAS, GAIN, JACOBIAN, MOMENTS, RATE, RESIDUAL, Constraints, Driving
from harness.programs.program import StraightLineProgram, upper_triangle, with_operands, without_unused
from harness.programs.terms import Builder, Term, Vector, cross, dot, symmetric, vector


def program_of(system: System, equations: EquationsOfMotion, linear_velocity_in_body: bool = False) -> StraightLineProgram:
    """The program of a system's equations, with its parameters as run-time inputs.

    Positions and velocities are those of the joints; see ``harness.lagrange.euler_angles`` for ball and free joints.
    """
    change = change_of_variables(system, equations, linear_velocity_in_body)
    terms = equations_in_joints(equations, change)
    mass = [terms["mass"][i, j] for i, j in upper_triangle(len(equations.rates))]
    return _assembled(system, equations, change, {**terms, "mass": mass})


def lagrange_program(system: System, linear_velocity_in_body: bool = False) -> StraightLineProgram | None:
    """The program of Lagrange's equations by derivatives of the programs of T and V.

    For ball and free joints they are written in the velocities u of the joints, q' = A(q) u, which leaves few terms. There

        d/dt dT/du + G(u) dT/du + A' (dV/dq - dT/dq) = A' Q + tau,   T a function of q and u,

    where G is the vector product of the angular velocity with what is given in the body's frame, and of such a linear velocity
    with its momentum.

    None where ``harness.lagrange.equations`` must derive them, as it takes algebra to see that M does not depend on the rates.

    Raises:
        ValueError: as ``harness.lagrange.equations.derive``.

    Source: Greenwood, Advanced Dynamics, section 4.4 (Boltzmann-Hamel equations).
    """
    plain = in_symbols(system)
    n = len(plain.coordinates)
    change = change_of_variables(system, plain, linear_velocity_in_body)
    inputs = _inputs(system, plain, change)
    angles = [q for q in plain.coordinates if q not in change.positions]
    of_gravity, of_springs = split_potential(plain.potential, system.gravity)
    expressions = [plain.kinetic, of_gravity, of_springs, *plain.generalised_forces]
    written = {"energies": [expression.xreplace(change.of_rates) for expression in expressions]}
    blocks = {f"block {place}": list(block) for place, (_, _, block) in enumerate(change.blocks)}
    assembled = assemble([*inputs, *angles], written | blocks)
    builder = Builder(assembled.inputs)
    (kinetic, gravity, springs, *forces), *entries = builder.append(assembled).values()
    matrices = [np.array(block, dtype=object).reshape(3, 3) for block in entries]
    positions = [builder.inputs[[*inputs, *angles].index(q)] for q in plain.coordinates]
    first_rate = len(change.positions)
    rates, now = builder.inputs_at(range(first_rate, first_rate + n)), builder.inputs[first_rate + 2 * n]

    def of_joints(of_coordinates: Vector) -> Vector:
        """A' times forces, or derivatives by the coordinates."""
        found = of_coordinates.copy()
        for (first, _, _), block in zip(change.blocks, matrices, strict=True):
            found[first : first + 3] = block.T @ of_coordinates[first : first + 3]
        return found

    motion = dict(zip(positions, rates, strict=True))
    for (first, _, _), block in zip(change.blocks, matrices, strict=True):
        motion |= zip(positions[first : first + 3], block @ rates[first : first + 3], strict=True)
    momenta, one = gradient(kinetic, rates), builder.number(1)
    # d/dt p(q, u, t) = M du/dt + (dp/dq) A u + dp/dt
    velocity = vector(along(momenta, motion | {now: one})) - of_joints(vector(gradient(kinetic, positions)))
    for first, turning, _ in change.blocks:
        for place, by in {(first, turning), (turning, first)}:
            turned = cross(rates[by : by + 3], momenta[first : first + 3])
            velocity[place : place + 3] = velocity[place : place + 3] + turned
    # M is symmetric: column j below the diagonal is row j of the upper triangle.
    mass = [entry for j, rate in enumerate(rates) for entry in along(momenta[j:], {rate: one})]
    depends = depending_on(builder, rates, len(builder.instructions))
    if any(depends[entry.place] for entry in mass):
        return None
    outputs = {
        "mass": mass,
        "velocity": velocity,
        "gravity": of_joints(vector(gradient(gravity, positions))),
        "passive": of_joints(vector(force - slope for force, slope in zip(forces, gradient(springs, positions), strict=True))),
    }
    program = without_unused(builder.program(outputs))
    return _in_quaternions(program, change, inputs, angles) if angles else _in_joints(program, system)


def _in_quaternions(
    program: StraightLineProgram, change: ChangeOfVariables, inputs: Sequence[sp.Symbol], angles: Sequence[sp.Symbol]
) -> StraightLineProgram:
    """A program whose inputs are ``inputs`` and then ``angles``, with the angles as functions of the quaternions among ``inputs``."""
    replaced = {("input", len(inputs) + place): change.of_angles[angle] for place, angle in enumerate(angles)}
    for place, instruction in enumerate(program.instructions):
        if instruction in replaced and instruction[0] == "input":
            angle = angles[instruction[1] - len(inputs)]
            replaced |= {(function.__name__, place): change.of_angles[function(angle)] for function in (sp.sin, sp.cos)}
    assembled = assemble(inputs, {"replaced": list(replaced.values()), "regularity": [change.regularity]})
    builder = Builder(assembled.inputs)
    written = builder.append(assembled)
    known = dict(zip(replaced, written["replaced"], strict=True))
    terms: list[Term] = []
    for instruction in program.instructions:
        terms.append(known[instruction] if instruction in known else builder.again(instruction, terms))
    outputs = {name: [terms[index] for index in indices] for name, indices in program.outputs.items()}
    return without_unused(builder.program(outputs | {"regularity": written["regularity"]}))


def energy_program_of(system: System, energies: EnergiesInSymbols) -> StraightLineProgram:
    """The energy program of a system, in the positions and velocities of the joints.

    The linear velocity of a free joint is that in the joint's frame.
    """
    change = change_of_variables(system, energies)
    return _assembled(system, energies, change, energies_in_joints(energies, change))


def _assembled(
    system: System, energies: EnergiesInSymbols, change: ChangeOfVariables, outputs: Mapping[str, Sequence[sp.Expr]]
) -> StraightLineProgram:
    if system.attitudes:
        outputs = {**outputs, "regularity": [change.regularity]}
    return _in_joints(assemble(_inputs(system, energies, change), outputs), system)


def _inputs(system: System, energies: EnergiesInSymbols, change: ChangeOfVariables) -> list[sp.Symbol]:
    """The inputs of every program: q, v, tau, time and parameters."""
    taus = (sp.Symbol(f"tau{i}") for i in range(len(energies.rates)))
    return [*change.positions, *energies.rates, *taus, TIME, *system.parameters]


def _in_joints(program: StraightLineProgram, system: System) -> StraightLineProgram:
    return in_joint_positions(program, system.parents) if system.measured_from else program


Parents = Sequence[int | None]
_OF_FORCE = ("velocity", "gravity", "passive", "forces")


def in_joint_positions(program: StraightLineProgram, measured_from: Parents) -> StraightLineProgram:
    """The program of the same equations with joint positions and velocities for inputs, and their forces for outputs.

    ``measured_from`` has, for each of the n coordinates, the place of an earlier one, or None for the world. The first n
    inputs are positions, the next n rates. Outputs are those of ``harness.programs.kernels`` or of
    ``harness.programs.mechanisms.kernel``.
    """
    n = len(measured_from)
    instructions: list[tuple[Any, ...]] = [("input", place) for place in range(len(program.inputs))]

    def add(*instruction: Any) -> int:
        instructions.append(instruction)
        return len(instructions) - 1

    coordinates = list(range(len(program.inputs)))
    for block in (0, n):
        for place, parent in enumerate(measured_from):
            if parent is not None:
                coordinates[block + place] = add("add", block + place, coordinates[block + parent])
    results: list[int] = []
    for instruction in program.instructions:
        is_input = instruction[0] == "input"
        results.append(coordinates[instruction[1]] if is_input else add(*with_operands(instruction, results)))
    outputs = {name: [results[index] for index in indices] for name, indices in program.outputs.items()}

    def gather(*lines: Any) -> None:
        """Add what stands at whatever is measured from a joint to what stands at the joint, in each line."""
        for place, parent in reversed(list(enumerate(measured_from))):
            for line in lines if parent is not None else ():
                line[parent] = add("add", line[parent], line[place])

    for name in filter(outputs.get, _OF_FORCE):
        gather(outputs[name])
    if "mass" in outputs:
        mass = symmetric(outputs["mass"], n)
        # Views of the rows, and then of the columns.
        gather(*mass)
        gather(*mass.T)
        outputs["mass"] = [mass[pair] for pair in upper_triangle(n)]
    joint = StraightLineProgram(program.inputs, tuple(instructions), {name: tuple(indices) for name, indices in outputs.items()})
    return without_unused(joint)


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


def bounds_of(system: System, tree: StraightLineProgram) -> Constraints:
    """The rows of dry friction and limits of a system whose smooth equations of motion are ``tree``, by the names that a file has for them.

    Dry friction leaves nothing, and a limit the distance to it.
    """
    builder, order = Builder(tree.inputs), list(system.coordinates)
    nv, nothing = len(order), builder.number(0)
    rows: list[tuple[str, Term, int, int]] = []
    for q, joint in system.coordinates.items():
        place = order.index(q)
        position = builder.inputs[place]
        if q in system.dry_friction:
            rows.append((f"dry friction of joint {joint}", nothing, place, 1))
        if q in system.limits:
            low, high = (builder.inputs[tree.inputs.index(symbol.name)] for symbol in system.limits[q])
            rows += [
                (f"lower limit of joint {joint}", position - low, place, 1),
                (f"upper limit of joint {joint}", high - position, place, -1),
            ]
    velocities = builder.inputs[nv : 2 * nv]
    outputs = {
        RESIDUAL: [residual for _, residual, _, _ in rows],
        JACOBIAN: [builder.number(sign * (place == column)) for _, _, place, sign in rows for column in range(nv)],
        RATE: [velocities[place] if sign > 0 else -velocities[place] for _, _, place, sign in rows],
        BIAS: [nothing] * len(rows),
    }
    count, names = len(rows), tuple(name for name, *_ in rows)
    return Constraints(
        rows=names,
        redundant=(True,) * count,
        holonomic=count,
        positions=(),
        rates=(),
        assembly=(0.0,) * nv,
        program=without_unused(builder.program(outputs)),
        tree=tree,
    )


def contact_rows(system: System, tree: StraightLineProgram) -> StraightLineProgram:
    """The program of a system's contacts, as of ``Constraints``: first the gap of each, then the slips of each that rubs."""
    slips = [slip for contact in system.contacts.values() for slip in contact.slips]
    return _rows(system, tree.inputs, [contact.gap for contact in system.contacts.values()], slips)


def driving_of(system: System, tree: StraightLineProgram) -> Driving:
    """The laws of the actuators of a system whose equations of motion without them are ``tree``."""
    inputs, symbols = _symbols_of(system, tree.inputs)
    actuators = list(system.actuators.values())
    outputs = {
        GAIN: [one.gain.xreplace(symbols) for one in actuators],
        BIAS: [one.bias.xreplace(symbols) for one in actuators],
        MOMENTS: [one.moments.get(q, sp.S.Zero).xreplace(symbols) for one in actuators for q in system.coordinates],
    }
    return Driving(
        names=tuple(system.actuators),
        control_ranges=tuple(one.control_range and _names(one.control_range) for one in actuators),
        force_ranges=tuple(one.force_range and _names(one.force_range) for one in actuators),
        program=assemble(inputs, outputs),
    )


def _names(bounds: tuple[sp.Symbol, sp.Symbol]) -> tuple[str, str]:
    low, high = bounds
    return low.name, high.name


def _symbols_of(system: System, names: Sequence[str]) -> tuple[list[sp.Symbol], dict[sp.Expr, sp.Symbol]]:
    """The inputs of a mechanism, of which the first are the positions and then the rates, and those by what they are in the system.

    Of ball and free joints they are not its coordinates and rates: what is written takes those of other joints alone.
    """
    order, inputs = list(system.coordinates), [sp.Symbol(name, real=True) for name in names]
    nv, last = len(order), [order.index(attitude.angles[-1]) for attitude in system.attitudes]
    # A rotation takes four positions.
    positions = [inputs[place + sum(place > other for other in last)] for place in range(nv)]
    first = nv + len(last)
    symbols = dict(zip([*system.rates, *order], [*inputs[first : first + nv], *positions], strict=True))
    return inputs, symbols | {parameter: inputs[names.index(parameter.name)] for parameter in system.parameters}


def _rows(system: System, names: Sequence[str], holding: Sequence[sp.Expr], rolling: Sequence[sp.Expr]) -> StraightLineProgram:
    nv, (inputs, symbols) = len(system.coordinates), _symbols_of(system, names)
    nq, functions = nv + len(system.attitudes), functions_of_angles(system, inputs)
    expressions = [[row.xreplace(functions).xreplace(symbols) for row in some] for some in (holding, rolling)]
    program = assemble(inputs, dict(zip((RESIDUAL, "rolling"), expressions, strict=True)))
    builder = Builder(program.inputs)
    written = builder.append(program)
    q, v = builder.inputs[:nq], builder.inputs[nq : nq + nv]
    motion = dict(zip(q, rates_of_positions(system, q, v), strict=True))
    held = along(written[RESIDUAL], motion) if system.attitudes else []
    jacobian = [gradient(row, v) for row in held] or [gradient(row, q) for row in written[RESIDUAL]]
    jacobian += [gradient(row, v) for row in written["rolling"]]
    velocities = [dot(row, v, builder.number(0)) for row in jacobian]
    bias = along(velocities, motion)
    outputs = {RESIDUAL: written[RESIDUAL], JACOBIAN: [entry for row in jacobian for entry in row], RATE: velocities, BIAS: bias}
    return without_unused(builder.program(outputs))
