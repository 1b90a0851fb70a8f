"""A mechanism or a robot for scripts and notebooks: its equations in SymPy, certified accelerations, and what else controllers take."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import NotOffered
from harness.errors import InvalidRequest
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.storage import Kept
from harness.truth.blocks import BIAS, INVERSE_DYNAMICS, MASS_MATRIX, EquationValues
from harness.truth.compare import Comparison, Flags, compare
from harness.truth.quantities.accelerations import reference_kernel
from harness.truth.quantities.derivatives import FORWARD, DerivativeTruth
from harness.truth.reference import Reference

if TYPE_CHECKING:
    import sympy as sp

    from harness.lagrange.equations import EquationsOfMotion

# By mechanism, compiled when they are asked first.
_DERIVATIVES: Kept[DerivativeTruth] = Kept(64)
_EQUATIONS: Kept[EquationValues] = Kept(64)


@dataclass(frozen=True)
class CertifiedValues:
    """Certified values at n states, each entry by itself.

    Attributes:
        value: (n, nv, nv) of a matrix, (n, nv) of forces; the float64 nearest to the truth [SI].
        error_bound: of the same shape; the truth is certainly no farther from ``value`` than this; inf where nothing could be certified.
        data_roundoff: of the same shape; how far the truth moves when every input moves by half an ulp.
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
        data_roundoff: (n, 3, nv) how far each column moves, in the energy norm, when every input moves by half an ulp.
        certified: (n,) whether the truth is known far below its data roundoff.
    """

    by_position: Array
    by_velocity: Array
    by_force: Array
    error_bound: Array
    data_roundoff: Array
    certified: Flags


@dataclass(eq=False, repr=False)
class LoadedSystem:
    """A textbook mechanism or a robot, ready to be read and evaluated; ``harness.load`` makes it.

    Attributes:
        mechanism: its plain data: coordinates, joints, parameters, ranges. library: where it is from.
    """

    library: Library
    mechanism: Mechanism

    @property
    def name(self) -> str:
        return self.mechanism.name

    def __repr__(self) -> str:
        coordinates = ", ".join(f"{name} ({joint})" for name, joint in zip(self.mechanism.coordinates, self.mechanism.joints, strict=True))
        return f"<{self.name}: {coordinates}>"

    @cached_property
    def equations(self) -> EquationsOfMotion:
        """M qdd + c + g = p + tau in SymPy: ``mass_matrix``, ``velocity_terms``, ``gravity_terms``, ``passive_forces``.

        Under constraints ``constraint_rows`` stay zero, and -J' lambda with J the ``constraint_jacobian`` is added on the right.

        Raises:
            harness.errors.InvalidRequest: a robot has none.
        """
        if not self.mechanism.energy_programs:
            program = f"a program of {self.mechanism.operations:,} operations, by recursion over its bodies"
            raise InvalidRequest(f"{self.name} is a robot, whose equations are {program}; its accelerations can be had")
        from harness.lagrange.derivation import load_system
        from harness.lagrange.equations import derive

        system, _ = load_system(self.library.system_path(self.name))
        return derive(system)

    @property
    def M(self) -> sp.Matrix:  # noqa: N802
        """The mass matrix, (nv, nv)."""
        return self.equations.mass_matrix

    @cached_property
    def C(self) -> sp.Matrix:  # noqa: N802
        """The Coriolis matrix of Christoffel symbols, (nv, nv); C v are the velocity terms of a T quadratic in the rates."""
        return self.equations.christoffel_matrix()

    @property
    def g(self) -> sp.Matrix:
        """The gravity terms, (nv, 1)."""
        return self.equations.gravity_terms

    @cached_property
    def latex(self) -> str:
        """The equations of motion, one per coordinate, as LaTeX."""
        import sympy as sp

        from harness.lagrange.equations import rows

        lines = [sp.latex(row).replace("=", "&=", 1) for row in rows(self.equations)]
        return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"

    def _repr_latex_(self) -> str | None:
        if not self.mechanism.energy_programs:
            return None
        return f"$${self.latex}$$"

    def accelerations(self, q: Any, v: Any, tau: Any = None) -> Accelerations:
        """Certified accelerations at one state, or at n states as rows.

        Args:
            q: (nq,) or (n, nq) [m, rad; a rotation as (w, x, y, z)]. v: (nv,) or (n, nv). tau: applied forces like v; none for None.

        Raises:
            ValueError: the sizes are not those of the mechanism.
        """
        reference = reference_kernel(self.mechanism, False).evaluate(_states(self.mechanism, q, v, tau))
        return Accelerations(reference.high, _error_bound(reference), reference.data_roundoff, reference.certified)

    def derivatives(self, q: Any, v: Any, tau: Any = None) -> Derivatives:
        """Certified derivatives of the accelerations by q, v and tau; arguments as of ``accelerations``.

        Raises:
            ValueError: the sizes are not those of the mechanism.
            harness.errors.InvalidRequest: constraints tie its coordinates.
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
        """
        still = np.zeros((len(np.atleast_2d(q)), self.mechanism.nv))
        return _entries(self.mechanism, MASS_MATRIX, _states(self.mechanism, q, still, None))

    def bias(self, q: Any, v: Any) -> CertifiedValues:
        """Certified velocity terms and gravity together, without springs and dampers; under constraints as ``mass_matrix``.

        Args:
            q, v: as for ``accelerations``.

        Raises:
            ValueError: the sizes are not those of the mechanism.
        """
        return _entries(self.mechanism, BIAS, _states(self.mechanism, q, v, None))

    def inverse_dynamics(self, q: Any, v: Any, qdd: Any) -> CertifiedValues:
        """Certified applied forces that give these accelerations, beside springs and dampers.

        Args:
            q, v: as for ``accelerations``. qdd: accelerations like v.

        Raises:
            harness.errors.InvalidRequest: under constraints any force that these bear may be added.
            ValueError: the sizes are not those of the mechanism.
        """
        if self.mechanism.constraints is not None:
            raise InvalidRequest(f"{self.name} has constraints, under which accelerations do not determine the applied forces")
        return _entries(self.mechanism, INVERSE_DYNAMICS, _states(self.mechanism, q, v, qdd))

    def compare(self, q: Any, v: Any, accelerations: Any, tau: Any = None, *, factorises: bool = False) -> Comparison:
        """Hold anybody's accelerations, (nv,) or (n, nv), at these states against the truth.

        ``factorises`` says that they were solved for by a factorisation of M, which loses digits as M's condition grows.

        Raises:
            ValueError: the sizes are not those of the mechanism.
        """
        answers = np.atleast_2d(np.asarray(accelerations, dtype=np.float64))
        return compare(reference_kernel(self.mechanism, False).evaluate(_states(self.mechanism, q, v, tau)), answers, factorises)


def _states(mechanism: Mechanism, q: Any, v: Any, tau: Any) -> States:
    states = States.at(q, v, np.zeros_like(np.asarray(v, dtype=np.float64)) if tau is None else tau)
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
    """How large each component of a vector of energy norm 1 can be, (n, nv)."""
    inverse = np.linalg.inv(np.where(np.isfinite(norm_factor), norm_factor, np.eye(norm_factor.shape[1])))
    return np.asarray(np.sqrt((inverse**2).sum(axis=2)))
