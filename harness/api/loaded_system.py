"""A mechanism or a robot for scripts and notebooks: its equations in SymPy, certified accelerations, and what else controllers take."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np

from harness.api.described_system import DescribedSystem
from harness.api.motion import SimulatedMotion
from harness.arrays import Array
from harness.crosscheck.scene import with_parameters
from harness.engines import NotOffered
from harness.errors import InvalidRequest
from harness.lagrange.derivation import with_values_of
from harness.library import nearest
from harness.motion.taylor import Taylor
from harness.motion.trajectories import Start, energy_drift
from harness.programs.mechanisms.mechanism import Mechanism, controls_of
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.storage import Kept
from harness.truth.blocks import BIAS, INVERSE_DYNAMICS, MASS_MATRIX, EquationValues
from harness.truth.compare import Comparison, Flags, compare
from harness.truth.quantities.accelerations import reference_kernel, with_all
from harness.truth.quantities.derivatives import FORWARD, DerivativeTruth
from harness.truth.reference import Reference

# By mechanism, compiled when they are asked first.
_DERIVATIVES: Kept[DerivativeTruth] = Kept(64)
_EQUATIONS: Kept[EquationValues] = Kept(64)


@dataclass(frozen=True)
class CertifiedValues:
    """Certified values at n states, each entry by itself.

    Attributes:
        value: (n, nv, nv) of a matrix, (n, nv) of forces; the float64 nearest to the truth [SI].
        error_bound: of the same shape; the truth is certainly no farther from ``value`` than this; inf where nothing could be certified.
        data_roundoff: of the same shape; how far the truth moves when every input moves by 2^-53 of itself.
        certified: (n,) whether the truth is known far below its data roundoff.
    """

    value: Array
    error_bound: Array
    data_roundoff: Array
    certified: Flags


@dataclass(frozen=True)
class Accelerations(CertifiedValues):
    """Certified accelerations of n states; attributes as of ``CertifiedValues``, in SI units per s^2.

    Their ``data_roundoff``, (n,), is in the energy norm [sqrt(J)/s].
    """


@dataclass(frozen=True)
class Derivatives:
    """Certified derivatives of the accelerations of n states; rows are those of accelerations.

    Attributes:
        by_position, by_velocity, by_force: (n, nv, nv) the float64 nearest to the truth. Those by positions are along the velocities: of a
            ball or free joint by turns about the axes of its body, and by displacements along the axes of its parent.
        error_bound: (n, 3, nv, nv) the truth is certainly no farther from the three than this; inf where nothing could be certified.
        data_roundoff: (n, 3, nv) how far each column moves, in the energy norm, when every input moves by 2^-53 of itself.
        certified: (n,) whether the truth is known far below its data roundoff.
    """

    by_position: Array
    by_velocity: Array
    by_force: Array
    error_bound: Array
    data_roundoff: Array
    certified: Flags


@dataclass(eq=False, repr=False)
class LoadedSystem(DescribedSystem):
    """A textbook mechanism or a robot, ready to be read and evaluated; ``harness.load`` makes it.

    Its joints are in the order of q, v, tau and qdd. What it is, stands in ``DescribedSystem``.

    Examples:
        >>> import harness
        >>> pendulum = harness.load("simple_pendulum")
        >>> pendulum.accelerations(q=[0.5], v=[0.0]).value.round(6)
        array([[-2.351582]])
    """

    def with_parameters(self, changed: Mapping[str, float] | None = None, /, **values: float) -> LoadedSystem:
        """The same system with other values of some parameters, as ``with_parameters(m=2.0)`` or ``with_parameters({"m": 2.0})``.

        Raises:
            harness.errors.InvalidRequest: no parameter has such a name, or the value is not what its symbol is declared to be.

        Examples:
            >>> import harness
            >>> pendulum = harness.load("simple_pendulum")
            >>> pendulum.with_parameters(g=1.62).accelerations([0.5], [0.0]).value.round(6)
            array([[-0.388335]])
        """
        chosen = {**(changed or {}), **values}
        for name, value in chosen.items():
            if name not in self.parameters:
                raise InvalidRequest(f"{self.name} has no parameter {name!r}; {nearest(name, self.parameters)}")
            if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
                raise InvalidRequest(f"{self.name}: parameter {name} is {value!r}; expected a finite number")
        numbers = {name: float(value) for name, value in chosen.items()}
        system, mechanism = None, with_parameters(self.mechanism, numbers)
        if self.mechanism.energy_programs:
            own = self.system.parameters
            parameters = {symbol: (numbers.get(symbol.name, value), unit) for symbol, (value, unit) in own.items()}
            try:
                system = replace(self.system, parameters=parameters)
                mechanism = with_values_of(self.mechanism, system)
            except ValueError as contradiction:
                raise InvalidRequest(f"{self.name}: {contradiction}") from contradiction
        return LoadedSystem(self.library, mechanism, system, {**self.changed, **numbers})

    def simulate(self, q: Any, v: Any, seconds: float, steps: int = 1000) -> SimulatedMotion:
        """The motion from one state without applied forces, by Taylor's method at machine precision; limits and contacts are not felt.

        Args:
            q: (nq,) [m, rad; a rotation as (w, x, y, z)]. v: (nv,). Where constraints determine a coordinate or its rate, it gets the
                value that they give it. seconds: length of the motion. steps: number of equal intervals between its times.

        Raises:
            ValueError: the sizes are not those of the mechanism, or there is no time to go.
            harness.errors.InvalidRequest: no configuration closes the constraints there, or the motion cannot be followed to its end.

        Examples:
            >>> import harness
            >>> motion = harness.load("double_pendulum").simulate(q=[0.5, 0.0], v=[0.0, 0.0], seconds=10.0)
            >>> motion.q.shape, bool(abs(motion.energy_drift).max() < 1e-13)
            ((1001, 2), True)
        """
        states = _states(self.mechanism, q, v, None)
        if len(states) != 1:
            raise ValueError(f"q and v have {len(states)} rows; a motion starts from one state")
        if not (np.isfinite(states.q).all() and np.isfinite(states.v).all()):
            raise ValueError(f"q and v are {states.q[0].tolist()} and {states.v[0].tolist()}; expected finite numbers")
        if not 0 < seconds < math.inf or steps < 1:
            raise ValueError(f"seconds is {seconds!r} and steps {steps!r}; expected a positive time and at least one step")
        try:
            start = Start.closing(self.mechanism, states.q[0], states.v[0], seconds)
        except ValueError as problem:
            raise InvalidRequest(str(problem)) from problem
        path = self._taylor.solve(start.q, start.v, np.linspace(0.0, seconds, steps + 1))
        known = np.isfinite(np.hstack([path.q, path.v])).all(axis=1)
        if not known.all():
            last = float(path.times[known.argmin() - 1])
            raise InvalidRequest(
                f"{self.name}: the motion cannot be followed beyond {last:g} s, where its accelerations grow without bound"
            )
        return SimulatedMotion(self.mechanism, path.times, path.q, path.v, energy_drift(self.mechanism, path))

    @cached_property
    def _taylor(self) -> Taylor:
        return Taylor(self.mechanism)

    def accelerations(self, q: Any, v: Any, tau: Any = None, control: Any = None) -> Accelerations:
        """Certified accelerations at one state, or at n states as rows.

        Args:
            q: (nq,) or (n, nq) [m, rad; a rotation as (w, x, y, z)]. v: (nv,) or (n, nv). tau: applied forces like v; none for None.
            control: (actuators,) or (n, actuators), in the order of the system's; 0 for None.

        Raises:
            ValueError: the sizes are not those of the mechanism.

        Examples:
            >>> import harness
            >>> truth = harness.load("double_pendulum").accelerations(q=[0.1, 0.2], v=[1.0, 0.0])
            >>> truth.value.round(6)
            array([[ 0.400258, -2.292996]])
            >>> bool((truth.error_bound < 1e-15).all())
            True
        """
        reference = reference_kernel(with_all(self.mechanism), False).evaluate(_states(self.mechanism, q, v, tau, control))
        return Accelerations(reference.high, _error_bound(reference), reference.data_roundoff, reference.certified)

    def derivatives(self, q: Any, v: Any, tau: Any = None) -> Derivatives:
        """Certified derivatives of the accelerations by q, v and tau; arguments as of ``accelerations``.

        Raises:
            ValueError: the sizes are not those of the mechanism.
            harness.errors.InvalidRequest: constraints tie its coordinates.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").derivatives(q=[0.0], v=[0.0]).by_position
            array([[[-4.905]]])
        """
        states, nv = _states(self.mechanism, q, v, tau), self.mechanism.nv
        try:
            truth = _DERIVATIVES.get(self.mechanism.key, lambda: DerivativeTruth(FORWARD, self.mechanism, linear_velocity_in_body=False))
        except NotOffered as reason:
            raise InvalidRequest(f"{self.name}: {reason}") from reason
        found = truth.evaluate(states)
        shape = (len(states), 3, nv, nv)
        bound = np.abs(found.low) + _reach(found.norm_factor)[:, None] * found.radius[:, :, None]
        bound = np.where(found.certified[:, None, None], bound * (1 + 1e-6), np.inf)
        # Blocks are columns.
        matrices, bounds = (blocks.reshape(shape).transpose(0, 1, 3, 2) for blocks in (found.high, bound))
        data_roundoff = UNIT_ROUNDOFF * found.sensitivity.reshape(shape[:3])
        by_position, by_velocity, by_force = matrices.transpose(1, 0, 2, 3)
        return Derivatives(by_position, by_velocity, by_force, bounds, data_roundoff, found.certified)

    def mass_matrix(self, q: Any) -> CertifiedValues:
        """Certified mass matrix, with reflected inertias; under constraints that of the tree which is left without them.

        Args:
            q: (nq,) or (n, nq), as for ``accelerations``.

        Raises:
            ValueError: the size is not that of the mechanism.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").mass_matrix(q=[0.3]).value
            array([[[6.]]])
        """
        still = np.zeros((len(np.atleast_2d(q)), self.mechanism.nv))
        return _entries(self.mechanism, MASS_MATRIX, _states(self.mechanism, q, still, None))

    def bias(self, q: Any, v: Any) -> CertifiedValues:
        """Certified velocity terms and gravity together, without springs and dampers; under constraints as ``mass_matrix``.

        Args:
            q: as for ``accelerations``.
            v: likewise.

        Raises:
            ValueError: the sizes are not those of the mechanism.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").bias(q=[0.5], v=[1.0]).value.round(6)
            array([[14.109494]])
        """
        return _entries(self.mechanism, BIAS, _states(self.mechanism, q, v, None))

    def inverse_dynamics(self, q: Any, v: Any, qdd: Any) -> CertifiedValues:
        """Certified applied forces that give these accelerations, beside springs and dampers.

        Args:
            q: as for ``accelerations``.
            v: likewise.
            qdd: accelerations like v.

        Raises:
            harness.errors.InvalidRequest: under constraints any force that these bear may be added.
            ValueError: the sizes are not those of the mechanism.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").inverse_dynamics(q=[0.5], v=[0.0], qdd=[0.0]).value.round(6)
            array([[14.109494]])
        """
        if self.mechanism.constraints is not None:
            raise InvalidRequest(f"{self.name} has constraints, under which accelerations do not determine the applied forces")
        return _entries(self.mechanism, INVERSE_DYNAMICS, _states(self.mechanism, q, v, qdd))

    def compare(self, q: Any, v: Any, accelerations: Any, tau: Any = None, control: Any = None, *, factorises: bool = False) -> Comparison:
        """Hold anybody's accelerations, (nv,) or (n, nv), at these states against the truth; arguments as of ``accelerations``.

        ``factorises`` says that they were solved for by a factorisation of M, which loses digits as M's condition grows.

        Raises:
            ValueError: the sizes are not those of the mechanism.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").compare(q=[0.5], v=[0.0], accelerations=[-2.351582])
            the answer does not agree with the truth; the largest backward error is 3.51e+08 data roundoffs, and up to 64 agrees
            state  verdict    backward error  relative error
                0  disagrees        3.51e+08        1.13e-07
        """
        answers = np.atleast_2d(np.asarray(accelerations, dtype=np.float64))
        states = _states(self.mechanism, q, v, tau, control)
        return compare(reference_kernel(with_all(self.mechanism), False).evaluate(states), answers, factorises)


def _states(mechanism: Mechanism, q: Any, v: Any, tau: Any, control: Any = None) -> States:
    states = States.at(q, v, np.zeros_like(np.asarray(v, dtype=np.float64)) if tau is None else tau, control=control)
    count = controls_of(mechanism)
    if control is not None and states.control.shape != (len(states), count):
        wanted = f"{mechanism.name} has {count} actuators, and there are {len(states)} states"
        raise ValueError(f"control has shape {states.control.shape}; {wanted}")
    found, expected = (states.q.shape, states.v.shape, states.tau.shape), (mechanism.nq, mechanism.nv, mechanism.nv)
    if tuple(shape[1] for shape in found) != expected or len({shape[0] for shape in found}) != 1:
        raise ValueError(f"q, v and tau have shapes {found}; {mechanism.name} has {expected} numbers of each, as many rows of each")
    return states


def _entries(mechanism: Mechanism, name: str, states: States) -> CertifiedValues:
    """Values of ``EquationValues``, each of whose entries is a block of its own."""
    found = _EQUATIONS.get(mechanism.key, lambda: EquationValues(reference_kernel(mechanism, False))).evaluate(name, states)
    shape = len(states), *[mechanism.nv] * (2 if name == MASS_MATRIX else 1)
    bound = np.where(found.certified[:, None], (np.abs(found.low[:, :, 0]) + found.radius) * (1 + 1e-6), np.inf)
    value, bound, roundoff = (entries.reshape(shape) for entries in (found.high, bound, UNIT_ROUNDOFF * found.sensitivity))
    return CertifiedValues(value, bound, roundoff, found.certified)


def _error_bound(reference: Reference) -> Array:
    """Per coordinate: the part of the midpoint that float64 does not hold, and the radius.

    |x_i| <= |x|_M |row i of R^-1|, with R the factor of M (Cauchy and Schwarz). The radius carries all digits that matter, so
    the last factor covers the roundings of this bound.
    """
    bound = (np.abs(reference.low) + _reach(reference.norm_factor) * reference.radius[:, None]) * (1 + 1e-6)
    return np.where(reference.certified[:, None], bound, np.inf)


def _reach(norm_factor: Array) -> Array:
    """Largest size of each component of a vector of energy norm 1, (n, nv)."""
    inverse = np.linalg.inv(np.where(np.isfinite(norm_factor), norm_factor, np.eye(norm_factor.shape[1])))
    return np.asarray(np.sqrt((inverse**2).sum(axis=2)))
