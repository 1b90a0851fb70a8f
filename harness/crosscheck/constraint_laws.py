"""The laws by which an engine's constraints give, of the file that it reads: as it documents them, and as its program has them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.engines import ConstraintLaw, InverseWeight, Model, load_engine
from harness.errors import InvalidModel
from harness.explain.as_read import ReadTruth
from harness.files.equalities import Constraint
from harness.files.model_file import ModelFile
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism, all_rows
from harness.programs.states import States
from harness.trees.robot import tree_of
from harness.truth.compare import Certified, Comparison
from harness.truth.quantities import Truth
from harness.verdict import Verdict

if TYPE_CHECKING:
    from harness.explain.changes.departures import Departure

# Of two inverse weights that are one; less is rounding.
_SAME = 1e-12


def laws_of(library: Library, engine: str, read: ModelFile, departures: Collection[str] = ()) -> Mapping[str, ConstraintLaw]:
    """The law of each constraint of a file, by its name, with departures of the engine by these names; none of constraints held rigid."""
    laws = load_engine(library, engine).constraint_laws(read)
    if not laws or not departures:
        return laws
    # Imported late: a truth by documentation needs nothing of it.
    from harness.explain.changes.departures import departed, departures_of

    chosen = [one for one in departures_of(engine, load_engine(library, engine).reader) if one.name in departures]
    return departed(chosen, tree_of(read, 0.0), read.all_acting, laws)


def departures_from(library: Library, engine: str, read: ModelFile) -> dict[Departure, list[Constraint]]:
    """The engine's departures that bear on constraints of a file, each with these."""
    laws = laws_of(library, engine, read)
    if not laws:
        return {}
    from harness.explain.changes.departures import departures_of

    found, tree = {}, tree_of(read, 0.0)
    for departure in departures_of(engine, load_engine(library, engine).reader):
        concerned = departure.concerned(tree, read.all_acting, laws)
        own = laws_of(library, engine, read, (departure.name,))
        if felt := [one for one in concerned if _differ(read, laws[one.name], own[one.name])]:
            found[departure] = felt
    return found


def _differ(read: ModelFile, one: ConstraintLaw, other: ConstraintLaw) -> bool:
    """True where laws of one constraint differ in more than the words for the same inverse weights."""
    if one.weights is None or other.weights is None or one.has_curvature != other.has_curvature:
        return one != other
    weights = _weights(read, [one, other])
    sums = [[sum(weights[part] for part in row) for row in law.weights or ()] for law in (one, other)]
    return any(abs(first - second) > _SAME * abs(first) for first, second in zip(*sums, strict=True))


def _weights(read: ModelFile, laws: Iterable[ConstraintLaw]) -> Mapping[InverseWeight, float]:
    """The inverse weights that laws name.

    Raises:
        InvalidModel: there are none, for M has no inverse where all joints are zero.
    """
    # A mechanism without constraints imports nothing of it.
    from harness.trees.inverse_weights import inverse_weights

    try:
        return inverse_weights(read, (part for law in laws for row in law.weights or () for part in row))
    except ValueError as error:
        problem = f"its constraints have no weight: {error}; correct the masses, inertias or places"
        raise InvalidModel(read.path, read.root_line, problem) from error


def softening(laws: Mapping[str, ConstraintLaw], read: ModelFile) -> Callable[[Mechanism], Mechanism]:
    """Makes of a mechanism whose constraints are held rigid the one whose constraints give by laws of the file ``read``.

    Raises:
        InvalidModel: from the function, where constraints have no weight, or other rows than the mechanism's.
    """

    def softened(mechanism: Mechanism) -> Mechanism:
        from harness.truth.declared import declared

        weights = _weights(read, laws.values())
        try:
            return declared(mechanism, laws, weights, all_rows(mechanism))
        except ValueError as error:
            line = next((one.line for one in read.constraints if repr(one.name) in str(error)), read.root_line)
            raise InvalidModel(read.path, line, str(error)) from error

    return softened


class DepartedTruth(ReadTruth):
    """The truth by the law of constraints that an engine's program has, where that departs from the documented one, ``of_file``.

    An answer that agrees with it alone is ``explained``. One that agrees with the documented law is right: the program may be mended.
    """

    def __init__(self, read: Truth, documented: Truth) -> None:
        super().__init__(read, documented, lambda states: states, slice(None))
        self.rigid = documented.rigid

    def judge(self, certified: Certified, states: States, answers: Array, model: Model) -> Comparison:
        """See ``Truth``."""
        found = super().judge(certified, states, answers, model)
        left = np.flatnonzero(found.verdicts == Verdict.DISAGREES.value)
        if not len(left):
            return found
        documented = self.of_file.judge(self.of_file.evaluate(states[left]), states[left], answers[left], model)
        agrees = documented.verdicts == Verdict.AGREES.value
        kept = np.setdiff1d(np.arange(len(states)), left[agrees])
        return Comparison.concatenate([found[kept], documented[agrees]])[np.argsort(np.concatenate([kept, left[agrees]]))]
