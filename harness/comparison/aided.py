"""An aided engine on a robot's file as an engine of a cross-check, a search or a benchmark.

It is handed the mechanism of the file and takes the robot of that alone: no equation of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.comparison.questions import Answers, Caller, Loaded, Question, Refused, Run, ask
from harness.comparison.states import request_of, spread
from harness.engines import NotOffered, Unsupported
from harness.engines.interface import METHODS
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.robots.mechanism import RobotMechanism
from harness.robots.robot import Robot

if TYPE_CHECKING:
    from harness.models.model_file import ModelFile

# Joints in a message.
MOST_NAMED = 4


class AidedModel:
    """A robot's file in an aided engine; q, v and tau follow ``robot.joints``.

    Attributes:
        is_coupled: whether joints that mimic others are eliminated from the engine's M and forces.
        factorises_mass_matrix: whether M is factorised, by the engine or for that.
    """

    def __init__(self, robot: Robot, loaded: Loaded, factorises: bool) -> None:
        self.robot, self.loaded_robot = robot, loaded
        self.is_coupled = any(joint.follows for joint in robot.tree.joints)
        self.factorises_mass_matrix = factorises or self.is_coupled
        self._joints = request_of(robot, aided=False).joints
        ends = np.cumsum([0, *(len(joint.velocities) for joint in loaded.joints)])
        places = {joint.name: range(*bounds) for joint, *bounds in zip(loaded.joints, ends[:-1], ends[1:], strict=True)}
        self._own = [column for name in robot.joints for column in places[name]]

    def loaded(self) -> None:
        """Nothing to audit: the file itself is what the engine is held against."""

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        run = self.prepare(q, v, tau)
        try:
            run.compute()
        except Refused as refusal:
            raise Unsupported(f"the engine refuses what the file holds: {refusal}") from refusal
        return self.accelerations(run)

    def prepare(self, q: Array, v: Array, tau: Array) -> Run:
        """The states in the engine's own conventions, those of joints that follow another among them."""
        states = spread(self.robot, States.at(q, v, tau), self._joints)
        return self.loaded_robot.prepare(states.q, states.v, states.tau)

    @property
    def model(self) -> Any:
        """The engine's own model, for what it computes by itself.

        Raises:
            Unsupported: the model alone is another mechanism, because something is supplied to it state by state.
        """
        if self.is_coupled:
            raise Unsupported("joints that mimic others are eliminated state by state, and no step of the engine's own does that")
        if not all(joint.is_measured_in_the_world for joint in self._joints):
            raise Unsupported("a free joint is measured in a frame of the file, which no step of the engine's own does")
        if self.loaded_robot.is_supplied_with_forces:
            raise Unsupported("springs or dampers are supplied as applied forces, which no step of the engine's own feels")
        return self.loaded_robot.model

    def __getattr__(self, name: str) -> Any:
        """What the engine computes beside accelerations, as ``harness.engines.interface`` says.

        Raises:
            NotOffered: states would have to be converted on the way, or the engine is asked about accelerations alone.
        """
        if name not in METHODS:
            raise AttributeError(name)
        if self.is_coupled:
            raise NotOffered("joints that mimic others are eliminated from accelerations alone")
        if not all(joint.is_measured_in_the_world for joint in self._joints):
            raise NotOffered("a free joint is measured in a frame of the file")
        quantities = getattr(self.loaded_robot, "quantities", None)
        if quantities is None:
            raise NotOffered("robots' files are asked about accelerations alone")
        return getattr(quantities(self.robot.joints), name)

    @property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Positions and velocities of the joints in the engine's own q and v, in the order of ``robot.joints``."""
        return self.loaded_robot.addresses(self.robot.joints)

    def accelerations(self, run: Run) -> Array:
        """(n, nv), in the order of ``robot.joints``, what the last ``compute`` of a run found."""
        return np.ascontiguousarray(run.accelerations()[:, self._own])


class AidedEngine:
    """The ``ENGINE`` of a caller's module."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self.requires, self.formats, self.optional = caller.requires, caller.formats, caller.optional

    def ask(self, question: Question) -> Answers:
        """See ``harness.comparison.questions.ask``; the engine is plain where nothing is supplied."""
        return ask(self._caller, question)

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> AidedModel:
        if not isinstance(source, RobotMechanism):
            raise TypeError(f"{self._caller.engine} reads the file of a robot, not {type(source).__name__}")
        robot, caller = source.robot, self._caller
        try:
            loaded = caller.load(request_of(robot, aided=True))
        except Refused as refusal:
            raise Unsupported(f"{caller.engine} refuses the file: {refusal}") from refusal
        if lacking := [name for name in robot.joints if name not in {joint.name for joint in loaded.joints}]:
            raise Unsupported(f"{caller.engine} has no joint {_named(robot, lacking)} after loading: its reader leaves out what holds it")
        return AidedModel(robot, loaded, caller.factorises_mass_matrix)


def _named(robot: Robot, joints: Sequence[str]) -> str:
    """The first few joints with their lines, and how many more there are."""
    places = [(name, robot.joint(name).place) for name in joints[:MOST_NAMED]]
    named = ", ".join(f"{name!r} (line {place.line})" if place else repr(name) for name, place in places)
    return named + (f" and {len(joints) - MOST_NAMED} more" if len(joints) > MOST_NAMED else "")
