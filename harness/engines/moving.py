"""Whole motions of users' files by an engine, with everything on that the file says, as plain data that goes to another process.

What an engine holds of a file is told by causes, each number with the engine's name of its array and the name of its owner, so that the
numbers of another file, version or engine can be laid over them before the file is moved.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.interface import NotOffered
from harness.engines.request import Refused
from harness.errors import InvalidRequest
from harness.files.joint_kinds import JointKind
from harness.results.cause import DriftCause

# An array of the engine, and the owner of a row of it.
NumberKey = tuple[str, str]
Numbers = Mapping[NumberKey, Array]
_FORM = re.compile(r"(?P<engine>[^/@]+(?:@[^/@]+)?)(?:/(?P<integrator>[^/@]*)(?:@(?P<length>[^/@]+))?)?")
# Rounding of a time that is a multiple of a period, relative.
_ALIKE = 1e-9


@dataclass(frozen=True)
class MovedBy:
    """Who moves a file: an engine, or a version of it as NAME@VERSION, its integrator, and the step length [s].

    The integrator is "" for the one that the file chooses, or the first that the engine has; the length None for that of the file.
    """

    engine: str
    integrator: str = ""
    length: float | None = None

    @classmethod
    def parsed(cls, text: str) -> MovedBy:
        """From ENGINE[@VERSION][/INTEGRATOR[@SECONDS]].

        Raises:
            InvalidRequest: the text is none.
        """
        form = _FORM.fullmatch(text)
        try:
            length = float(form["length"]) if form and form["length"] else None
        except ValueError:
            form = None
        if form is None or (length is not None and not 0 < length < math.inf):
            raise InvalidRequest(f"{text!r}: expected ENGINE[@VERSION][/INTEGRATOR[@SECONDS]], as mujoco@3.13.0 or mujoco/RK4@0.001")
        return cls(form["engine"], form["integrator"] or "", length)


@dataclass(frozen=True)
class MovedFile:
    """A file to be moved, by an integrator of the engine and with a step length [s]; "" and None for those of the file.

    ``format``: "urdf" or "mjcf".
    """

    path: Path
    format: str
    integrator: str = ""
    length: float | None = None


@dataclass(frozen=True)
class NamedNumber:
    """A number that the author of a file may have measured wrongly, and what an engine holds of it.

    Attributes:
        owner: as "joint elbow". what: as files call it. value: that of the file. least: the smallest that it can be.
        key: the array of the engine, and the owner there, by which its line is found.
        directions: what a unit of it adds to each row that holds it. natural: a small change of it where it is 0.
    """

    cause: DriftCause
    owner: str
    what: str
    value: float
    key: NumberKey
    directions: Numbers
    least: float = -np.inf
    natural: float = 1e-3


@dataclass(frozen=True)
class HeldNumbers:
    """Numbers that an engine holds of a file, and the state in which the file starts.

    Attributes:
        by_cause: each number, as an array of what stands in its row.
        joints: name to kind, in the order of the engine. q, v: (nq,), (nv,) of its first keyframe, or of its reference configuration.
        length: of a step [s]. integrator: the engine's name of it.
        switches: of a cause that acts in the file, the number that is 0 where nothing of it does.
        rules: of integrators that users write by an engine's accelerations, the numbers by which this engine takes their steps.
        words: of an array that holds values of an enumeration, their names.
        control: of each actuator, by the same. servos: of each joint whose position one actuator alone is given, that.
        named: numbers that may be wrong, each with one value. idle: those that bear on nothing as long as others are 0.
        note: what the engine left out of the file to read it; "" for nothing.
    """

    by_cause: Mapping[DriftCause, Numbers]
    joints: Mapping[str, JointKind]
    q: Array
    v: Array
    control: Mapping[str, float]
    length: float
    integrator: str
    words: Mapping[str, Mapping[int, str]] = field(default_factory=dict)
    switches: Mapping[DriftCause, NumberKey] = field(default_factory=dict)
    rules: Mapping[str, Numbers] = field(default_factory=dict)
    servos: Mapping[str, str] = field(default_factory=dict)
    named: Sequence[NamedNumber] = ()
    idle: frozenset[NumberKey] = frozenset()
    note: str = ""

    def __getitem__(self, cause: DriftCause) -> Numbers:
        return self.by_cause.get(cause, {})


@dataclass(frozen=True, eq=False)
class Control:
    """Controls of actuators over time, each held until the next.

    Attributes:
        names: of actuators; the others have 0. times: (n,) [s], increasing. values: (n, names).
        function: instead of both, (t, q, v) to the controls by name, or in the order of ``names``; q and v over the joints of a request.
            Without names a plan fills in those of all actuators.
    """

    names: tuple[str, ...]
    times: Array
    values: Array
    function: Callable[[float, Array, Array], Any] | None = None

    @classmethod
    def constant(cls, values: Mapping[str, float]) -> Control:
        return cls(tuple(values), np.zeros(1), np.array([list(values.values())]))

    @classmethod
    def calling(cls, function: Callable[[float, Array, Array], Any], names: Sequence[str] = ()) -> Control:
        return cls(tuple(names), np.zeros(0), np.zeros((0, len(names))), function)

    def of_actuators(self, actuators: Collection[str], servos: Mapping[str, str]) -> Control:
        """The same for ``actuators``: a column that is called as a joint is that of its servo, and a function has all of them.

        Raises:
            InvalidRequest: a column is of neither, or two are of one actuator.
        """
        if self.function is not None and not self.names and not actuators:
            raise InvalidRequest("no actuator is in both sides, so that a control moves nothing; leave it out, or add actuators")
        names = [name if name in actuators else servos.get(name, name) for name in self.names]
        if self.function is not None and not names:
            names = list(actuators)
        if lacking := [name for name in names if name not in actuators]:
            expected = ", ".join(actuators) or "none, for no actuator is in both"
            raise InvalidRequest(
                f"no actuator of both sides is called {lacking[0]!r}, which is controlled, nor has a joint of that name one servo of its "
                f"position; expected {expected}"
            )
        if twice := [name for name in names if names.count(name) > 1]:
            raise InvalidRequest(f"two columns control actuator {twice[0]!r}, one by the name of its joint; leave out one")
        return replace(self, names=tuple(names))

    def held_at(self, times: Array) -> Array:
        """(n, names) at times; before the first one it has the first."""
        # A time that is a sum of steps misses that of the table by a rounding.
        rows = np.searchsorted(self.times, times + _ALIKE * np.maximum(times, _ALIKE), side="right") - 1
        return np.asarray(self.values[np.maximum(rows, 0)])

    def called(self, time: float, q: Array, v: Array) -> Array:
        """(names,) of the function at a state; NaN, by which a motion ends, where that has broken down, or what the function returns later.

        Raises:
            ValueError: it returns something else.
        """
        assert self.function is not None
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            return np.full(len(self.names), np.nan)
        found = self.function(time, q, v)
        if isinstance(found, Mapping):
            if unknown := found.keys() - set(self.names):
                raise ValueError(f"the control has {sorted(unknown)[0]!r}, which no actuator is called; expected {', '.join(self.names)}")
            found = [found.get(name, 0.0) for name in self.names]
        values = np.asarray(found, dtype=np.float64)
        if values.shape != (len(self.names),) or not (time or np.isfinite(values).all()):
            raise ValueError(f"the control returns {values}; expected {len(self.names)} finite numbers")
        return values


@dataclass(frozen=True)
class Timing:
    """Times at which controls are computed and act: each ``period`` [s], 0 for each step, and ``delay`` [s] later."""

    period: float = 0.0
    delay: float = 0.0

    def asked_at(self, times: Array) -> Array:
        """The time of which the control acts, for each time; the first one acts before any has arrived."""
        late = np.maximum(times - self.delay, 0.0)
        return late if not self.period else np.floor(late / self.period + _ALIKE) * self.period


@dataclass(frozen=True)
class SimulatedFile:
    """One motion of a file.

    Attributes:
        over: the numbers that are laid over those of the file. timing: of its controls.
        counts: of steps, increasing, after each of which q and v are recorded.
        rounding: a seed; after each step every number of the state is moved by up to half an ulp, as another order of sums moves it. 0: no.
    """

    file: MovedFile
    over: Numbers
    timing: Timing
    counts: tuple[int, ...]
    rounding: int = 0


@dataclass(frozen=True, eq=False)
class MotionsRequest:
    """Several motions from one start, q (nq,) and v (nv,) over ``joints`` in this order, under one control.

    ``as_it_stands``: whether files are moved without numbers laid over them, which takes no engine that says what it holds of them.
    ``wants_mass``: whether M is asked for.
    """

    motions: Sequence[SimulatedFile]
    joints: tuple[str, ...]
    q: Array
    v: Array
    control: Control
    as_it_stands: bool = False
    wants_mass: bool = True


@dataclass(frozen=True)
class Moved:
    """Recorded states of several motions, (m, k, nq) and (m, k, nv) over the joints of the request, NaN from where one breaks down.

    ``mass``: M of the first one at its states, (k, nv, nv), where it is asked for.
    """

    q: Array
    v: Array
    mass: Array


def moved_as_they_stand(
    engine: str, request: MotionsRequest, move: Callable[[SimulatedFile, MotionsRequest], tuple[Array, Array]], turns_freely: bool = False
) -> Moved:
    """Motions by an engine that lays nothing over files; ``move`` gives q and v, (k, nq) and (k, nv), after the recorded steps of one.

    ``turns_freely``: whether joints may have several velocities.

    Raises:
        NotOffered: of controls, of numbers that are laid over a file, and without a length of steps.
        Refused: a joint has several velocities; and from ``move``.
    """
    laid = any(one.over or one.timing.period or one.timing.delay or one.file.length is None for one in request.motions)
    if not request.as_it_stands or laid or request.control.names:
        raise NotOffered(f"{engine} moves files as they stand, without controls, by steps of a given length")
    if len(request.q) != len(request.joints) and not turns_freely:
        raise Refused(f"{engine} is asked to move hinges and slides alone here")
    found = [move(motion, request) for motion in request.motions]
    return Moved(np.array([q for q, _ in found]), np.array([v for _, v in found]), np.empty(0))
