"""Ball and free joints: from a textbook's Euler angles to the engines' quaternions and velocities.

A chart says which Euler angles a text uses. The equations of motion, derived in the angles and their
rates, are rewritten for the quaternion and the velocities that an engine holds: with q' = A(q) u for the
engine's velocities u,

    A'MA u' + A'(c + M A' u) + A'g = A'p + tau

(the second A' in the bracket is dA/dt), and sines and cosines of the angles become algebraic functions
of the quaternion. So the certified evaluation starts from the engine's exact numbers and no roundoff of
a conversion is charged to it.

Velocities of a ball joint are the angular velocity in the body's frame. Those of a free joint are the
velocity of the body frame's origin and then the same; engines differ in the frame that the former is
given in. Quaternions are (w, x, y, z), of any length.

Source: Greenwood, Advanced Dynamics, sections 3.1 and 4.4 (Euler angles, quasi-velocities); Diebel,
Representing attitude, 2006, section 8, for all sequences.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sympy as sp

from harness.lagrange.expressions import SymbolicDerivatives
from harness.lagrange.short_forms import shortest
from harness.programs.program import ENERGY_OUTPUTS

if TYPE_CHECKING:
    from harness.lagrange.equations import EnergiesInSymbols, EquationsOfMotion
    from harness.lagrange.system import System

AXES = "xyz"
_ABOUT = {"x": sp.rot_ccw_axis1, "y": sp.rot_ccw_axis2, "z": sp.rot_ccw_axis3}


@dataclass(frozen=True)
class Attitude:
    """Euler angles of a ball joint, or of the rotation of a free joint.

    Attributes:
        joint: name of the joint that carries the angles.
        angles: the three coordinates, in the order of their rotations.
        sequence: axes of the rotations about the body's own axes, as "zxz" or "xyz": a body vector r is
            R_z(angles[0]) R_x(angles[1]) R_z(angles[2]) r in the joint's frame.
        position: the three coordinates of the body frame's origin for a free joint; () for a ball joint.

    Raises:
        ValueError: the sequence is none of the twelve, or the number of coordinates is wrong.
    """

    joint: str
    angles: tuple[sp.Expr, ...]
    sequence: str
    position: tuple[sp.Expr, ...] = ()

    def __post_init__(self) -> None:
        if (
            len(self.sequence) != 3
            or set(self.sequence) - set(AXES)
            or any(a == b for a, b in zip(self.sequence, self.sequence[1:], strict=False))
        ):
            raise ValueError(f"sequence {self.sequence!r} of joint {self.joint!r}; expected three of x, y, z, no two neighbours alike")
        if len(self.angles) != 3 or len(self.position) not in (0, 3):
            raise ValueError(
                f"joint {self.joint!r} has {len(self.angles)} angles and {len(self.position)} positions; expected 3, and 3 or none"
            )

    @property
    def coordinates(self) -> tuple[sp.Expr, ...]:
        """The coordinates the joint carries, in the order of the engines' velocities."""
        return (*self.position, *self.angles)


@dataclass(frozen=True)
class ChangeOfVariables:
    """From coordinates and their rates to joint positions and velocities; ``transform`` is A of q' = A(q) u.

    ``of_rates`` also knows what texts write for the angular velocity and, where it is given in the body's frame, for the
    linear one. ``blocks`` are those of A that are no identity, (3, 3), each with the places of its first coordinate and of the
    first angle of its joint. |regularity| falls to 0 where the chart is singular, and is at most 1.
    """

    positions: tuple[sp.Symbol, ...]
    blocks: tuple[tuple[int, int, sp.Matrix], ...]
    transform: sp.Matrix
    of_rates: Mapping[sp.Expr, sp.Expr]
    of_angles: Mapping[sp.Expr, sp.Expr]
    regularity: sp.Expr

    def in_quaternions(self, matrix: sp.Matrix) -> sp.Matrix:
        """``matrix`` without the angles. Whole sines and cosines go first; an angle that is left stands outside of them."""
        functions = {key: value for key, value in self.of_angles.items() if not key.is_Symbol}
        bare = {key: value for key, value in self.of_angles.items() if key.is_Symbol}
        return matrix.xreplace(functions).xreplace(bare)


def rotation(sequence: str, angles: Sequence[sp.Expr]) -> sp.Matrix:
    """Rotation matrix (3, 3) from the body's frame to the joint's, by rotations about the body's own axes."""
    product = sp.eye(3)
    for axis, angle in zip(sequence, angles, strict=True):
        product *= _ABOUT[axis](angle)
    return product


def body_rates(sequence: str, angles: Sequence[sp.Expr]) -> sp.Matrix:
    """B (3, 3) with omega = B d(angles)/dt, omega the angular velocity in the body's frame."""
    axes = [sp.eye(3)[:, AXES.index(axis)] for axis in sequence]
    after = [rotation(sequence[place + 1 :], angles[place + 1 :]) for place in range(3)]
    return sp.Matrix.hstack(*(turned.T * axis for turned, axis in zip(after, axes, strict=True)))


def sines_and_cosines(sequence: str, turned: sp.Matrix) -> tuple[list[tuple[sp.Expr, sp.Expr]], sp.Expr]:
    """(sine, cosine) of each angle of a rotation matrix, and the regularity of the chart there.

    The middle angle lies in (0, pi) where the first and last axes are the same, else in (-pi/2, pi/2).
    """
    i, j, last = (AXES.index(axis) for axis in sequence)
    k = 3 - i - j
    parity = sp.Integer(1 if (j - i) % 3 == 1 else -1)
    if i == last:
        regularity = sp.sqrt(turned[j, i] ** 2 + turned[k, i] ** 2)
        first = turned[j, i] / regularity, -parity * turned[k, i] / regularity
        middle = regularity, turned[i, i]
        final = turned[i, j] / regularity, parity * turned[i, k] / regularity
    else:
        regularity = sp.sqrt(turned[i, i] ** 2 + turned[i, j] ** 2)
        first = -parity * turned[j, k] / regularity, turned[k, k] / regularity
        middle = parity * turned[i, k], regularity
        final = -parity * turned[i, j] / regularity, turned[i, i] / regularity
    return [first, middle, final], regularity


def equations_in_joints(equations: EquationsOfMotion, change: ChangeOfVariables) -> dict[str, sp.Matrix]:
    """The terms mass u' + velocity + gravity = passive + tau in the positions and velocities u of the joints, by name."""
    transform, velocities = change.transform, sp.Matrix(equations.rates)
    mass, rates = equations.mass_matrix, transform * velocities
    growth = sum((transform.diff(x) * rate for x, rate in zip(equations.coordinates, rates, strict=True)), sp.zeros(*mass.shape))
    inertial = equations.velocity_terms.xreplace(change.of_rates) + mass * growth * velocities
    terms = {
        "mass": transform.T * mass * transform,
        "velocity": transform.T * inertial,
        "gravity": transform.T * equations.gravity_terms,
        "passive": transform.T * equations.passive_forces.xreplace(change.of_rates),
    }
    return {name: change.in_quaternions(term) for name, term in terms.items()}


def energies_in_joints(equations: EnergiesInSymbols, change: ChangeOfVariables) -> dict[str, sp.Matrix]:
    """Energies [J], power [W] and forces in joint positions and velocities, by the names of ``harness.programs.mechanisms.kernel``."""
    kinetic, potential, rates = equations.kinetic, equations.potential, equations.rates
    # h = T2 - T0 + V for T of second degree in the rates; the sum over v dL/dv is the same, and twice as long.
    at_rest = dict.fromkeys(rates, sp.S.Zero)
    momenta = SymbolicDerivatives.by(rates).of(kinetic)
    linear = sp.Add(*(momentum.xreplace(at_rest) * rate for rate, momentum in momenta.items()))
    energy = kinetic - linear - 2 * kinetic.xreplace(at_rest) + potential
    power = sum((force * rate for force, rate in zip(equations.generalised_forces, rates, strict=True)), sp.S.Zero)
    found = {name: sp.Matrix([value]) for name, value in zip(ENERGY_OUTPUTS, (energy, kinetic - potential, kinetic, power), strict=True)}
    of_joints = {name: value.xreplace(change.of_rates) for name, value in found.items()}
    of_joints["forces"] = change.transform.T * equations.generalised_forces.xreplace(change.of_rates)
    return {name: change.in_quaternions(value) for name, value in of_joints.items()}


def change_of_variables(system: System, equations: EnergiesInSymbols, linear_velocity_in_body: bool = False) -> ChangeOfVariables:
    """The change from the symbols of a system's energies to the positions and velocities of its joints.

    ``linear_velocity_in_body`` says in which frame a free joint's linear velocity is given.
    """
    coordinates = list(system.coordinates)
    q = equations.coordinates
    transform, positions = sp.eye(len(q)), list(q)
    of_angles: dict[sp.Expr, sp.Expr] = {}
    regularity: sp.Expr = sp.S.One
    of_rates: dict[sp.Expr, sp.Expr] = {}
    blocks: list[tuple[int, int, sp.Matrix]] = []
    for attitude in sorted(system.attitudes, key=lambda attitude: coordinates.index(attitude.coordinates[0]), reverse=True):
        first = coordinates.index(attitude.angles[0])
        angles = q[first : first + 3]
        quaternion = sp.symbols([f"{attitude.joint}_{part}" for part in "wxyz"], real=True)
        changes = [(first, _angle_rates(attitude.sequence, angles), body_rates(attitude.sequence, angles))]
        if attitude.position and linear_velocity_in_body:
            turned = rotation(attitude.sequence, angles)
            changes.append((first - 3, turned, turned.T))
        for place, block, inverse in changes:
            blocks.append((place, first, block))
            transform[place : place + 3, place : place + 3] = block
            rates = equations.rates[place : place + 3]
            for row, rate in zip(inverse * sp.Matrix(rates), rates, strict=True):
                of_rates |= {row: rate, -row: -rate}
        pairs, of_chart = sines_and_cosines(attitude.sequence, _of_quaternion(quaternion))
        for angle, (sine, cosine) in zip(angles, pairs, strict=True):
            of_angles |= {sp.sin(angle): sine, sp.cos(angle): cosine, angle: sp.atan2(sine, cosine)}
        regularity *= of_chart
        positions[first : first + 3] = quaternion
    if system.attitudes:
        of_rates |= dict(zip(equations.rates, transform * sp.Matrix(equations.rates), strict=True))
    return ChangeOfVariables(tuple(positions), tuple(blocks), transform, of_rates, of_angles, regularity)


@functools.cache
def _angle_rates(sequence: str, angles: tuple[sp.Expr, ...]) -> sp.Matrix:
    """The inverse of ``body_rates``, by cofactors: its determinant is a sine or a cosine of the middle angle, or minus that."""
    rates = body_rates(sequence, angles)
    *cofactors, determinant = shortest([*rates.adjugate(), rates.det(method="berkowitz")])
    return sp.Matrix(3, 3, cofactors) / determinant


def _of_quaternion(quaternion: Sequence[sp.Symbol]) -> sp.Matrix:
    """Rotation matrix of a quaternion (w, x, y, z) of any length but 0."""
    w, x, y, z = quaternion
    matrix = sp.Matrix(
        [
            [w**2 + x**2 - y**2 - z**2, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w**2 - x**2 + y**2 - z**2, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w**2 - x**2 - y**2 + z**2],
        ]
    )
    return matrix / (w**2 + x**2 + y**2 + z**2)


def _places_of_quaternions(system: System) -> list[int]:
    """Places among the positions, in the order of the joints."""
    order = list(system.coordinates)
    return [place + number for number, place in enumerate(sorted(order.index(one.angles[0]) for one in system.attitudes))]


def functions_of_angles(system: System, positions: Sequence[sp.Symbol]) -> dict[sp.Expr, sp.Expr]:
    """The angles of ball and free joints, their sines and cosines, in the quaternions among ``positions``."""
    order, found = list(system.coordinates), dict[sp.Expr, sp.Expr]()
    attitudes = sorted(system.attitudes, key=lambda attitude: order.index(attitude.angles[0]))
    for attitude, place in zip(attitudes, _places_of_quaternions(system), strict=True):
        pairs, _ = sines_and_cosines(attitude.sequence, _of_quaternion(positions[place : place + 4]))
        for angle, (sine, cosine) in zip(attitude.angles, pairs, strict=True):
            found |= {sp.sin(angle): sine, sp.cos(angle): cosine, angle: sp.atan2(sine, cosine)}
    return found


def rates_of_positions(system: System, positions: Sequence[Any], velocities: Sequence[Any]) -> list[Any]:
    """Rates of (nq,) positions at (nv,) velocities: of a quaternion p, p (0, omega) / 2, with omega in the body's frame."""
    rates = list(velocities)
    for place in _places_of_quaternions(system):
        w, x, y, z = positions[place : place + 4]
        a, b, c = rates[place : place + 3]
        rates[place : place + 3] = [
            -(x * a + y * b + z * c) / 2,
            (w * a + y * c - z * b) / 2,
            (w * b + z * a - x * c) / 2,
            (w * c + x * b - y * a) / 2,
        ]
    return rates
