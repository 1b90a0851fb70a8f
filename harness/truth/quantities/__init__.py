"""Quantities that engines compute, each a ``Quantity`` declared in a module of this package.

A quantity has a ``Truth``: certified values in blocks (``Certified``), by which answers are judged.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from harness.arrays import Array
from harness.engines import Calls, Model, timed_answers_of
from harness.files.equalities import Equality
from harness.files.model_file import ModelFile
from harness.files.rules import StepRule
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.registry import declared, select
from harness.storage import Kept
from harness.trees.mechanism import RobotMechanism
from harness.trees.quantities.motion import have_same_points
from harness.trees.robot import Robot, robot_of
from harness.trees.rows import untied
from harness.truth.compare import Certified, Comparison, compare, farthest_block
from harness.truth.reference import asked_at

# Share of the states at which a declared truth is asked elsewhere.
ASKED_ELSEWHERE = 0.5
# Stands for every quantity.
ALL = "all"


@dataclass(frozen=True)
class TruthBasis:
    """Mechanism, files and engine that the truth of a quantity is founded on.

    Attributes:
        mechanism: whose joints q, v and tau follow.
        declared: the model file whose numbers are the truth for all that read another of the same mechanism.
        read: the model file that the engine reads. Both are None for a robot, whose mechanism brings the robot of its one file.
        linear_velocity_in_body: the frame in which it gives the linear velocity of a free joint.
        softened: makes of a mechanism under the constraints of ``declared`` the one whose constraints give as the engine declares of
            ``read``; None where it holds them rigid.
        step_rules: of the integrators that the engine documents.
        unit_roundoff: of the numbers that the engine computes with. factorises: whether it declares that it factorises M.
        inertias_about: as the engine declares it, see ``harness.engines.Engine``.
        ties: the equalities of a user's file that act, by the names that their rows have in what ``softened`` makes.
    """

    mechanism: Mechanism
    declared: ModelFile | None
    read: ModelFile | None
    linear_velocity_in_body: bool
    softened: Callable[[Mechanism], Mechanism] | None = None
    step_rules: tuple[StepRule, ...] = ()
    unit_roundoff: float = UNIT_ROUNDOFF
    factorises: bool = False
    inertias_about: str = ""
    ties: tuple[Equality, ...] = ()

    @functools.cached_property
    def joints(self) -> tuple[str, ...]:
        """The joints of the mechanism, each once."""
        return tuple(dict.fromkeys(self.mechanism.joints))

    def robot_of(self, file: ModelFile | None) -> Robot:
        """The robot of ``declared`` or of ``read``, each of whose joints moves by itself."""
        if file is None:
            assert isinstance(self.mechanism, RobotMechanism)
            return self.mechanism.robot

        def written() -> Robot:
            robot = robot_of(file, self.mechanism.gravity)
            return replace(robot, joints=self.joints, tree=untied(robot.tree, self.joints))

        return _ROBOTS.get((file.text, self.mechanism.gravity, self.joints), written)

    @property
    def has_other_points(self) -> bool:
        """True where points of joints are elsewhere by the numbers of ``read`` than by those of ``declared``."""
        if self.declared is None or self.read is None or self.declared.text == self.read.text:
            return False
        own, other = (self.robot_of(file).tree for file in (self.declared, self.read))
        key = self.declared.text, self.read.text, self.mechanism.gravity, self.joints
        return not _SAME_POINTS.get(key, lambda: have_same_points(own, other, self.joints))


# By the text of a file, and of two.
_ROBOTS: Kept[Robot] = Kept(16)
_SAME_POINTS: Kept[bool] = Kept(64)


class Truth(ABC):
    """The certified values of a quantity; made once, asked for many batches.

    Attributes:
        blocks: the name of each block, as a report says it; none for a quantity of one block that needs no other name.
        rigid: the truth that answers are compared with too, for how far they are from it; None for most.
        unit_roundoff: of the answers that it judges.
    """

    blocks: Sequence[str]
    rigid: Truth | None = None
    unit_roundoff: float = UNIT_ROUNDOFF

    @property
    @abstractmethod
    def key(self) -> Hashable:
        """Equal for truths that have the same values at every state."""

    @property
    def is_compiled(self) -> bool:
        """False where the first evaluation in this process takes longer than those that follow."""
        return True

    def asked_at(self, states: States, share: float = ASKED_ELSEWHERE) -> States:
        """The states at which answers are held against it where a check has come to ``states``.

        They are the same, but for a declared truth, which takes a ``share`` of them elsewhere.
        """
        return states

    @abstractmethod
    def evaluate(self, states: States) -> Certified:
        """The values at ``states``."""

    @abstractmethod
    def asks(self, model: Model, states: States) -> Calls:
        """The calls of an engine, whose answers are formed into the shape of the certified ones."""

    def answers(self, model: Model, states: States) -> Array:
        """Those of an engine, in the shape of the certified ones.

        Raises:
            harness.engines.NotOffered: the engine does not offer them.
            harness.engines.InvalidAnswer: it returns something else.
        """
        found: Array = timed_answers_of(model, [self.asks(model, states)])[0][0]
        return found

    def asks_all(self, model: Model, states: States) -> Calls:
        """Everything that an engine is asked for a judgement, beside the answers too, for ``judge_all``."""
        return self.asks(model, states)

    def judge_all(self, certified: Certified, states: States, found: Any, model: Model) -> Comparison:
        """The judgement of what an engine answered to ``asks_all``."""
        return self.judge(certified, states, found, model)

    def asked_and_judged(self, certified: Certified, states: States, model: Model) -> Comparison:
        """The judgement of the answers that a model gives now; raises as ``answers``."""
        return self.judge_all(certified, states, timed_answers_of(model, [self.asks_all(model, states)])[0][0], model)

    def may_lose_digits(self, model: Model) -> bool:
        """True where an answer that lost digits to an ill-conditioned M is ``unstable``, not wrong."""
        return False

    def judge(self, certified: Certified, states: States, answers: Array, model: Model) -> Comparison:
        """The judgement of a model's answers by the certified values at the same states."""
        return compare(certified, answers)

    def describe(self, certified: Certified, states: States, answers: Array, model: Model) -> str:
        """A sentence on answers that disagree, "" where there is nothing to say; here the block that is farthest off."""
        return f"Farthest off is the {self.blocks[farthest_block(certified, answers)]}"


class RoundedTruth(Truth):
    """A truth for an engine that computes in float32: at states rounded to it, in data roundoffs of ``unit_roundoff``.

    What the engine takes of a file it rounds too, which is one unit roundoff of each number, as of each number of a state.
    """

    def __init__(self, exact: Truth, unit_roundoff: float) -> None:
        self._exact, self.unit_roundoff, self.blocks = exact, unit_roundoff, exact.blocks

    @property
    def key(self) -> Hashable:
        """See ``Truth``."""
        return self._exact.key, self.unit_roundoff

    @property
    def is_compiled(self) -> bool:
        """See ``Truth``."""
        return self._exact.is_compiled

    def asked_at(self, states: States, share: float = ASKED_ELSEWHERE) -> States:
        """See ``Truth``."""
        return asked_at(self._exact.asked_at(states, share), self.unit_roundoff)

    def evaluate(self, states: States) -> Certified:
        """See ``Truth``."""
        return self._exact.evaluate(asked_at(states, self.unit_roundoff)).for_unit_roundoff(self.unit_roundoff)

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``."""
        return self._exact.asks(model, asked_at(states, self.unit_roundoff))

    def judge(self, certified: Certified, states: States, answers: Array, model: Model) -> Comparison:
        """See ``Truth``."""
        return self._exact.judge(certified, asked_at(states, self.unit_roundoff), answers, model)

    def describe(self, certified: Certified, states: States, answers: Array, model: Model) -> str:
        """See ``Truth``."""
        return self._exact.describe(certified, asked_at(states, self.unit_roundoff), answers, model)


@dataclass(frozen=True)
class Quantity:
    """One quantity.

    Attributes:
        name: for the command line and the records.
        truth: makes its truth, whose precision ``truth_of`` sees to. It raises ``harness.errors.InvalidModel`` where the declared file is
            no truth, and ``harness.engines.NotOffered`` where the mechanism has nothing of the kind.
        is_of_file: whether the truth takes the numbers of a declared model file.
        has_laws, has_step_rules: whether it asks the engine that reads the file for its laws of constraints, or its rules of steps.
        is_default: whether it is the one that is meant where none is named, which every engine claims to compute.
        is_quick: whether a check that names no quantity compares it as well, at a few states.
        takes_all: whether of a user's file all acts that an engine's answers are judged with: actuators, dry friction, limits, equalities.
        is_asked_again: whether a check times several calls and holds their answers against each other.
        group: the name that stands for it and others of its kind, as "derivatives"; "" for none.
    """

    name: str
    truth: Callable[[TruthBasis], Truth]
    is_of_file: bool = True
    has_laws: bool = False
    has_step_rules: bool = False
    is_default: bool = False
    is_quick: bool = True
    takes_all: bool = False
    is_asked_again: bool = False
    group: str = ""

    def truth_of(self, basis: TruthBasis) -> Truth:
        """The truth for the engine of a basis, in the precision in which that computes; raises as ``truth``."""
        found = self.truth(basis)
        return found if found.unit_roundoff == basis.unit_roundoff else RoundedTruth(found, basis.unit_roundoff)


@functools.cache
def find_quantities() -> dict[str, Quantity]:
    """Every quantity that a module of this package holds, by name, the default one first."""
    return dict(sorted(declared(__name__, Quantity, "quantity").items(), key=lambda item: (not item[1].is_default, item[0])))


def further_quantities() -> list[Quantity]:
    """All but the default one."""
    return [quantity for quantity in find_quantities().values() if not quantity.is_default]


def select_quantities(names: Sequence[str]) -> list[str]:
    """The quantities of these names, each once and in the order of ``find_quantities``; the default one for no names.

    A name may be that of a group, or ``ALL``.

    Raises:
        InvalidRequest: there is no such quantity.
    """
    known = find_quantities()
    groups = dict.fromkeys([one.group for one in known.values() if one.group])
    select(names, known | groups | {ALL: None}, "quantity")
    chosen = [one.name for one in known.values() if {one.name, one.group, ALL} & set(names)]
    return chosen or [one.name for one in known.values() if one.is_default]


def require_quantity(name: str) -> None:
    """Raises InvalidRequest where there is no such quantity."""
    select([name], find_quantities(), "quantity")
