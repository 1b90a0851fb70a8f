"""What else engines compute than accelerations, each a ``Quantity`` declared in a module of this package.

Accelerations have a cross-check of their own. A quantity here is judged by certified values in blocks, see
``harness.certify.quantity``.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from harness.arrays import Array
from harness.certify.certified import Certified
from harness.engines import Model
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidRequest
from harness.library import nearest
from harness.models.model_file import ModelFile
from harness.models.step_rule import StepRule
from harness.results.records import ACCELERATIONS
from harness.robots.constraints import untied
from harness.robots.mechanism import RobotMechanism
from harness.robots.reactions import have_same_points
from harness.robots.robot import Robot, robot_of
from harness.storage import Kept

# Stands for every quantity.
ALL = "all"


@dataclass(frozen=True)
class Question:
    """What a quantity is asked of.

    Attributes:
        mechanism: whose joints q, v and tau follow.
        declared: the model file whose numbers are the truth for all that read another of the same mechanism.
        read: the model file that the engine reads. Both are None for a robot, whose mechanism brings the robot of its one file.
        linear_velocity_in_body: the frame in which it gives the linear velocity of a free joint.
        softened: makes of a mechanism under the constraints of ``declared`` the one whose constraints give as the engine declares of
            ``read``; None where it holds them rigid.
    """

    mechanism: Mechanism
    declared: ModelFile | None
    read: ModelFile | None
    linear_velocity_in_body: bool
    softened: Callable[[Mechanism], Mechanism] | None = None
    step_rules: tuple[StepRule, ...] = ()

    def robot_of(self, file: ModelFile | None) -> Robot:
        """The robot of ``declared`` or of ``read``."""
        if file is not None:
            return _ROBOTS.get((file.text, self.mechanism.gravity), lambda: robot_of(file, self.mechanism.gravity))
        assert isinstance(self.mechanism, RobotMechanism)
        return self.mechanism.robot

    @property
    def has_other_points(self) -> bool:
        """Whether points of joints are elsewhere by the numbers of ``read`` than by those of ``declared``."""
        if self.declared is None or self.read is None or self.declared.text == self.read.text:
            return False
        joints = tuple(dict.fromkeys(self.mechanism.joints))
        own, other = (untied(self.robot_of(file).tree, joints) for file in (self.declared, self.read))
        key = self.declared.text, self.read.text, self.mechanism.gravity, joints
        return not _SAME_POINTS.get(key, lambda: have_same_points(own, other, joints))


# By the text of a file, and of two.
_ROBOTS: Kept[Robot] = Kept(16)
_SAME_POINTS: Kept[bool] = Kept(64)


class Truth(Protocol):
    """The certified values of a quantity; made once, asked for many batches."""

    @property
    def key(self) -> Hashable:
        """Equal for truths that have the same values at every state."""

    @property
    def blocks(self) -> Sequence[str]:
        """What each block is, as a report says it."""

    def evaluate(self, states: States) -> Certified:
        """The values at ``states``."""

    def answers(self, model: Model, states: States) -> Array:
        """Those of an engine, in the shape of the certified ones.

        Raises:
            harness.engines.NotOffered: the engine does not offer them.
            harness.engines.InvalidAnswer: it returns something else.
        """


@dataclass(frozen=True)
class Quantity:
    """One quantity.

    Attributes:
        name: for the command line and the records.
        truth: makes its truth. It raises ``harness.errors.InvalidModel`` where the declared file is no truth, and
            ``harness.engines.NotOffered`` where the mechanism has nothing of the kind.
        is_of_engine: whether the truth asks what engine reads the file: for its law of constraints, or its rules of steps.
        is_quick: whether a check that names no quantity compares it as well, at a few states.
        describe: of a truth, states, what is certified there and answers that disagree, what is wrong with them; None where it is
            enough to name the block that is farthest off.
        group: the name that stands for it and others of its kind, as "derivatives"; "" for none.
    """

    name: str
    truth: Callable[[Question], Truth]
    is_of_engine: bool = False
    is_quick: bool = True
    describe: Callable[[Any, States, Certified, Array], str] | None = None
    group: str = ""


def find_quantities() -> dict[str, Quantity]:
    """Every quantity that a module of this package holds, by name."""
    modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    found = {value.name: value for module in modules for value in vars(module).values() if isinstance(value, Quantity)}
    return dict(sorted(found.items()))


def select_quantities(names: Sequence[str]) -> list[str]:
    """The quantities of these names, each once, in a fixed order with accelerations first; accelerations for no names.

    A name may be that of a group, or ``ALL``.

    Raises:
        InvalidRequest: there is no such quantity.
    """
    groups = {ACCELERATIONS: "", **{quantity.name: quantity.group for quantity in find_quantities().values()}}
    for name in names:
        _require(name, [*groups, *dict.fromkeys(filter(None, groups.values())), ALL])
    return [name for name, group in groups.items() if {name, group, ALL} & set(names)] or [ACCELERATIONS]


def require_quantity(name: str) -> None:
    """Raises InvalidRequest where there is no such quantity."""
    _require(name, [ACCELERATIONS, *find_quantities()])


def _require(name: str, known: Sequence[str]) -> None:
    if name not in known:
        raise InvalidRequest(f"no quantity is called {name!r}; {nearest(name, known)}")
