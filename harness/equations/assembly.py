"""The programs of a system: its equations of motion and its energies, in the positions and velocities of the joints.

There are two ways to the program of the equations. ``program_of`` writes down SymPy's, which can be simplified and read.
``lagrange_program`` differentiates the programs of T and V instead, which is quicker and leaves about half as many
instructions of a long arm.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., equation 1.57.
"""

from __future__ import annotations

import sympy as sp

from harness.equations.calculus import ProgramWriter
from harness.equations.euler_angles import energies_in_joint_coordinates, in_joint_coordinates
from harness.equations.lagrange import EnergiesInSymbols, EquationsOfMotion, in_symbols, split_potential
from harness.equations.program import ENERGY_OUTPUTS, StraightLineProgram, assemble, upper_triangle, without_unused
from harness.equations.relative_joints import in_joint_positions
from harness.equations.system import TIME, System


def program_of(system: System, equations: EquationsOfMotion, linear_velocity_in_body: bool = False) -> StraightLineProgram:
    """The program of a system's equations, with its parameters as run-time inputs.

    Positions and velocities are those of the joints; see ``harness.equations.euler_angles`` for ball and free joints.
    """
    joint = in_joint_coordinates(equations, list(system.coordinates), system.attitudes, linear_velocity_in_body)
    outputs = {
        "mass": [joint.mass_matrix[i, j] for i, j in upper_triangle(len(joint.velocities))],
        "velocity": list(joint.velocity_terms),
        "gravity": list(joint.gravity_terms),
        "passive": list(joint.passive_forces),
    }
    if system.attitudes:
        outputs["regularity"] = [joint.regularity]
    return _in_joints(assemble([*_inputs(joint.positions, joint.velocities), *system.parameters], outputs), system)


def lagrange_program(system: System) -> StraightLineProgram | None:
    """The program of Lagrange's equations by derivatives of the programs of T and V.

    None where ``harness.equations.lagrange`` must derive them: with ball and free joints, whose equations are rewritten
    afterwards, and where it takes algebra to see that M does not depend on the rates.

    Raises:
        ValueError: as ``harness.equations.lagrange.derive``.
    """
    if system.attitudes:
        return None
    plain = in_symbols(system)
    n = len(plain.coordinates)
    of_gravity, of_springs = split_potential(plain.potential, system.gravity)
    inputs = [*_inputs(plain.coordinates, plain.rates), *system.parameters]
    energies = {"kinetic": [plain.kinetic], "gravity": [of_gravity], "springs": [of_springs], "forces": list(plain.generalised_forces)}
    writer = ProgramWriter(assemble(inputs, energies))
    positions, rates, now = range(n), range(n, 2 * n), 3 * n
    (kinetic,), (gravity,), (springs,), forces = writer.outputs.values()
    momenta = writer.gradient(kinetic, rates)
    # d/dt p(q, v, t) = M qdd + (dp/dq) v + dp/dt
    at_constant_rates = writer.along(momenta, dict(zip(positions, rates, strict=True)) | {now: writer.number(1)})
    of_positions = writer.gradient(kinetic, positions)
    # M is symmetric: column j below the diagonal is row j of the upper triangle.
    mass = [entry for j, rate in enumerate(rates) for entry in writer.along(momenta[j:], {rate: writer.number(1)})]
    depends = writer.depending_on(rates)
    if any(depends[entry] for entry in mass):
        return None
    outputs = {
        "mass": mass,
        "velocity": [writer.difference(*pair) for pair in zip(at_constant_rates, of_positions, strict=True)],
        "gravity": writer.gradient(gravity, positions),
        "passive": [writer.difference(*pair) for pair in zip(forces, writer.gradient(springs, positions), strict=True)],
    }
    return _in_joints(without_unused(writer.program(outputs)), system)


def energy_program_of(system: System, energies: EnergiesInSymbols) -> StraightLineProgram:
    """The energy program of a system, in the positions and velocities of the joints.

    The linear velocity of a free joint is that in the joint's frame.
    """
    joint = energies_in_joint_coordinates(energies, list(system.coordinates), system.attitudes)
    outputs = {name: [getattr(joint, name)] for name in ENERGY_OUTPUTS}
    outputs["forces"] = list(joint.forces)
    if system.attitudes:
        outputs["regularity"] = [joint.regularity]
    return _in_joints(assemble([*_inputs(joint.positions, joint.velocities), *system.parameters], outputs), system)


def _inputs(positions: tuple[sp.Symbol, ...], velocities: tuple[sp.Symbol, ...]) -> list[sp.Symbol]:
    """The inputs of every program but the parameters: q, v, tau and time."""
    return [*positions, *velocities, *(sp.Symbol(f"tau{i}") for i in range(len(velocities))), TIME]


def _in_joints(program: StraightLineProgram, system: System) -> StraightLineProgram:
    return in_joint_positions(program, system.parents) if system.measured_from else program
