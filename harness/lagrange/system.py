"""Definition of a mechanism: energies, parameters, and the joints that carry its coordinates."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

from harness.lagrange.actuator import Actuator
from harness.lagrange.constraint import Constraint, Contact
from harness.lagrange.euler_angles import Attitude

TIME: sp.Symbol = dynamicsymbols._t
_EMPTY: Mapping[Any, Any] = MappingProxyType({})
# The first that a value contradicts is named.
_ASSUMPTIONS = ("positive", "negative", "nonnegative", "nonpositive", "nonzero", "zero", "integer", "rational", "even", "odd", "real")

# Declarations that are mappings, and what each maps.
_MAPPINGS = {
    "coordinates": "{coordinate: joint name}",
    "parameters": "{symbol: (value, unit)}",
    "generalised_forces": "{coordinate: force}",
    "ranges": "{coordinate or rate: (lowest, highest)}",
    "start": "{coordinate or rate: value}",
    "measured_from": "{coordinate: earlier coordinate}",
    "constraints": "{name: Constraint}",
    "assembly": "{coordinate: position}",
    "dry_friction": "{coordinate: parameter}",
    "limits": "{coordinate: (parameter, parameter)}",
    "actuators": "{name: Actuator}",
    "contacts": "{name: Contact}",
}


@dataclass(frozen=True, kw_only=True)
class System:
    """A textbook mechanism, as its book writes it.

    Attributes:
        coordinates: generalised coordinate (a ``dynamicsymbols`` function of time) to the name of the
            joint that carries it in both models. The order fixes the order of q, v, tau and qdd.
        kinetic: kinetic energy T [J]; any polynomial of degree at most 2 in the rates, possibly
            depending on time explicitly.
        potential: potential energy V [J] of gravity and springs; no rates.
        measured_from: coordinate to the earlier one that its joint's position is measured from: the joint stands at their
            difference. So a chain is written in absolute angles, while its joints turn each link against the one before.
            Ranges and start are of the joints' positions, and so are q, v and tau wherever else a coordinate is named.
        attitudes: for each ball or free joint, the Euler angles that describe its rotation; its coordinates
            stand together, those of the position first, and name the one joint.
        generalised_forces: non-conservative generalised force Q per coordinate [N or N m]; the applied
            forces tau are added to every coordinate by the harness and do not appear here.
        parameters: symbol to (value, unit). Values are the float64 numbers the model files hold.
        total_mass: sum of all moving masses [kg], an expression of the parameters.
        gravity: the parameter that is the acceleration of gravity, pointing to -z in the models; None
            where the mechanism feels none.
        ranges: coordinate, or its ``diff(t)``, to (lowest, highest) value of sampled states. A
            coordinate without one is an angle and takes every value; rates default to +-10 per second.
        angles: coordinates that are angles although they have a range and stand in no sine or cosine, as a wheel's on its axle.
        start: coordinate, or its ``diff(t)``, to its value where computed motions start; what it leaves out is
            0. Without one they start at a place of the harness's choice.
        constraints: name, under which both models hold it, to what ties the joints. The coordinates, and the joints of both models,
            are those of the tree that is left without the constraints.
        assembly: coordinate to its position in one configuration in which all constraints hold, to about three digits; what it leaves
            out is 0. States are on the branch that is reached from there when the coordinates that no constraint determines
            move straight to their values.
        dry_friction: coordinate to the parameter that is the largest force, or torque, of Coulomb friction in its joint [N or N m].
        limits: coordinate to the parameters that are the lowest and highest position of its joint [m or rad], where rigid stops are.
        actuators: name, under which an MJCF holds it, to what drives joints; their order is that of the controls of a state.
        contacts: name to where bodies may touch. The equations of motion, and all that is asked of engines by name, are those between
            contacts; rigid contact is a truth of its own, see ``harness.truth.coulomb``.

    Dry friction, limits and actuators are of joints' positions, and enter neither energies nor ``generalised_forces``. All may stand
    beside loops; dry friction and limits neither beside rolling constraints nor beside ball and free joints, which no actuator turns.

    A number in an energy is the number that stands there: a system file's are exact, and a ``sympy.Float``, which SymPy rounds
    whenever it forms a product, is refused.

    Raises:
        ValueError: the declaration contradicts itself; the message says where.

    Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 1.4 to 1.6.
    """

    coordinates: Mapping[sp.Expr, str]
    kinetic: sp.Expr
    potential: sp.Expr
    parameters: Mapping[sp.Symbol, tuple[float, str]]
    total_mass: sp.Expr
    gravity: sp.Symbol | None = None
    generalised_forces: Mapping[sp.Expr, sp.Expr] = field(default_factory=lambda: _EMPTY)
    ranges: Mapping[sp.Expr, tuple[float, float]] = field(default_factory=lambda: _EMPTY)
    angles: tuple[sp.Expr, ...] = ()
    start: Mapping[sp.Expr, float] = field(default_factory=lambda: _EMPTY)
    attitudes: tuple[Attitude, ...] = ()
    measured_from: Mapping[sp.Expr, sp.Expr] = field(default_factory=lambda: _EMPTY)
    constraints: Mapping[str, Constraint] = field(default_factory=lambda: _EMPTY)
    assembly: Mapping[sp.Expr, float] = field(default_factory=lambda: _EMPTY)
    dry_friction: Mapping[sp.Expr, sp.Symbol] = field(default_factory=lambda: _EMPTY)
    limits: Mapping[sp.Expr, tuple[sp.Symbol, sp.Symbol]] = field(default_factory=lambda: _EMPTY)
    actuators: Mapping[str, Actuator] = field(default_factory=lambda: _EMPTY)
    contacts: Mapping[str, Contact] = field(default_factory=lambda: _EMPTY)

    def __post_init__(self) -> None:
        for name, expected in _MAPPINGS.items():
            if not isinstance(found := getattr(self, name), Mapping):
                raise ValueError(f"{name} is {found!r}; expected a mapping, {expected}")
        for name in ("kinetic", "potential", "total_mass"):
            object.__setattr__(self, name, sp.sympify(getattr(self, name)))
        forces = {q: sp.sympify(force) for q, force in self.generalised_forces.items()}
        object.__setattr__(self, "generalised_forces", forces)
        subjects = self._of_coordinates(), self._of_parameters(), self._of_expressions(), self._of_ranges(), self._of_constraints()
        for contradiction in itertools.chain(*subjects, self._of_bounds(), self._of_actuators(), self._of_contacts()):
            raise ValueError(contradiction)

    @cached_property
    def rates(self) -> tuple[sp.Expr, ...]:
        """First time derivatives of the coordinates, in their order."""
        return tuple(q.diff(TIME) for q in self.coordinates)

    @property
    def rotating(self) -> tuple[bool, ...]:
        """For each coordinate, whether it is an angle: it has no range, or stands in a sine or cosine, or is among ``angles``."""
        rows = [row for constraint in self.constraints.values() for row in constraint.rows]
        turned = sp.Tuple(self.kinetic, self.potential, *self.generalised_forces.values(), *rows).atoms(sp.sin, sp.cos, sp.tan)
        known = [q for q in self.coordinates if q not in self.ranges] + list(self.angles)
        return tuple(q in known or any(function.has(q) for function in turned) for q in self.coordinates)

    @property
    def parents(self) -> tuple[int | None, ...]:
        """For each coordinate, the place of the one it is measured from; None for the world. () where all are measured from the world."""
        order = list(self.coordinates)
        return tuple(order.index(self.measured_from[q]) if q in self.measured_from else None for q in order) if self.measured_from else ()

    def in_joint_positions(self) -> System:
        """The same system with energies and forces written in the positions of its joints, each called as its coordinate."""
        positions: dict[sp.Expr, sp.Expr] = {}
        for q in self.coordinates:
            positions[q] = q + positions[self.measured_from[q]] if q in self.measured_from else q
        written_as = positions | {q.diff(TIME): position.diff(TIME) for q, position in positions.items()}

        def written(expression: sp.Expr) -> sp.Expr:
            return expression.xreplace(written_as)

        forces: dict[sp.Expr, sp.Expr] = {q: written(force) for q, force in self.generalised_forces.items()}
        for q in reversed(self.coordinates):
            if q in forces and q in self.measured_from:
                forces[self.measured_from[q]] = forces.get(self.measured_from[q], sp.S.Zero) + forces[q]
        return replace(
            self,
            kinetic=written(self.kinetic),
            potential=written(self.potential),
            generalised_forces=forces,
            measured_from=_EMPTY,
            constraints={
                name: replace(constraint, rows=tuple(map(written, constraint.rows))) for name, constraint in self.constraints.items()
            },
        )

    # What a declaration may contradict itself in, subject by subject; the first contradiction that is found is raised.

    def _of_coordinates(self) -> Iterator[str]:
        order = list(self.coordinates)
        if not order:
            yield "coordinates is empty; expected at least one {coordinate: joint name}"
        for q, joint in self.coordinates.items():
            if not (isinstance(q, AppliedUndef) and q.args == (TIME,)):
                yield f"coordinate {q} is not a dynamicsymbols() function of time"
            if not (isinstance(joint, str) and joint):
                yield f"coordinate {q} has joint {joint!r}; expected a joint name"
        for attitude in self.attitudes:
            own, joint = attitude.coordinates, attitude.joint
            strange = [q for q in own if self.coordinates.get(q) != joint]
            yield from (f"{q} is an angle or position of joint {joint!r}; expected coordinates to map it there" for q in strange)
            if order[order.index(own[0]) :][: len(own)] != list(own):
                yield f"the coordinates of joint {joint!r} do not stand together, positions first, in their order"
        carried = {q for attitude in self.attitudes for q in attitude.coordinates}
        joints = [joint for q, joint in self.coordinates.items() if q not in carried] + [attitude.joint for attitude in self.attitudes]
        yield from (f"joint {joint!r} carries two coordinates; each needs its own" for joint in joints if joints.count(joint) > 1)
        unknown = [q for q in self.generalised_forces if q not in order]
        yield from (f"generalised force on {q}, which is no coordinate; expected one of {order}" for q in unknown)
        for q, other in self.measured_from.items():
            if q not in order or other not in order[: order.index(q)]:
                yield f"{q} is measured from {other}; expected a coordinate and an earlier one"
        if self.measured_from and self.attitudes:
            yield "measured_from beside ball or free joints; write the energies in the positions of the joints"

    def _of_parameters(self) -> Iterator[str]:
        for symbol, entry in self.parameters.items():
            if not (isinstance(entry, tuple) and len(entry) == 2 and isinstance(entry[1], str)):
                yield f"parameter {symbol} is {entry!r}; expected (value, unit)"
            if isinstance(entry[0], bool) or not isinstance(entry[0], int | float) or not math.isfinite(entry[0]):
                yield f"parameter {symbol} has value {entry[0]!r}; expected a finite number"
            yield from _of_assumptions(f"parameter {symbol}", symbol, [sp.Rational(entry[0])])
        names = [symbol.name for symbol in self.parameters]
        yield from (f"two parameters are named {name!r}; give each its own name" for name in names if names.count(name) > 1)
        if self.gravity is not None and self.gravity not in self.parameters:
            yield f"gravity is {self.gravity}, which is not among the parameters"

    def _of_expressions(self) -> Iterator[str]:
        expressions = {"kinetic": self.kinetic, "potential": self.potential, "total_mass": self.total_mass}
        expressions |= {f"generalised force on {q}": force for q, force in self.generalised_forces.items()}
        for name, constraint in self.constraints.items():
            expressions |= {f"row {number} of constraint {name!r}": row for number, row in enumerate(constraint.rows)}
        for name, contact in self.contacts.items():
            expressions |= {f"{what} of contact {name!r}": row for what, row in zip(("gap", "slip", "slip"), contact.rows, strict=False)}
        known = {*self.parameters, TIME}
        for name, expression in expressions.items():
            if not isinstance(expression, sp.Expr) or expression.is_Matrix:
                raise ValueError(f"{name} is {expression!r}; expected an expression; of a matrix of one entry, take [0]")
            strange = sorted(expression.free_symbols - known, key=str)
            yield from (f"{name} contains {symbol}, which has no value; add it to parameters" for symbol in strange)
            rates, functions = expression.atoms(sp.Derivative) - {*self.rates}, expression.atoms(AppliedUndef) - {*self.coordinates}
            yield from (f"{name} contains {rate}; only first rates of the coordinates may appear" for rate in rates)
            yield from (f"{name} contains {function}, which is no coordinate" for function in functions)
            for number in sorted(expression.atoms(sp.Float)):
                yield f"{name} contains {number}, which SymPy rounds in every product; write sympy.Rational({str(number)!r})"
        if self.potential.atoms(sp.Derivative):
            yield "potential contains a rate; put the term into kinetic or generalised_forces"
        if self.total_mass.atoms(AppliedUndef):
            yield "total_mass depends on a coordinate; expected an expression of the parameters"
        beside = {*self.dry_friction.values(), *itertools.chain(*self.limits.values())}
        beside |= {contact.friction for contact in self.contacts.values() if contact.friction is not None}
        beside |= set[sp.Basic]().union(*(actuator.symbols for actuator in self.actuators.values()))
        unused = sorted(set(self.parameters) - sp.Tuple(*expressions.values()).free_symbols - beside, key=str)
        yield from (f"parameter {one} enters neither energy nor force nor mass nor constraint; remove it or use it" for one in unused)

    def _of_ranges(self) -> Iterator[str]:
        known = [*self.coordinates, *self.rates]
        for key, bounds in self.ranges.items():
            if key not in known:
                yield f"range of {key}, which is neither a coordinate nor a rate"
            if not (isinstance(bounds, tuple) and len(bounds) == 2 and all(map(_is_finite, bounds)) and bounds[0] < bounds[1]):
                yield f"range of {key} is {bounds!r}; expected (lowest, highest), both finite"
        ranged = [q for q in self.coordinates if q in self.ranges]
        yield from (
            f"angles has {q}; expected coordinates that have a range, as those without are angles" for q in self.angles if q not in ranged
        )
        for q in self.coordinates:
            # Those without a range take every value.
            lowest, highest = map(sp.Rational, self.ranges.get(q, (-1.0, 1.0)))
            inside = [sp.S.Zero] if lowest < 0 < highest else []
            yield from _of_assumptions(f"the range of {q}", q, [lowest, (lowest + highest) / 2, *inside, highest])
        for key, value in self.start.items():
            if key not in known:
                yield f"start of {key}, which is neither a coordinate nor a rate"
            if not _is_finite(value):
                yield f"start of {key} is {value!r}; expected a finite number"
        if self.start and self.attitudes:
            yield "start is given in coordinates, and a ball or free joint has none; leave it out"

    def _of_constraints(self) -> Iterator[str]:
        if self.constraints and self.attitudes:
            yield "constraints beside ball or free joints; write these as hinges and slides, one behind the other"
        determined: set[sp.Expr] = set()
        for name, constraint in self.constraints.items():
            try:
                constraint.is_rolling(self.rates)
            except ValueError as error:
                raise ValueError(f"constraint {name!r} {error}") from error
            if any(map(_depends_on_time, constraint.rows)):
                yield f"constraint {name!r} depends on time explicitly; expected a function of coordinates and rates"
            for q in constraint.determines:
                if q not in self.coordinates:
                    yield f"constraint {name!r} determines {q}, which is no coordinate; expected one of {list(self.coordinates)}"
                if q in determined:
                    yield f"constraint {name!r} determines {q}, which is determined already; each coordinate is by one row"
                determined.add(q)
        if len(determined) == len(self.coordinates):
            yield "constraints determine all coordinates, so that nothing moves"
        for q, value in self.assembly.items():
            if q not in self.coordinates or not _is_finite(value):
                yield f"assembly has {q} at {value!r}; expected coordinates and finite numbers"
        if self.assembly and not self.constraints:
            yield "assembly is given, and there is no constraint; leave it out"

    def _of_bounds(self) -> Iterator[str]:
        bounded = {**self.dry_friction, **self.limits}
        if bounded and (self.attitudes or any(one.is_rolling(self.rates) for one in self.constraints.values())):
            yield "dry friction or limits beside rolling constraints, or ball and free joints; expected hinges and slides"
        yield from (f"dry friction or a limit of {q}, which is no coordinate" for q in bounded if q not in self.coordinates)
        for symbol in (*self.dry_friction.values(), *itertools.chain(*self.limits.values())):
            if symbol not in self.parameters:
                yield f"{symbol} bounds a force or a position, and has no value; add it to parameters"
        for q, symbol in self.dry_friction.items():
            if not self.parameters[symbol][0] > 0:
                yield f"dry friction of {q} is {self.parameters[symbol][0]:g}; expected one above zero"
        for q, (low, high) in self.limits.items():
            if not self.parameters[low][0] < self.parameters[high][0]:
                yield f"the limits of {q} are {self.parameters[low][0]:g} and {self.parameters[high][0]:g}; expected the lowest first"

    def _of_contacts(self) -> Iterator[str]:
        if self.contacts and (self.constraints or self.measured_from):
            yield "contacts beside constraints or measured_from; expected joints of a tree"
        if self.attitudes and any(contact.slip is not None for contact in self.contacts.values()):
            yield "a slip beside ball and free joints; expected smooth contacts there, or hinges and slides, one behind the other"
        for name, contact in self.contacts.items():
            yield from (f"contact {name!r} {one}" for one in contact.contradictions(self.rates))
            if contact.friction is not None and not (contact.friction in self.parameters and self.parameters[contact.friction][0] >= 0):
                yield f"contact {name!r} has the friction {contact.friction}; expected a parameter whose value is not negative"

    def _of_actuators(self) -> Iterator[str]:
        of_several = [q for q, joint in self.coordinates.items() if list(self.coordinates.values()).count(joint) > 1]
        for name, actuator in self.actuators.items():
            if any(map(_depends_on_time, (actuator.force, *actuator.moments.values()))):
                yield f"actuator {name!r} depends on time explicitly; expected a function of coordinates, rates and its control"
            yield from (f"actuator {name!r} {one}" for one in actuator.contradictions(self.coordinates, self.rates, self.parameters))
            functions = sp.Tuple(actuator.force, *actuator.moments.values(), *actuator.moments).atoms(AppliedUndef)
            strange = [q for q in of_several if q in functions]
            yield from (f"actuator {name!r} feels or moves {q} of a ball or free joint; expected hinges and slides" for q in strange)


def _is_finite(value: Any) -> bool:
    """True for a number of Python or SymPy that is neither infinite nor NaN."""
    try:
        return math.isfinite(value)
    except TypeError:
        return False


def _depends_on_time(expression: sp.Expr) -> bool:
    """True where time stands in an expression otherwise than in its coordinates and rates."""
    functions = {function: sp.Dummy() for function in expression.atoms(AppliedUndef, sp.Derivative)}
    return TIME in expression.xreplace(functions).free_symbols


def _of_assumptions(name: str, symbol: sp.Expr, values: Sequence[sp.Rational]) -> Iterator[str]:
    """Values that are not what ``symbol`` is declared to be, by which SymPy simplifies: sqrt(c**2) is c where c is positive."""
    for assumption in _ASSUMPTIONS:
        declared = getattr(symbol, f"is_{assumption}")
        what = assumption if declared else f"not {assumption}"
        for value in values:
            if declared is not None and getattr(value, f"is_{assumption}") not in (declared, None):
                yield f"{name} holds {float(value):.17g}, and {symbol} is declared {what}; change the value or the assumption"
