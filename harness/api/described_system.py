"""A mechanism or a robot as it is described: its equations in SymPy and LaTeX, joints, parameters, a picture, and a card of all that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from harness import workers as processes
from harness.errors import InvalidRequest
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.table import grouped
from harness.study import complete

if TYPE_CHECKING:
    import sympy as sp

    from harness.lagrange.equations import EquationsOfMotion
    from harness.lagrange.system import System
    from harness.show.drawing import Drawing

# A notebook that typesets more than this is busy for minutes.
_MOST_TYPESET = 20_000


class Parameter(NamedTuple):
    """A parameter's value and unit; a number of a robot's file has no unit, ""."""

    value: float
    unit: str


class Latex(str):
    """A text in LaTeX, which a notebook typesets."""

    __slots__ = ()

    def _repr_latex_(self) -> str | None:
        return f"$${self}$$" if len(self) <= _MOST_TYPESET else None


@dataclass(eq=False, repr=False)
class DescribedSystem:
    """A textbook mechanism or a robot, to be read.

    Attributes:
        library: where it is from; None for a ``System`` without files.
        mechanism: its plain data: coordinates, joints, parameters, ranges.
        given: the ``System`` where it is not that of the library's file. changed: parameters that have other values than there.
    """

    library: Library | None
    mechanism: Mechanism
    given: System | None = None
    changed: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name of the mechanism, or of the robot's file."""
        return self.mechanism.name

    @property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """Names of the joints in the order of q and v, each with the coordinates that it carries.

        Examples:
            >>> import harness
            >>> harness.load("cart_pendulum").joints
            {'slide': ('x',), 'pin': ('theta',)}
        """
        mechanism = self.mechanism
        return {joint: tuple(own) for joint, own in grouped(zip(mechanism.joints, mechanism.coordinates, strict=True)).items()}

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Value and unit of each parameter by its name; of a robot, the numbers of its file that accelerations feel.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").parameters["L"]
            Parameter(value=2.0, unit='m')
        """
        return {name: Parameter(value, unit) for name, value, unit in self.mechanism.parameters}

    @cached_property
    def system(self) -> System:
        """The ``System`` that it is derived from, in the positions of its joints.

        Raises:
            harness.errors.InvalidRequest: a robot has none.
        """
        from harness.lagrange.derivation import load_system

        if self.given is not None:
            return self.given
        if self.library is None or not self.mechanism.energy_programs:
            program = f"a program of {self.mechanism.program.operations:,} operations, by recursion over its bodies"
            raise InvalidRequest(f"{self.name} is a robot, whose equations are {program}; its accelerations can be had")
        return load_system(self.library.system_path(self.name))[0]

    @cached_property
    def equations(self) -> EquationsOfMotion:
        """M qdd + c + g = p + tau in SymPy: ``mass_matrix``, ``velocity_terms``, ``gravity_terms``, ``passive_forces``.

        Under constraints ``constraint_rows`` stay zero, and -J' lambda with J the ``constraint_jacobian`` is added on the right.

        Raises:
            harness.errors.InvalidRequest: a robot has none.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").equations.mass_matrix
            Matrix([[L**2*m]])
        """
        from harness.lagrange.derivation import equations_of

        return equations_of(self.system)

    @property
    def M(self) -> sp.Matrix:  # noqa: N802
        """The mass matrix, (nv, nv).

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").M
            Matrix([[L**2*m]])
        """
        return self.equations.mass_matrix

    @cached_property
    def C(self) -> sp.Matrix:  # noqa: N802
        """The Coriolis matrix of Christoffel symbols, (nv, nv); C v are the velocity terms of a T quadratic in the rates.

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").C
            Matrix([[0]])
        """
        return self.equations.christoffel_matrix()

    @property
    def g(self) -> sp.Matrix:
        """The gravity terms, (nv, 1).

        Examples:
            >>> import harness
            >>> harness.load("simple_pendulum").g
            Matrix([[L*g*m*sin(theta)]])
        """
        return self.equations.gravity_terms

    @cached_property
    def latex(self) -> Latex:
        r"""The equations of motion, one per coordinate, as LaTeX, which a notebook typesets unless it is very long.

        Examples:
            >>> import harness
            >>> print(harness.load("simple_pendulum").latex.splitlines()[1])
            \ddot{\theta} m L^{2} + L g m \sin{\left(\theta \right)} &= \tau_{\theta}
        """
        from harness.lagrange.equations import latex

        return Latex(latex(self.equations))

    def picture(self) -> Drawing:
        """The mechanism moved a little from its zero configuration, over its shadow there, as an engine places one of its models.

        Raises:
            harness.errors.InvalidRequest: there is no model of it, or none that an engine can place.

        Examples:
            >>> import harness
            >>> harness.load("cart_pendulum").picture().save("cart_pendulum.svg")
        """
        if isinstance(self._drawing, str):
            raise InvalidRequest(f"{self.name}: no picture, for {self._drawing}")
        return self._drawing

    @cached_property
    def _drawing(self) -> Drawing | str:
        """The picture, or why there is none."""
        from harness.show.gallery import Gallery
        from harness.show.picture import standing_alone

        if self.library is None or not self.mechanism.energy_programs:
            return "one is drawn of a mechanism with model files"
        if self.changed:
            return "its parameters are not those of its models"
        with processes.Workers(1) as pool:
            pictures = complete(Gallery(self.library, [self.name]), pool).pictures
        if not pictures:
            return "no engine can place a model of it; harness show says why"
        return standing_alone(pictures[0].svg, f"picture of {self.name}")

    def __repr__(self) -> str:
        from harness.show.card import card_text

        return card_text(self.mechanism, self.changed)

    def _repr_html_(self) -> str:
        from harness.show.card import card_html

        return card_html(self.mechanism, self.changed, "" if isinstance(self._drawing, str) else self._drawing.svg)
