"""The mechanism that an engine documents in the place of rigid constraints: they give, by the laws that it declares of a file's numbers.

It is the truth of its accelerations at any state, whether constraints hold there or not. The impedance of a constraint is that of its
distance at each state; the equations take it as linear in the rows around the state, exactly there, so that data roundoff has what the
rounding of every input does to it.

Source: MuJoCo documentation, Computation, sections Constraint model and Solver parameters.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from harness.arrays import Array, Indices
from harness.files.rules import ConstraintLaw, InverseWeight
from harness.programs.evaluation import values, values_and_spread
from harness.programs.mechanisms.clamps import Clamp, Ranges
from harness.programs.mechanisms.cones import ASSOCIATED, COULOMB, Cone
from harness.programs.mechanisms.descent import sides_at_least
from harness.programs.mechanisms.mechanism import RATE, RESIDUAL, Constraints, Mechanism
from harness.programs.mechanisms.softened import (
    CONSTANT,
    DISTANCE,
    FRICTION,
    IMPEDANCE,
    INVERSE_MASS,
    RATIO,
    REST,
    REST_OF_RATIO,
    REST_OF_TOWARDS,
    SHARE,
    SLIDING,
    SLOPE,
    STICKING,
    STIFFNESS,
    TOWARDS,
    Softness,
    number_of,
    softened_program,
)
from harness.programs.mechanisms.zones import Zones
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import StraightLineProgram, without_unused
from harness.programs.states import States
from harness.storage import Kept
from harness.truth.compare import Flags
from harness.truth.impedance import ROUNDINGS_OF_TWO_PARTS, in_two_parts, linear, nearest


@dataclass(frozen=True)
class DeclaredMechanism(Mechanism):
    """A mechanism whose constraints give; the numbers of their laws are its last parameters, some of which each state has of its own.

    Attributes:
        laws: of each constraint by its name.
        zones: of the rows whose forces have a range; None without any.
        pushing: rows that push alone, by the places of their force in ``zones``.
        ratios: as of ``SoftenedProgram``, with the places of each ratio and of its rest among the parameters.
        problem: as of ``SoftenedProgram``, where contacts, rigid rows or those of a step are among the constraints: so many sides are
            found as a least; None elsewhere.
        given: the numbers of a robot's file that are its first parameters; () of a system's.
    """

    laws: tuple[tuple[str, ConstraintLaw], ...] = ()
    zones: Zones | None = None
    pushing: tuple[tuple[int, int], ...] = ()
    ratios: tuple[StraightLineProgram, tuple[tuple[int, int], ...]] | None = None
    problem: StraightLineProgram | None = None
    given: tuple[Any, ...] = ()

    @property
    def key(self) -> Hashable:
        """See ``Mechanism``."""
        return super().key, self.laws

    @property
    def holds_rigid(self) -> bool:
        """True where its constraints hold rigid beside dry friction or limits, so that states have to close them."""
        return self.constraints is not None and bool(self.laws) and all(law.is_rigid for _, law in self.laws)

    @property
    def widths(self) -> list[float]:
        """Those in which the impedance of a constraint varies [m or rad]."""
        return [law.impedance.width for _, law in self.laws if not law.impedance.is_constant]

    def parameters_at(self, states: States, values: Sequence[float] | Array | None = None) -> Array:
        """See ``Mechanism``; with what the distance of each state from closing a constraint makes of the law's numbers."""
        found = np.array(super().parameters_at(states, values))
        if self.ratios is not None:
            program, places = self.ratios
            parts = in_two_parts(program, self.inputs(states, found)[: len(program.inputs)], len(places))
            for column, (high, low) in enumerate(places):
                found[:, high], found[:, low] = (part[:, column] for part in parts)
        if self.widths or self.pushing:
            residuals = nearest(self._residual_program, self._inputs_of_residuals(states, found))
            self._put_numbers(found, residuals)
            if self.pushing:
                self._settle_pushing(states, residuals, found)
                return found
        if self.zones is not None:
            ranges = self.ranges_at(self.zones, states, found, np.zeros((len(states), 0)))
            self._settle(self.zones, states, found, ranges)
        return found

    def _settle(self, zones: Zones, states: States, found: Array, ranges: Ranges) -> Array:
        """As ``Zones.settle``, from the sides at the least of the documented function in float64, where it is one."""
        if self.problem is None:
            return zones.settle(states.known, found, ranges)
        inputs = self.inputs(states, found)
        if all(cone.flow.is_convex for cone in zones.cones):
            return zones.settle(states.known, found, ranges, sides_at_least(zones, self.problem, inputs, found, ranges))
        # Most forces are those of a cost.
        from harness.truth.complementarity import settle

        settle(zones, self.problem, inputs, found, ranges)
        return zones.reach(states.known, found, UNIT_ROUNDOFF)[0][:, : len(zones.clamps)]

    def across(self, states: States, parameters: Array, unit_roundoff: float) -> Array:
        """See ``Mechanism``."""
        found = super().across(states, parameters, unit_roundoff)
        if self.zones is None:
            return found
        (residuals,) = values(self._residual_program, self._inputs_of_residuals(states, parameters)).values()
        return self.zones.across(states.known, found, unit_roundoff, self.ranges_at(self.zones, states, found, residuals.T))

    def reaches_limits(self, states: States) -> Flags:
        """(n,) whether some row that pushes alone is there."""
        (residuals,) = values(self._residual_program, self._inputs_of_residuals(states, super().parameters_at(states))).values()
        return np.asarray((residuals[[row for _, row in self.pushing]] < 0).any(axis=0))

    def _settle_pushing(self, states: States, residuals: Array, found: Array) -> None:
        """Settle the zones; NaN where half an ulp of what is left by a row that would push decides whether it is there at all."""
        assert self.zones is not None
        ranges = self.ranges_at(self.zones, states, found, residuals)
        raw = self._settle(self.zones, states, found, ranges)
        is_at = _is_rounding(self._residual_program, self._inputs_of_residuals(states, found), residuals)
        for place, row in self._within_limits:
            [states_at] = np.nonzero(is_at[:, row])
            if len(states_at):
                _, reach = self.zones.reach(states.known[states_at], found[states_at], UNIT_ROUNDOFF)
                pushes = (raw[states_at, place] > reach[:, place]) | ~np.isfinite(reach[:, place])
                found[states_at[pushes], self.zones.clamps[place].share] = np.nan

    def ranges_at(self, zones: Zones, states: States, found: Array, residuals: Array) -> Ranges:
        """The least and the largest forces, 0 of a row that pushes alone and is not there.

        At an instant, dry friction that slides is its bound against the velocity, and a limit that is reached pushes where none leads away.
        """
        low, high = zones.bounds(found)
        rigid = {place for place, _, _ in self._at_an_instant}
        for place, row in self._within_limits:
            if place not in rigid:
                high[residuals[:, row] >= 0, place] = 0.0
        assert self.softened is not None
        laws, rows = dict(self.laws), self.softened.rows
        windows = [(place, row, law) for place, row in self.pushing if (law := laws[rows[row]].of_step) and law.window < math.inf]
        if windows and self.problem is not None:
            # Most laws are of an instant.
            from harness.truth.window import are_beyond

            places = [place for place, _, _ in windows]
            distances = residuals[:, [row for _, row, _ in windows]]
            beyond = are_beyond(self.problem, self.inputs(states, found), states.v, places, distances, [law for *_, law in windows])
            high[:, places] = np.where(beyond, 0.0, high[:, places])
        if rigid:
            assert self.softened is not None
            of_rates = alone(self.softened, RATE)
            (rates,) = values(of_rates, self.inputs(states, found)[: len(of_rates.inputs)]).values()
            for place, row, pushes in self._at_an_instant:
                rate = rates[row]
                if pushes:
                    high[(residuals[:, row] > 0) | (rate > 0), place] = 0.0
                else:
                    low[rate > 0, place], high[rate > 0, place] = low[rate > 0, place], low[rate > 0, place]
                    low[rate < 0, place] = high[rate < 0, place]
        return low, high

    @functools.cached_property
    def _within_limits(self) -> list[tuple[int, int]]:
        """Those of ``pushing`` that are not there before their limits are reached."""
        laws = dict(self.laws)
        assert self.softened is not None
        return [(place, row) for place, row in self.pushing if laws[self.softened.rows[row]].stiffness_ahead is None]

    @functools.cached_property
    def _at_an_instant(self) -> list[tuple[int, int, bool]]:
        """The places of rigid rows of dry friction and limits whose forces the velocity decides, their numbers, and whether they push."""
        assert self.softened is not None
        laws, pushing = dict(self.laws), {row for _, row in self.pushing}
        own = [row for row, name in enumerate(self.softened.rows) if laws and laws[name].is_of_an_instant]
        # All rows of a rigid problem have a range, in their order.
        return [(row, row, row in pushing) for row in own]

    def _inputs_of_residuals(self, states: States, parameters: Array) -> Array:
        return self.inputs(states, parameters)[: len(self._residual_program.inputs)]

    def _put_numbers(self, found: Array, residuals: Array) -> None:
        """Set the numbers of laws where the rows of all constraints leave ``residuals``, (n, rows), in the parameters of n states."""
        columns = {name: column for column, (name, _, _) in enumerate(self.parameters)}
        alike = dict[tuple[float, int], list[tuple[str, ConstraintLaw, Indices]]]()
        for name, law in self.laws:
            rows = self._rows[name]
            first = residuals[:, rows[0]]
            if law.stiffness_ahead is not None:
                found[first >= 0, columns[number_of(name, STIFFNESS)]] = law.stiffness_ahead
            if law.is_rigid:
                continue
            [acting] = np.nonzero(first < 0) if law.pushes_alone else (np.arange(len(found)),)
            # The distance of a contact is in each of its edges.
            measured = 1 if law.is_contact else len(rows)
            alike.setdefault((law.impedance.power, measured), []).append((name, law, acting))
        for (_, measured), several in alike.items():
            given = [residuals[acting][:, self._rows[name][:measured]] for name, _, acting in several]
            counts = [len(acting) for *_, acting in several]
            around, ends = linear([law.impedance for _, law, _ in several], counts, np.concatenate(given)), np.cumsum(counts)
            for (name, law, acting), end in zip(several, ends.tolist(), strict=True):
                own, rows = around[end - len(acting) : end], self._rows[name]
                found[acting, columns[number_of(name, IMPEDANCE)]] = own.value
                found[acting, columns[number_of(name, REST)]] = own.rest
                for place, row in enumerate(rows):
                    found[acting, columns[number_of(name, DISTANCE, row)]] = residuals[acting, row]
                    found[acting, columns[number_of(name, SLOPE, row)]] = own.slopes[:, place] if place < measured else 0.0
                    number = columns.get(number_of(name, INVERSE_MASS, row))
                    if number is not None:
                        found[acting, number] = np.maximum(found[acting, number], _least(law, own.value))

    @functools.cached_property
    def _rows(self) -> dict[str, list[int]]:
        assert self.softened is not None
        return {name: [row for row, owner in enumerate(self.softened.rows) if owner == name] for name in self.softened.names}

    @functools.cached_property
    def _residual_program(self) -> StraightLineProgram:
        assert self.softened is not None
        return alone(self.softened, RESIDUAL)


def at_limits(mechanism: DeclaredMechanism, states: States) -> Flags:
    """(n, rows) where half an ulp of the inputs decides whether a limit is reached."""
    program, inputs = mechanism._residual_program, mechanism._inputs_of_residuals(states, Mechanism.parameters_at(mechanism, states))
    found = _is_rounding(program, inputs, nearest(program, inputs))
    found[:, np.setdiff1d(np.arange(found.shape[1]), [row for _, row in mechanism.pushing])] = False
    return found


def _is_rounding(program: StraightLineProgram, inputs: Array, residuals: Array) -> Flags:
    """(n, rows) where residuals are within half an ulp of the inputs of their program, and not exactly 0 whatever these are."""
    (spread,) = values_and_spread(program, inputs, np.abs(inputs))[1].values()
    return np.asarray((np.abs(residuals) <= UNIT_ROUNDOFF * spread.T) & (spread.T > 0))


def lost(mechanism: DeclaredMechanism) -> float:
    """The loss of each state's own numbers as sums of two float64 numbers, in squared unit roundoffs times sensitivity.

    A varying impedance is such a sum, and is linear within half an ulp of the distance: its slope is rounded, and its second derivative
    left out, which are powers p and p (p - 1) of the larger impedance at most.
    """
    varying = [law.impedance for _, law in mechanism.laws if law.impedance.least != law.impedance.most]
    bent = ((d.power + d.power**2 / 2) * max(d.least, d.most) / min(d.least, d.most) for d in varying)
    return max((ROUNDINGS_OF_TWO_PARTS + one for one in bent), default=0.0)


_DECLARED: Kept[DeclaredMechanism] = Kept(64)
_ALONE: Kept[StraightLineProgram] = Kept(64)


def alone(rows: Constraints, name: str) -> StraightLineProgram:
    """The part of the program of rows that has one output."""
    return _ALONE.get((rows.key, name), lambda: without_unused(replace(rows.program, outputs={name: rows.program.outputs[name]})))


def _least(law: ConstraintLaw, impedance: Any) -> Any:
    """The least inverse mass of a row whose regularisation is no less than the engine's least number."""
    # An edge of a pyramid weighs so many times what its normal does.
    edge = 1 + law.cone.friction[0] ** 2 if law.cone is not None and not law.cone.is_elliptic and law.weights is not None else 1.0
    return law.least_regularisation * impedance / ((1 - impedance) * edge)


def _cone_of(name: str, rows: Sequence[int], law: Softness, columns: Mapping[str, int]) -> Cone:
    """The places of the numbers of a contact whose rows have these numbers."""
    return Cone(
        columns[number_of(name, STICKING)],
        columns[number_of(name, SLIDING)],
        tuple(columns[number_of(name, TOWARDS, row)] for row in rows),
        tuple(columns[number_of(name, REST_OF_TOWARDS, row)] for row in rows),
        tuple(columns[number_of(f"{name} {number}", FRICTION)] for number in range(len(law.friction))),
        columns[number_of(name, RATIO)],
        columns.get(number_of(name, REST_OF_RATIO)),
        law.flow,
    )


def declared(
    mechanism: Mechanism, laws: Mapping[str, ConstraintLaw], weights: Mapping[InverseWeight, float], rows: Constraints | None = None
) -> DeclaredMechanism:
    """The mechanism whose constraints give by ``laws``, with the inverse weights that these name.

    ``rows`` are those of all, where some need not hold.

    Raises:
        ValueError: rows of a constraint weigh differently, and the mechanism has not as many.
    """
    rows = rows or mechanism.constraints
    assert rows is not None
    rubbing = dict(mechanism.dry_friction)
    softness = {
        name: replace(_softness(name, laws[name], rows.rows.count(name), weights), bound=rubbing.get(name, "")) for name in rows.names
    }
    return softened(mechanism, softness, laws, rows)


def _softness(name: str, law: ConstraintLaw, count: int, weights: Mapping[InverseWeight, float]) -> Softness:
    """The law of a constraint that has so many rows in the mechanism, near which it stays."""
    inverse_masses: tuple[float | None, ...] = (None,) * count
    impedance = law.impedance.at_zero
    if law.weights is not None:
        own = [max(sum(weights[part] for part in row), _least(law, impedance)) for row in law.weights]
        if len(own) != count and len(set(own)) > 1:
            raise ValueError(f"constraint {name!r} has {len(own)} rows of different weight; expected {count} rows")
        inverse_masses = tuple(own if len(own) == count else [own[0]] * count)
    plain = Softness(impedance, law.stiffness, law.damping, inverse_masses, law.has_curvature or law.in_body, law.force_range)
    if law.of_step is not None:
        plain = replace(plain, near_rigid=law.of_step.near_rigid, least=law.of_step.least, regularised=law.of_step.sliding)
    if law.is_rigid:
        return replace(plain, compliance=law.least_regularisation)
    if (cone := law.cone) is None:
        return plain
    flow = ASSOCIATED if cone.is_associated else COULOMB
    ratio, damping = cone.impedance_ratio, cone.sliding_damping
    return replace(plain, friction=cone.friction, ratio=ratio, is_round=cone.is_elliptic, flow=flow, sliding_damping=damping)


def _paired(ranged: Sequence[tuple[str, int]], laws: Mapping[str, ConstraintLaw]) -> Iterator[tuple[int, int]]:
    """Places of the dry friction of a joint and of each limit of it, which asks nothing of a velocity that friction keeps at zero."""
    for first, (rubbing, _) in enumerate(ranged):
        for second, (limit, _) in enumerate(ranged):
            of_one = rubbing.rpartition(" of ")[2] == limit.rpartition(" of ")[2]
            if of_one and laws[limit].pushes_alone and not laws[limit].stiffness and not laws[rubbing].pushes_alone:
                yield first, second


def softened(
    mechanism: Mechanism,
    softness: Mapping[str, Softness],
    laws: Mapping[str, ConstraintLaw] | None = None,
    rows: Constraints | None = None,
) -> DeclaredMechanism:
    """The mechanism whose constraints give as told; without ``laws`` alike at every distance. ``rows`` as of ``declared``."""
    tied, by_name = rows or mechanism.constraints, laws or {}
    assert tied is not None

    def write() -> DeclaredMechanism:
        if is_rigid := any(law.is_rigid for law in by_name.values()):
            # Most laws are soft.
            from harness.programs.mechanisms.bounded import bounded_program

            written = bounded_program(tied, softness)
        else:
            written = softened_program(tied, softness)
        parameters = (*mechanism.parameters, *((name, value, "") for name, value in written.numbers))
        columns = {name: column for column, (name, _, _) in enumerate(parameters)}
        clamps = [
            Clamp(
                columns[number_of(name, SHARE, row)],
                columns[number_of(name, CONSTANT, row)],
                *softness[name].force_range,
                size=columns.get(softness[name].bound, -1),
            )
            for name, row in written.ranged
        ]
        numbers = {name: [row for row, owner in enumerate(tied.rows) if owner == name] for name in written.round}
        cones = [_cone_of(name, rows, softness[name], columns) for name, rows in numbers.items()]
        paired = _paired(written.ranged, by_name) if is_rigid else ()
        ratios = tuple((columns[number_of(name, RATIO)], columns[number_of(name, REST_OF_RATIO)]) for name in written.regularised)
        own = {field.name: getattr(mechanism, field.name) for field in fields(Mechanism)}
        own |= {"parameters": parameters, "program": written.program, "softened": tied, "stiffened": written.stiffened}
        return DeclaredMechanism(
            **own,
            laws=tuple(by_name.items()),
            zones=Zones(tuple(clamps), written.unbounded, tuple(cones), tuple(paired), written.by_solution) if clamps or cones else None,
            ratios=None if written.ratios is None else (written.ratios, ratios),
            problem=written.problem if is_rigid or any(law.is_contact or law.of_step for law in by_name.values()) else None,
            pushing=tuple((place, row) for place, (name, row) in enumerate(written.ranged) if by_name[name].pushes_alone),
        )

    return _DECLARED.get((mechanism.key, tied.key, tuple(softness.items()), tuple(by_name.items())), write)
