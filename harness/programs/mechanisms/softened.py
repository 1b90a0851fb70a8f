"""The equations of motion of a tree under constraints that give, by a law whose numbers are parameters.

Proofs and sources: docs/inside/numerics.md, "Constraint forces".
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.programs.mechanisms.cones import ASSOCIATED, Flow
from harness.programs.mechanisms.constraint_forces import (
    Tied,
    products_of_elimination,
    solved,
    solved_by_rows,
    solved_from_tips,
    tied_equations,
)
from harness.programs.mechanisms.mechanism import JACOBIAN, Constraints
from harness.programs.program import StraightLineProgram, position_count, without_unused
from harness.programs.terms import Builder, Matrix, Term, Vector, length, matrix, sqrt, vector
from harness.storage import Kept


@dataclass(frozen=True)
class Softness:
    """The softness of one constraint: numbers of a model file.

    Attributes:
        impedance: d where the constraint holds, above 0 and below 1. stiffness: k [1/s^2]. damping: b [1/s].
        inverse_masses: A of each row [1/kg, or 1/(kg m^2)]; None for (J M^-1 J')_ii at the state.
        has_bias: whether the law takes account of J' v; without it, it leaves b out.
        force_range: the least and the largest force of each row [N or N m].
        friction, ratio: mu_j of a contact, and the ratio of impedances; () of all other constraints. Its R are those of its first row.
        is_round: whether its forces lie in an elliptic cone. flow: what they are there.
        sliding_damping: b of its rows across the normal [1/s]; None for that of the normal.
        bound: the parameter that is the largest force of each row in either direction, of which the row's constant is a multiple; "" where
            the constant is the force.
        near_rigid, least: of A of the rows of a step, see ``harness.files.rules``; None of a law at an instant.
        regularised: of a contact in a step, ``StepRegularisation.sliding``, by which each state has a ratio of its own; None elsewhere.
        compliance: R of each row [1/kg, or 1/(kg m^2)], in place of what impedance and inverse masses give; None for these.
    """

    impedance: float
    stiffness: float
    damping: float
    inverse_masses: tuple[float | None, ...]
    has_bias: bool = True
    force_range: tuple[float, float] = (-math.inf, math.inf)
    friction: tuple[float, ...] = ()
    ratio: float = 1.0
    is_round: bool = False
    flow: Flow = ASSOCIATED
    sliding_damping: float | None = None
    near_rigid: float | None = None
    least: float | None = None
    regularised: float | None = None
    compliance: float | None = None
    bound: str = ""

    @property
    def has_range(self) -> bool:
        return self.force_range != Softness.force_range

    @property
    def form(self) -> Hashable:
        """Equal for laws of which there is one program, whatever their numbers are."""
        weighs = tuple(one is None for one in self.inverse_masses)
        of_step = self.near_rigid is not None
        own_ratio = self.regularised is not None
        of_cone = len(self.friction), self.is_round, self.flow, self.sliding_damping is None, own_ratio
        return weighs, self.has_bias, self.has_range, *of_cone, self.bound, of_step


# Numbers of a law that a state may have of its own, behind the names of constraint and row.
IMPEDANCE, REST, DISTANCE, SLOPE, INVERSE_MASS = "impedance", "rest of impedance", "distance", "slope", "inverse mass"
SHARE, CONSTANT, UNBOUNDED, STIFFNESS = "share", "constant", "unbounded", "stiffness"
# And of a step.
NEAR_RIGID, LEAST, BEFORE = "near-rigid share", "least regularisation", "velocities before the step"
# And of a contact with friction.
FRICTION, RATIO, SLIDING_DAMPING = "friction", "ratio of impedances", "damping across the normal"
REST_OF_RATIO, REGULARISED = "rest of ratio", "regularised share"
STICKING, SLIDING, TOWARDS, REST_OF_TOWARDS = "sticking", "sliding", "towards", "rest of towards"


def number_of(name: str, what: str, row: int | None = None) -> str:
    """The name of a number of the law of a constraint, or of one of its rows by its number among all."""
    return f"{name}{'' if row is None else f'[{row}]'} {what}"


@dataclass(frozen=True)
class SoftenedProgram:
    """The program of a softened problem.

    Attributes:
        numbers: names and values of the parameters that it has behind the others.
        unbounded: a program of the same inputs whose output is, of each row that has a range of forces, the force without it, and then,
            of the rows of elliptic cones, J a - aref.
        ranged: the rows with a range by their constraint and number among all. round: the constraints with elliptic cones.
        ratios: a program of the same inputs whose output is the ratio of impedances of each of those that have one of their own at each
            state, ``regularised``; None without any.
        problem: a program of the same inputs: ``mass`` and ``force`` of the tree, ``jacobian``, ``wanted`` (aref less J' v) and
            ``weights`` (D) of the rows in the order of ``unbounded``, and then of those that hold on both sides.
        stiffened: the program whose accelerations are not eliminated; None where rows are rigid, or no cost has these forces.
        unbounded_by: the outputs of ``unbounded`` as functions of these accelerations, which are further inputs, (nv,), and of their rests,
            (nv,); None without elliptic cones, where an elimination instruction by instruction shows on which sides forces are.
    """

    program: StraightLineProgram
    numbers: list[tuple[str, float]]
    unbounded: StraightLineProgram
    ranged: list[tuple[str, int]]
    round: list[str]
    problem: StraightLineProgram
    stiffened: StraightLineProgram | None = None
    unbounded_by: StraightLineProgram | None = None
    ratios: StraightLineProgram | None = None
    regularised: tuple[str, ...] = ()

    @property
    def by_solution(self) -> tuple[StraightLineProgram, StraightLineProgram] | None:
        """See ``Zones``."""
        return None if self.stiffened is None or self.unbounded_by is None else (self.stiffened, self.unbounded_by)


# Of an elimination that is written root first, instructions being three for each: what 30 contacts of 40 bodies take is a tenth of that.
MOST_PRODUCTS = 60_000
# Those whose laws had other numbers last: a diagnosis tries one after the other.
_WRITTEN: Kept[SoftenedProgram] = Kept(8)


def softened_program(constraints: Constraints, laws: Mapping[str, Softness]) -> SoftenedProgram:
    """The program of the softened problem, which is written once for all numbers of the laws.

    ``laws`` is that of every constraint, redundant rows included. The program has an output more, the ``multipliers``, minus the force of
    each row: share D (r - b - J a) + constant, where a share of 1 and a constant of 0 are those of rows without a range of forces.
    Around a state the impedance of a constraint is linear in its rows, d = impedance + rest + sum of slope_i (phi_i - distance_i), so
    that its derivative by all inputs is felt; slopes and rests are 0 unless a state has its own.

    Raises:
        ValueError: there are other rows, or rolling ones.
    """
    places = {name: [row for row, owner in enumerate(constraints.rows) if owner == name] for name in constraints.names}
    given = {name: len(law.inverse_masses) for name, law in laws.items()}
    if given != {name: len(rows) for name, rows in places.items()} or constraints.holonomic != len(constraints.rows):
        count = f"{sum(given.values())} laws for {len(constraints.rows)} rows"
        raise ValueError(f"{count}, of which {constraints.holonomic} hold positions")
    numbers = [number for name, rows in places.items() for number in _numbers(name, rows, laws[name])]
    form = tuple((name, laws[name].form) for name in places)
    return replace(_WRITTEN.get((constraints.key, form), lambda: _written(constraints, laws, places, numbers)), numbers=numbers)


def _written(
    constraints: Constraints, laws: Mapping[str, Softness], places: Mapping[str, list[int]], numbers: list[tuple[str, float]]
) -> SoftenedProgram:
    tied = tied_equations(constraints, [name for name, _ in numbers], independent_only=False)
    builder, mass, jacobian, zero = tied.builder, tied.mass, tied.jacobian, tied.builder.number(0)
    known = {name: builder.inputs[builder.names.index(name)] for name, _ in numbers}
    started = _started(tied, known, next((name for name in places if laws[name].near_rigid is not None), None))
    tied = replace(tied, force=tied.force + started)
    at_an_instant = [(name, rows) for name, rows in places.items() if laws[name].near_rigid is None]
    exact = [row for name, rows in at_an_instant for row, own in zip(rows, laws[name].inverse_masses, strict=True) if own is None]
    columns = dict(zip(exact, solved(mass, [jacobian[row] for row in exact]) if exact else [], strict=True))
    weights, wanted, constants = (builder.zeros(len(constraints.rows)) for _ in range(3))
    ranged, shares = list[tuple[str, int]](), builder.vector([1] * len(constraints.rows))
    blocks, ratios = dict[str, Matrix](), dict[str, Term]()
    for name, rows in places.items():
        law = laws[name]
        impedance, rest, stiffness, damping = (known[number_of(name, what)] for what in (IMPEDANCE, REST, STIFFNESS, "damping"))
        for row in rows:
            slope, distance = (known[number_of(name, what, row)] for what in (SLOPE, DISTANCE))
            rest = rest + slope * (tied.residual[row] - distance)
        impedance = impedance + rest
        of_step = None if law.near_rigid is None else _of_step(known, name, _scale(mass, jacobian[rows]))
        for place, row in enumerate(rows):
            if of_step is not None:
                own = of_step
            else:
                own = jacobian[row] @ columns[row] if row in columns else known[number_of(name, INVERSE_MASS, row)]
            weights[row] = impedance / ((1 - impedance) * own)
            back = (stiffness * impedance) * tied.residual[row]
            bias = tied.bias[row] if law.has_bias else zero
            slowed = known.get(number_of(name, SLIDING_DAMPING), damping) if place else damping
            wanted[row] = -((slowed * tied.rate[row] + back) + bias)
            if law.has_range:
                shares[row], constants[row] = share_and_constant(tied, known, law, number_of(name, "", row))
                ranged.append((name, row))
        if law.friction:
            friction = vector(known[number_of(f"{name} {number}", FRICTION)] for number in range(len(law.friction)))
            ratio = known[number_of(name, RATIO)]
            if law.regularised is not None and of_step is not None:
                ratio = ratios[name] = of_step / (known[number_of(name, REGULARISED)] * _scale(mass, jacobian[rows]))
            weights[rows] = _of_cone(law, weights[rows[0]], friction, ratio, len(rows))
            if law.is_round:
                sticking, sliding = (known[number_of(name, what)] for what in (STICKING, SLIDING))
                towards = vector(known[number_of(name, TOWARDS, row)] + known[number_of(name, REST_OF_TOWARDS, row)] for row in rows)
                block = sliding * law.flow.weights(weights[rows[0]], friction, ratio, towards)
                for place, row in enumerate(rows):
                    block[place, place] = block[place, place] + sticking * weights[row]
                blocks[name] = block
    weighted = matrix([share * weight * row for share, weight, row in zip(shares, weights, jacobian, strict=True)])
    pulling = weighted.copy()
    for name, block in blocks.items():
        weighted[places[name]], pulling[places[name]] = block @ jacobian[places[name]], block.T @ jacobian[places[name]]
    required = vector(wanted)
    stiffened = matrix([[mass[i, j] + jacobian[:, i] @ weighted[:, j] for j in range(tied.nv)] for i in range(tied.nv)])
    pushed = [force + column @ constants for force, column in zip(tied.force, jacobian.T, strict=True)]
    pulled = vector(force + column @ required for force, column in zip(pushed, pulling.T, strict=True))
    given = vector(row @ constants + column @ required for row, column in zip(jacobian.T, pulling.T, strict=True))
    # Rows of loops would lose digits from the tips, and gain nothing; but of many bodies the other way takes more than memory holds.
    is_of_single_joints = all(sum(entry.value != 0 for entry in row) == 1 for row in jacobian)
    from_tips = is_of_single_joints or products_of_elimination(stiffened) > MOST_PRODUCTS
    is_symmetric = all(law.flow.is_convex for law in laws.values())
    eliminated = (solved_from_tips if from_tips else solved) if is_symmetric else solved_by_rows
    [moved] = eliminated(stiffened, [pulled])
    missing = required - jacobian @ moved
    unbounded = vector(weight * force for weight, force in zip(weights, missing, strict=True))
    held = vector(share * force for share, force in zip(shares, unbounded, strict=True)) + constants
    for name, block in blocks.items():
        held[places[name]] = block @ missing[places[name]]
    outside = [*(unbounded[row] for _, row in ranged), *(-missing[row] for name in blocks for row in places[name])]
    first = [*(row for _, row in ranged), *(row for name in blocks for row in places[name])]
    order = [*first, *(row for row in range(len(constraints.rows)) if row not in first)]
    asked = {"mass": tied.equations["mass"], "force": tied.force, JACOBIAN: jacobian[order].ravel()}
    asked |= {"wanted": required[order], "weights": weights[order]}
    problem = without_unused(builder.program(asked))
    return SoftenedProgram(
        # Minus, as those of the rigid forces -J' lambda.
        tied.with_forces(started + (pulling.T @ missing + jacobian.T @ constants), vector(-one for one in held)),
        numbers,
        without_unused(builder.program({UNBOUNDED: outside})),
        ranged,
        list(blocks),
        problem,
        tied.with_system(stiffened, started + given) if is_symmetric else None,
        _by_accelerations(problem, len(ranged), len(first)) if blocks else None,
        without_unused(builder.program({RATIO: ratios.values()})) if ratios else None,
        tuple(ratios),
    )


def _by_accelerations(problem: StraightLineProgram, ranged: int, count: int) -> StraightLineProgram:
    """``SoftenedProgram.unbounded_by`` for a problem whose first ``count`` rows have ranges, as the first of these have, or cones."""
    nv = len(problem.outputs["force"])
    names = (f"{what} {place}" for what in ("acceleration", "rest of acceleration") for place in range(nv))
    builder = Builder((*problem.inputs, *names))
    known, (*_, accelerations, rests) = builder.append(problem), np.split(vector(builder.inputs), [-2 * nv, -nv])
    jacobian = np.array(known[JACOBIAN], dtype=object).reshape(-1, nv)
    missing = vector(known["wanted"][:count]) - jacobian[:count] @ (accelerations + rests)
    outside = [*(weight * force for weight, force in zip(known["weights"], missing[:ranged], strict=False)), *-missing[ranged:]]
    return without_unused(builder.program({UNBOUNDED: outside}))


def share_and_constant(tied: Tied, known: Mapping[str, Term], law: Softness, row: str) -> tuple[Term, Term]:
    """The share of a row with a range that counts, and the force that is there besides; ``row`` as of ``number_of`` with nothing."""
    share, constant = (known[row + what] for what in (SHARE, CONSTANT))
    return share, constant * tied.builder.inputs[tied.builder.names.index(law.bound)] if law.bound else constant


def _started(tied: Tied, known: Mapping[str, Term], name: str | None) -> Vector:
    """Forces of 0 that feel half an ulp of the velocities that accelerations over a step are differences from; of one law of a step."""
    if name is None:
        return tied.builder.zeros(tied.nv)
    end = position_count(tied.constraints.tree) + tied.nv
    rates, per_step = vector(tied.builder.inputs[end - tied.nv : end]), known[number_of(name, "damping")]
    return per_step * (tied.mass @ (known[number_of(name, BEFORE)] * rates - rates))


def _scale(metric: Matrix, jacobian: Matrix) -> Term:
    """w of the rows of a constraint in a step, see ``harness.files.rules``."""
    weighted = matrix([[entry / metric[place, place] for place, entry in enumerate(row)] for row in jacobian])
    block = matrix([[row @ other for other in jacobian] for row in weighted])
    return block[0, 0] if len(jacobian) == 1 else length(block.ravel()) / len(jacobian)


def _of_step(known: Mapping[str, Term], name: str, scale: Term) -> Term:
    """R of the rows of a constraint in a step, of a contact that along the normal; ``scale`` is w."""
    near_rigid, least = (known[number_of(name, what)] for what in (NEAR_RIGID, LEAST))
    apart = near_rigid * scale - least
    return least + (apart + sqrt(apart * apart)) / 2


def _of_cone(law: Softness, first: Term, friction: Vector, ratio: Term, count: int) -> Vector:
    """The weights D of the rows of a contact with friction, from that of an impedance and an inverse mass."""
    steepest = friction[0] * friction[0]
    if law.is_round:
        return vector([first, *((first * ratio) * ((own * own) / steepest) for own in friction)])
    # The diagonal of J M^-1 J' is that of the edge itself.
    edge = first if law.inverse_masses[0] is None else first / (steepest + 1)
    return vector([(edge * ratio) / (2 * steepest)] * count)


def _numbers(name: str, rows: Sequence[int], law: Softness) -> Iterator[tuple[str, float]]:
    """Names and values of the numbers of the law of a constraint."""
    of_all = {IMPEDANCE: law.impedance, REST: 0.0, STIFFNESS: law.stiffness, "damping": law.damping}
    if law.near_rigid is not None and law.least is not None:
        of_all |= {NEAR_RIGID: law.near_rigid, LEAST: law.least, BEFORE: 1.0}
    if law.friction:
        of_all |= {RATIO: law.ratio}
        of_all |= {} if law.regularised is None else {REGULARISED: law.regularised, REST_OF_RATIO: 0.0}
        of_all |= {} if law.sliding_damping is None else {SLIDING_DAMPING: law.sliding_damping}
        of_all |= {STICKING: 0.0, SLIDING: 0.0} if law.is_round else {}
        yield from ((number_of(f"{name} {number}", FRICTION), value) for number, value in enumerate(law.friction))
    yield from ((number_of(name, what), value) for what, value in of_all.items())
    for row, inverse_mass in zip(rows, law.inverse_masses, strict=True):
        own = {DISTANCE: 0.0, SLOPE: 0.0} | ({} if inverse_mass is None else {INVERSE_MASS: inverse_mass})
        own |= {SHARE: 1.0, CONSTANT: 0.0} if law.has_range else {}
        # Anything across the normal, until a state has its own.
        own |= {TOWARDS: 1.0, REST_OF_TOWARDS: 0.0} if law.is_round else {}
        yield from ((number_of(name, what, row), value) for what, value in own.items())
