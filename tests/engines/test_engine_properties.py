"""What every engine must satisfy on every system: properties of its own, and of its energies and derivatives.

Nothing here asks for an acceleration to be right, which is the cross-check's question. Tolerances are BAR
times the roundoff that the inputs and the size of the summed terms allow.
"""

from __future__ import annotations

import copy
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import flint
import mujoco
import numpy as np
import pinocchio
import pytest
import sympy as sp
from catalogue import CALLED_HERE, TREES
from exact import system_of

from harness.crosscheck.assignment import Assignment, load_audited
from harness.engines import Subject, load_engine
from harness.files.model_file import PointSpring, read_model
from harness.lagrange.derivation import load_mechanism
from harness.lagrange.euler_angles import sines_and_cosines
from harness.lagrange.expressions import assemble
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.programs.kernels import BallKernel, Float64Kernel
from harness.programs.loops.encoding import encode
from harness.programs.loops.interpreter import derivatives
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism, smooth
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import StraightLineProgram, upper_triangle
from harness.programs.states import States
from harness.truth.compare import compare
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import ANGLES, generic_sample

Array = np.ndarray[Any, np.dtype[np.float64]]

COUNT = 6
# Backward errors up to here count as agreement, in the harness as here.
BAR = 64.0
# Steps that add to a configuration without rounding, one of multiples of GRID.
GRID = 2.0**-20
DIFFERENCE_STEP = 2.0**-15
# Balls of BITS leave third differences of step 2^-DERIVATIVE_BITS with 200 bits, and an error far below float64.
BITS, DERIVATIVE_BITS = 500, 60


class Probe(ABC):
    """An engine's own inverse dynamics, energies and derivatives, rows in the order of the coordinates."""

    def __init__(self, loaded: Any) -> None:
        self.loaded, self.model = loaded, loaded.model

    def accelerations(self, states: States) -> Array:
        return np.asarray(self.loaded.forward_dynamics(states.q, states.v, states.tau))

    def applied_forces(self, q: Array, v: Array, qdd: Array) -> Array:
        """Inverse dynamics: the forces beyond springs and dampers that give ``qdd``."""
        return np.asarray(self.loaded.inverse_dynamics(q[None], v[None], qdd[None])[0])

    def energies(self, q: Array, v: Array) -> tuple[float, float]:
        """T and V [J]."""
        kinetic, potential = self.loaded.energies(q[None], v[None])[0].tolist()
        return kinetic, potential

    @abstractmethod
    def derivatives(self, q: Array, tau: Array) -> tuple[Array, Array]:
        """dqdd/dq and dqdd/dv at rest, (nv, nv) each."""

    @abstractmethod
    def allowed_errors(self, at: Linearisation) -> Array:
        """(2 nv) what the columns of ``derivatives`` may be off, in the energy norm."""


class MujocoProbe(Probe):
    def derivatives(self, q: Array, tau: Array) -> tuple[Array, Array]:
        model, nv, (positions, rates) = copy.copy(self.model), self.model.nv, self.loaded.addresses
        # One step is then v + qacc, without a damper made implicit and without a product to round.
        model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_EULER, 1.0
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
        data, transition = mujoco.MjData(model), np.zeros((2 * nv + model.na, 2 * nv + model.na))
        data.qpos[positions], data.qfrc_applied[rates] = q, tau
        mujoco.mjd_transitionFD(model, data, DIFFERENCE_STEP, True, transition, None, None, None)
        by_position, by_rate = transition[nv : 2 * nv, :nv], transition[nv : 2 * nv, nv : 2 * nv] - np.eye(nv)
        order = np.ix_(rates, rates)
        return by_position[order], by_rate[order]

    def allowed_errors(self, at: Linearisation) -> Array:
        """A central difference of step h is off by h^2/6 third derivatives, and by two roundoffs over 2 h.

        One per cent is for the fifth derivatives, which come with h^4.
        """
        return DIFFERENCE_STEP**2 / 6 * 1.01 * energy_norms(at.mass, at.thirds) + at.difference_roundoff


class PinocchioProbe(Probe):
    def derivatives(self, q: Array, tau: Array) -> tuple[Array, Array]:
        """ABA's, with those of the force elements, whose rule is the harness's."""
        by_position, by_rate, _ = self.loaded.forward_dynamics_derivatives(q[None], np.zeros((1, len(tau))), tau[None])[0]
        return by_position, by_rate

    def allowed_errors(self, at: Linearisation) -> Array:
        """Of a product of M^-1 with the derivative of the forces, and of what one unit roundoff of the inputs does to it.

        Its terms may cancel: M^-1 e_i has the norm sqrt((M^-1)_ii). So may those of the forces, which Pinocchio forms
        in the world's frame, where every weight, and the pull of a spring on either end, has a moment about the origin.
        """
        data, still = self.model.createData(), np.zeros((1, len(at.tau)))
        pinocchio.forwardKinematics(self.model, data, self.loaded.columns(at.q[None], still, still)[0][:, 0])
        bodies = zip(list(data.oMi)[1:], list(self.model.inertias)[1:], strict=True)
        gravity = np.linalg.norm(self.model.gravity.linear)
        moment = gravity * sum(body.mass * np.linalg.norm(placement.act(body.lever)) for placement, body in bodies)
        springs = [spring for spring in self.loaded.force_elements.elements if isinstance(spring, PointSpring)]
        pulls, damping = np.sum([self._moments_of(spring, data) for spring in springs], axis=0) if springs else (0.0, 0.0)
        forces, rotating = np.abs(at.mass @ at.slopes), np.outer(at.rotating, at.rotating)
        forces += np.hstack([(moment + pulls) * rotating, damping * rotating])
        return BAR * UNIT_ROUNDOFF * (at.sensitivity + np.sqrt(np.linalg.inv(at.mass).diagonal()) @ forces)

    def _moments_of(self, spring: PointSpring, data: Any) -> tuple[float, float]:
        """How large the moments of a spring about the world's origin are: with what its length and its free length pull by themselves, and
        with what damps the rates of its ends by themselves, by a rate about the origin."""
        frames = [self.model.frames[self.model.getFrameId(body, pinocchio.FrameType.BODY)] for body, _ in spring.ends]
        points = [np.array(point) for _, point in spring.ends]
        ends = [(data.oMi[frame.parentJoint] * frame.placement).act(point) for frame, point in zip(frames, points, strict=True)]
        pull = spring.stiffness * (np.linalg.norm(ends[1] - ends[0]) + spring.free_length)
        arms = sum(float(np.linalg.norm(end)) for end in ends)
        return float(pull * arms), spring.damping * arms**2


PROBES: dict[Subject, type[Probe]] = {Subject("mujoco", "mjcf"): MujocoProbe, Subject("pinocchio", "urdf"): PinocchioProbe}


@dataclass(frozen=True)
class Linearisation:
    """dqdd/dq and dqdd/dv side by side at a configuration held at rest by ``tau``.

    Attributes:
        slopes, thirds: (nv, 2 nv) first and third derivatives of qdd in the direction of each of (q, v), from balls; a
            rotation moves about the body's axes.
        mass: (nv, nv).
        rotating: (nv) 1 for an angle, 0 for a length.
        sensitivity: (2 nv) per column, the sum over all inputs z of |d(column)/dz z|_M.
        difference_roundoff: (2 nv) per column, what is left of a central difference of accelerations [in the energy norm].
    """

    q: Array
    tau: Array
    slopes: Array
    thirds: Array
    mass: Array
    rotating: Array
    sensitivity: Array
    difference_roundoff: Array


@dataclass(frozen=True)
class Case:
    """A system, its equations compiled, and its states, velocities as one engine gives them."""

    mechanism: Mechanism
    system: System
    linear_velocity_in_body: bool

    @cached_property
    def _reference(self) -> ReferenceKernel:
        return ReferenceKernel(self.mechanism, self.linear_velocity_in_body)

    @cached_property
    def _charts(self) -> Charts:
        return Charts(self.mechanism.charts(self.linear_velocity_in_body))

    @cached_property
    def _kernels(self) -> list[Float64Kernel]:
        return list(map(Float64Kernel, self._charts.programs))

    def kernel(self, states: States) -> Float64Kernel:
        """That of the chart whose worst state is best."""
        return self._kernels[int(self._charts.regularity(states.q).min(axis=1).argmax())]

    @cached_property
    def states(self) -> States:
        return generic_sample(self.mechanism, COUNT, zlib.crc32(self.mechanism.name.encode()))

    @property
    def rotating(self) -> Array:
        return np.array(self.mechanism.rotating, dtype=np.float64)

    @cached_property
    def terms(self) -> dict[str, Array]:
        return self.kernel(self.states).terms(self.mechanism.inputs(self.states))

    @cached_property
    def kinetic(self) -> list[float]:
        """v' M v / 2 at each state, which tests/systems/test_properties.py holds against T."""
        evaluate = BallKernel(self.kernel(self.states).program, len(self.mechanism.parameters)).bind(self.mechanism.parameter_values)
        found = []
        for index in range(COUNT):
            v = [flint.arb(rate) for rate in self.states.v[index].tolist()]
            mass = evaluate(*self.states.q[index], *self.states.v[index], *self.states.tau[index], 0.0)
            twice = (entry * v[i] * v[j] * (1 + (i != j)) for entry, (i, j) in zip(mass, upper_triangle(len(v)), strict=False))
            found.append(float(sum(twice, flint.arb(0)) / 2))
        return found

    @cached_property
    def potential(self) -> list[tuple[flint.arb, float]]:
        """At each state: V, from the system file in balls, and the sum over all inputs z of |dV/dz z|."""
        evaluate = BallKernel(potential_program(self.system), 0).bind(())
        nudge = flint.arb(2) ** -60
        found = []
        for index in range(COUNT):
            inputs = [flint.arb(x) for x in (*self.states.q[index], 0.0, *self.mechanism.parameter_values)]
            (potential,) = evaluate(*inputs)
            moved = [evaluate(*inputs[:k], value * (1 + nudge), *inputs[k + 1 :])[0] for k, value in enumerate(inputs)]
            found.append((potential, sum(abs(float((other - potential) / nudge)) for other in moved)))
        return found

    @cached_property
    def linearisations(self) -> list[Linearisation]:
        """At the zero configuration, where the system has one that is not singular, and at a sampled one."""
        nv, ranges = self.mechanism.nv, self.mechanism.position_ranges
        rest = np.zeros((1, nv))
        zero, sampled = np.zeros(self.mechanism.nq), self.states.q[0].copy()
        rotations = [entry for first in self._rotations for entry in range(first, first + 4)]
        zero[self._rotations] = 1.0
        sampled = np.where(np.isin(np.arange(len(sampled)), rotations), sampled, np.round(sampled / GRID) * GRID)
        configurations = [sampled]
        in_range = all(low <= 0 <= high for low, high in (bounds or ANGLES for bounds in ranges))
        if in_range and self._certify(zero[None], rest, rest).certified[0]:
            configurations.insert(0, zero)
        return [self._linearise(q) for q in configurations]

    @property
    def _rotations(self) -> list[int]:
        """Where in q quaternions begin."""
        return [place + number for number, place in enumerate(self.mechanism.attitudes)]

    def _certify(self, q: Array, v: Array, tau: Array) -> Reference:
        return self._reference.evaluate(States.at(q, v, tau))

    def _linearise(self, q: Array) -> Linearisation:
        nv, rest = self.mechanism.nv, np.zeros(self.mechanism.nv)
        kernel = self.kernel(States.at(q, rest, rest))
        terms = kernel.terms(self.mechanism.inputs(States.at(q, rest, rest)))
        tau = (terms["gravity"] + terms["velocity"] - terms["passive"])[0]

        evaluate = BallKernel(kernel.program, len(self.mechanism.parameters)).bind(self.mechanism.parameter_values)
        step = flint.arb(2) ** -DERIVATIVE_BITS
        slopes, thirds = np.empty((nv, 2 * nv)), np.empty((nv, 2 * nv))
        for column in range(2 * nv):
            at = {}
            for multiple in (-2, -1, 1, 2):
                positions, rates = self._moved([flint.arb(x) for x in q.tolist()], column, multiple * step, flint.arb)
                at[multiple] = self._acceleration(evaluate, positions, rates, tau)
            for i in range(nv):
                slopes[i, column] = float((8 * (at[1][i] - at[-1][i]) - (at[2][i] - at[-2][i])) / (12 * step))
                thirds[i, column] = float((at[2][i] - 2 * at[1][i] + 2 * at[-1][i] - at[-2][i]) / (2 * step**3))

        steps = [self._moved(q.tolist(), column, sign * DIFFERENCE_STEP, float) for sign in (1, -1) for column in range(2 * nv)]
        moved = self._certify(np.array([x for x, _ in steps]), np.array([v for _, v in steps]), np.broadcast_to(tau, (4 * nv, nv)))
        assert moved.certified.all()
        # Solving with a factorised M may lose what an ill-conditioned M lets it lose: the harness's verdict "unstable".
        roundoff = UNIT_ROUNDOFF * np.maximum(BAR * moved.sensitivity, moved.instability)
        of_difference = roundoff.reshape(2, -1).sum(axis=0) / (2 * DIFFERENCE_STEP)
        return Linearisation(q, tau, slopes, thirds, terms["mass"][0], self.rotating, self._sensitivity(kernel, q, tau), of_difference)

    def _moved(self, q: list[Any], column: int, step: Any, number: Any) -> tuple[list[Any], list[Any]]:
        """Positions, and velocities from rest, after a step along one of (q, v); a rotation turns about an axis of the body."""
        nv = self.mechanism.nv
        rates = [number(0)] * nv
        positions = list(q)
        if column >= nv:
            rates[column - nv] = step
            return positions, rates
        names = list(self.mechanism.joints)
        for first, place in zip(self._rotations, self.mechanism.attitudes, strict=True):
            if place <= column < place + 3:
                angle = step / 2
                cosine, sine = (angle.cos(), angle.sin()) if number is flint.arb else (np.cos(angle), np.sin(angle))
                turn = [cosine, *(sine if axis == column - place else 0 * sine for axis in range(3))]
                positions[first : first + 4] = quaternion_product(q[first : first + 4], turn)
                return positions, rates
            if self.linear_velocity_in_body and names[column] == names[place] and column < place:
                w, x, y, z = q[first : first + 4]
                along = [0, *(step if axis == column - place + 3 else 0 for axis in range(3))]
                turned = quaternion_product(quaternion_product([w, x, y, z], along), [w, -x, -y, -z])
                norm = w * w + x * x + y * y + z * z
                for axis in range(3):
                    positions[first - 3 + axis] = q[first - 3 + axis] + turned[1 + axis] / norm
                return positions, rates
        positions[column + sum(place + 3 <= column for place in self.mechanism.attitudes)] += step
        return positions, rates

    def _acceleration(self, evaluate: Any, positions: list[Any], rates: list[Any], tau: Array) -> list[flint.arb]:
        nv = self.mechanism.nv
        pairs = upper_triangle(nv)
        values = evaluate(*positions, *rates, *tau.tolist(), 0.0)
        entries = dict(zip(pairs, values[: len(pairs)], strict=True))
        mass = flint.arb_mat([[entries[min(i, j), max(i, j)] for j in range(nv)] for i in range(nv)])
        velocity, gravity, passive = (values[len(pairs) + k * nv : len(pairs) + (k + 1) * nv] for k in range(3))
        force = [[flint.arb(tau[i]) + passive[i] - velocity[i] - gravity[i]] for i in range(nv)]
        return mass.solve(flint.arb_mat(force)).entries()

    def _sensitivity(self, kernel: Float64Kernel, q: Array, tau: Array) -> Array:
        """Central differences in float64 over all inputs at once: two digits of it are enough."""
        nv, nq, relative = self.mechanism.nv, self.mechanism.nq, 2.0**-12
        state = self.mechanism.inputs(States.at(q, np.zeros(nv), tau))
        nudge = relative * np.eye(len(state))
        inputs = np.ascontiguousarray(np.hstack([state * (1 + nudge), state * (1 - nudge)]))
        masses = kernel.terms(inputs)["mass"]
        encoded = encode(kernel.program)
        assert encoded is not None
        partial = derivatives(encoded, inputs.T, kernel.accelerations(inputs).T)[0][:, :, : nq + nv]
        # d(positions)/d(steps): linear in the positions, so that a step of 1 from them gives it.
        tangents = np.array([self._tangent(column) for column in inputs[:nq].T])
        partial = np.concatenate([partial[:, :, :nq] @ tangents, partial[:, :, nq:]], axis=2)
        ahead, back = np.split(np.linalg.solve(masses, partial), 2)
        return energy_norms(kernel.terms(state)["mass"][0], (ahead - back) / (2 * relative)).sum(axis=0)

    def _tangent(self, q: Array) -> Array:
        """d(positions)/d(step) for each velocity, (nq, nv)."""
        step = 2.0**-20
        ahead, back = ([self._moved(q.tolist(), column, sign * step, float)[0] for column in range(self.mechanism.nv)] for sign in (1, -1))
        return (np.array(ahead) - np.array(back)).T / (2 * step)


def quaternion_product(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    (p, x, y, z), (q, u, v, w) = a, b
    return [p * q - x * u - y * v - z * w, p * u + x * q + y * w - z * v, p * v + y * q + z * u - x * w, p * w + z * q + x * v - y * u]


def potential_program(system: System) -> StraightLineProgram:
    """V of positions, time and parameters; Euler angles come from the quaternion of a ball or free joint."""
    coordinates = list(system.coordinates)
    q = [sp.Symbol(f"q{i}", real=True) for i in range(len(coordinates))]
    positions = [[symbol] for symbol in q]
    of_angles: dict[sp.Expr, sp.Expr] = {}
    for attitude in system.attitudes:
        first = coordinates.index(attitude.angles[0])
        quaternion = sp.symbols(f"quaternion{first}_0:4", real=True)
        positions[first : first + 3] = [list(quaternion), [], []]
        pairs, _ = sines_and_cosines(attitude.sequence, sp.Quaternion(*quaternion).to_rotation_matrix())
        for angle, (sine, cosine) in zip(q[first : first + 3], pairs, strict=True):
            of_angles |= {sp.sin(angle): sine, sp.cos(angle): cosine}
    potential = system.potential.xreplace(dict(zip(coordinates, q, strict=True))).xreplace(of_angles)
    inputs = [*(symbol for part in positions for symbol in part), TIME, *system.parameters]
    return assemble(inputs, {"potential": [potential]})


def energy_norms(mass: Array, columns: Array) -> Array:
    """|x|_M of every column of one or many matrices."""
    scale = np.sqrt(mass.diagonal())
    factor = np.linalg.cholesky(mass / scale / scale[:, None]).T * scale
    return np.linalg.norm(factor @ columns, axis=-2)


@pytest.fixture(autouse=True)
def precision() -> Iterator[None]:
    previous, flint.ctx.prec = flint.ctx.prec, BITS
    yield
    flint.ctx.prec = previous


@pytest.fixture(scope="session", params=TREES)
def tree_name(request: pytest.FixtureRequest) -> str:
    """Forces that constraints exert are held against accelerations in ``test_constraints``; energies stand in the equations' own tests."""
    return str(request.param)


@pytest.fixture(scope="session")
def tree_mechanism(tree_name: str) -> Mechanism:
    return load_mechanism(CALLED_HERE, tree_name)


@pytest.fixture(scope="session", params=PROBES, ids=str)
def subject(request: pytest.FixtureRequest) -> Subject:
    return request.param


@pytest.fixture(scope="session")
def cases() -> dict[tuple[str, bool], Case]:
    """What the engines share."""
    return {}


@pytest.fixture
def case(tree_mechanism: Mechanism, subject: Subject, cases: dict[tuple[str, bool], Case]) -> Case:
    in_body = load_engine(CALLED_HERE, subject.engine).linear_velocity_in_body and bool(tree_mechanism.charts_in_body)
    key = tree_mechanism.name, in_body
    if key not in cases:
        cases[key] = Case(tree_mechanism, system_of(tree_mechanism.name), in_body)
    return cases[key]


@pytest.fixture
def probe(case: Case, subject: Subject) -> Probe:
    library, mechanism = CALLED_HERE, case.mechanism
    file = read_model(library.model_path(mechanism.name, subject.format), subject.format)
    # An engine's own quantities have neither dry friction nor limits.
    return PROBES[subject](load_audited(Assignment(library, subject, smooth(mechanism), file)))


def test_inverse_dynamics_undo_forward_dynamics(case: Case, probe: Probe) -> None:
    """The forces that an engine says its own accelerations need are those it was given.

    Solving M x = b by L D L' leaves |b - M x|_i <= a few u sqrt(M_ii) sum_j sqrt(M_jj) |x_j| (Higham, theorem
    10.4, with |L| D |L'| bounded by Cauchy-Schwarz), however ill-conditioned M is. The other forces enter by
    their sizes, centripetal ones by twice the kinetic energy (see ``harness.truth.reference``).
    """
    states = case.states
    terms = case.terms
    accelerations = probe.accelerations(states)
    for index in range(COUNT):
        root = np.sqrt(terms["mass"][index].diagonal())
        twice_kinetic = states.v[index] @ terms["mass"][index] @ states.v[index]
        size = root * (root @ np.abs(accelerations[index])) + np.abs(states.tau[index]) + case.rotating * twice_kinetic
        size += sum(np.abs(terms[name][index]) for name in ("velocity", "gravity", "passive"))
        found = probe.applied_forces(states.q[index], states.v[index], accelerations[index])
        error = np.abs(found - states.tau[index])
        assert (error <= BAR * UNIT_ROUNDOFF * size).all(), (error / (UNIT_ROUNDOFF * size), states.as_json(index))


def test_energies_are_those_of_the_textbook(case: Case, probe: Probe) -> None:
    """T, and differences of V between states, with springs and tendons.

    T is summed from M_ij v_i v_j, each at most sqrt(M_ii M_jj) |v_i v_j|; V may move by what one unit roundoff does to it.
    """
    states = case.states
    masses = case.terms["mass"]
    found = [probe.energies(states.q[index], states.v[index]) for index in range(COUNT)]
    for index in range(COUNT):
        potential, sensitivity = case.potential[index]
        size = (np.sqrt(masses[index].diagonal()) @ np.abs(states.v[index])) ** 2 / 2
        rise = flint.arb(found[index][1]) - flint.arb(found[0][1])
        exact = potential - case.potential[0][0]
        sensitivity += case.potential[0][1]
        assert abs(found[index][0] - case.kinetic[index]) <= BAR * UNIT_ROUNDOFF * size, states.as_json(index)
        assert abs(float(rise - exact)) <= BAR * UNIT_ROUNDOFF * sensitivity, states.as_json(index)


def test_derivatives_and_frequencies_are_those_of_the_equations(case: Case, probe: Probe) -> None:
    """M0, D0 and K0 of the equations, as dqdd/dq = -M0^-1 K0 and dqdd/dv = -M0^-1 D0, against the engine's own.

    With M0 = L L', the squared frequencies are the eigenvalues of L^-1 K0 L^-T = -L' (dqdd/dq) L^-T, symmetric where
    forces have a potential. They move by no more than its norm does (Weyl), which is at most that of each column's
    error, in the energy norm, times that of the row of L^-T that it meets.
    """
    for at in case.linearisations:
        nv = case.mechanism.nv
        found = np.hstack(probe.derivatives(at.q, at.tau))
        errors, allowed = energy_norms(at.mass, found - at.slopes), probe.allowed_errors(at)
        assert (errors <= allowed).all(), (errors, allowed, at.q)

        factor = np.linalg.cholesky(at.mass)
        inverse = np.linalg.inv(factor).T
        stiffnesses = [-factor.T @ slopes[:, :nv] @ inverse for slopes in (found, at.slopes)]
        squared, exact = (np.linalg.eigvalsh((stiffness + stiffness.T) / 2) for stiffness in stiffnesses)
        # The transformation to L^-1 K0 L^-T rounds here, too.
        rounding = BAR * UNIT_ROUNDOFF * np.linalg.norm(np.abs(factor.T) @ np.abs(at.slopes[:, :nv]) @ np.abs(inverse))
        assert np.abs(squared - exact).max() <= allowed[:nv] @ np.linalg.norm(inverse, axis=1) + rounding, (squared, exact)


@pytest.mark.ci
@pytest.mark.parametrize("huge", [1e3, 1e8, 1e15])
def test_large_angles_cost_the_equations_no_digits(huge: float) -> None:
    """They add angles before the sine, where a large one would round the next one's digits away."""
    mechanism = load_mechanism(Library.built_in(), "chain_12")
    q = [0.0, huge, 0.0, 1.6, 0.0, 4.7, 0.0, 0.0, 2.6, 0.0, 0.0, 0.0]
    tau = [0.0] * 9 + [100.0, 0.0, 0.0]
    states = States.at(q, np.zeros(12), tau)
    model = load_engine(Library.built_in(), "lagrange").load(mechanism, mechanism.joints, mechanism.gravity)
    answer = model.forward_dynamics(states.q, states.v, states.tau)
    assert set(compare(ReferenceKernel(mechanism).evaluate(states), answer).verdicts) == {"agrees"}
