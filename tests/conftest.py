"""What several test files share: hypothesis profiles, a cache of their own, and an exact evaluation of any system."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import mpmath
import pytest
import sympy as sp
from hypothesis import settings

from harness.derivation import load_mechanism, load_system
from harness.kernels import program_of
from harness.lagrange import EquationsOfMotion, derive
from harness.library import Library
from harness.mechanism import Mechanism
from harness.states import DEFAULT_RATES
from harness.system import TIME, System

settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("local", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "local")

DIGITS = 60


class Exact:
    """A system evaluated by mpmath at ``DIGITS`` digits, without the program and the kernels under test.

    Arguments are, in this order: q, v, tau, time, parameters, as one flat list.
    """

    def __init__(self, system: System, equations: EquationsOfMotion) -> None:
        self.system, self.equations = system, equations
        self.nv = len(equations.coordinates)
        self.forces = [sp.Symbol(f"applied_{i}") for i in range(self.nv)]
        self.arguments = [*equations.coordinates, *equations.rates, *self.forces, TIME, *system.parameters]
        self.parameters = [mpmath.mpf(value) for value, _ in system.parameters.values()]

    def function(self, expressions: Any, extra: Any = ()) -> Callable[..., Any]:
        """``expressions`` as a function of the flat list of arguments, and of ``extra`` symbols."""
        compiled = sp.lambdify([*self.arguments, *extra], list(expressions), modules="mpmath", cse=True)

        def evaluate(arguments: Any, *others: Any) -> Any:
            with mpmath.workdps(DIGITS):
                return compiled(*map(mpmath.mpf, arguments), *map(mpmath.mpf, others))

        return evaluate

    @cached_property
    def _mass_and_force(self) -> Callable[..., Any]:
        equations = self.equations
        force = sp.Matrix(self.forces) + equations.passive_forces - equations.velocity_terms - equations.gravity_terms
        return self.function([*equations.mass_matrix, *force])

    def mass(self, arguments: Any) -> mpmath.matrix:
        values = self._mass_and_force(arguments)[: self.nv**2]
        return mpmath.matrix([values[i * self.nv : (i + 1) * self.nv] for i in range(self.nv)])

    def accelerations(self, arguments: Any) -> mpmath.matrix:
        with mpmath.workdps(DIGITS):
            return mpmath.lu_solve(self.mass(arguments), mpmath.matrix(self._mass_and_force(arguments)[self.nv**2 :]))

    def energy_norm(self, arguments: Any, vector: Any) -> mpmath.mpf:
        with mpmath.workdps(DIGITS):
            return mpmath.sqrt((vector.T * self.mass(arguments) * vector)[0])

    def energy_balance(self, arguments: Any) -> tuple[mpmath.mpf, mpmath.mpf]:
        """(residual, sum of absolute terms) of dh/dt = sum (Q + tau) v - dL/dt along the motion (chapter 7.9)."""
        values = self._energy_slopes(arguments)
        with mpmath.workdps(DIGITS):
            along_rates = [slope * a for slope, a in zip(values, self.accelerations(arguments), strict=False)]
            terms = along_rates + values[self.nv :]
            return mpmath.fsum(terms), mpmath.fsum(terms, absolute=True)

    @cached_property
    def _energy_slopes(self) -> Callable[..., Any]:
        equations = self.equations
        lagrangian = equations.kinetic - equations.potential
        h = sum((v * equations.kinetic.diff(v) for v in equations.rates), -lagrangian)
        work = zip(equations.generalised_forces, self.forces, equations.rates, strict=True)
        power = sum((given + applied) * v for given, applied, v in work)
        along_coordinates = [h.diff(q) * v for q, v in zip(equations.coordinates, equations.rates, strict=True)]
        return self.function([*(h.diff(v) for v in equations.rates), *along_coordinates, h.diff(TIME), -power, lagrangian.diff(TIME)])


def _mechanism_of(system: System) -> Mechanism:
    equations = derive(system)
    return Mechanism(
        name="test",
        description="",
        source="",
        coordinates=tuple(symbol.name for symbol in equations.coordinates),
        joints=tuple(system.coordinates.values()),
        parameters=tuple((symbol.name, float(value), unit) for symbol, (value, unit) in system.parameters.items()),
        gravity=0.0,
        total_mass=1.0,
        position_ranges=tuple(system.ranges.get(q) for q in system.coordinates),
        rate_ranges=tuple(system.ranges.get(v, DEFAULT_RATES) for v in system.rates),
        program=program_of(system, equations),
        equations_text="",
        equations_mathml="",
        derivation_seconds=0.0,
    )


@pytest.fixture(scope="session", autouse=True)
def cache_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARNESS_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def mechanism_of() -> Callable[[System], Mechanism]:
    """The mechanism of a system that has no file."""
    return _mechanism_of


@pytest.fixture(scope="session")
def exact_of() -> Callable[[System], Exact]:
    """The exact evaluation of a system that has no file."""
    return lambda system: Exact(system, derive(system))


@pytest.fixture(scope="session", params=Library.built_in().system_names())
def built_in_name(request: pytest.FixtureRequest) -> str:
    """Runs a test once for every system of the library."""
    return str(request.param)


@pytest.fixture(scope="session")
def built_in_system(built_in_name: str) -> System:
    return load_system(Library.built_in().system_path(built_in_name))[0]


@pytest.fixture(scope="session")
def built_in_exact(built_in_system: System) -> Exact:
    return Exact(built_in_system, derive(built_in_system))


@pytest.fixture(scope="session")
def built_in_mechanism(built_in_name: str) -> Mechanism:
    return load_mechanism(Library.built_in(), built_in_name)
