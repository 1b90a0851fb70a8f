"""Two motions of robots' files by engines and their integrators, as a study for worker processes; the gap is that of ``gap``."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.comparison.gap import LENGTH, OWN_RULES, Motion, advanced, gap_of, in_their_order, refuse_own_frames
from harness.comparison.matching import SameStates, match, refuse_unknown, renamed_to
from harness.comparison.robot_library import engines_of_files, robot_at
from harness.engines import NotOffered, installed_version, runs_elsewhere
from harness.engines.moving import MovedBy
from harness.engines.request import Refused
from harness.errors import InvalidRequest
from harness.explain.as_read import read_by
from harness.explain.meant import request_of
from harness.files.document.source import read_any
from harness.files.joint_kinds import JointKind
from harness.files.reading import format_of
from harness.files.rules import StepRule
from harness.library import Stance
from harness.motion.trajectories import Start
from harness.programs.states import States
from harness.registry import select
from harness.results.gap import Gap, Gaps, Mover
from harness.study import Inquiry, Part, Study, ask, call
from harness.trees.mechanism import mechanism_of
from harness.trees.recursion import step_forces
from harness.trees.robot import Robot
from harness.workers import Task

# Of two step lengths, relative: those that are multiples in decimals are so in float64 but for a rounding.
_ALIKE = 1e-12


def beside_the_harness(by: MovedBy) -> MovedBy:
    """The same, of an engine that is installed beside the harness: its steps are taken in this process, state by state.

    Raises:
        InvalidRequest: no such engine moves robots.
    """
    (engine,) = select([by.engine], engines_of_files(), "engine")
    if runs_elsewhere(engine) or installed_version(engine) is None:
        raise InvalidRequest(f"{by.engine} is not installed beside the harness, where steps are taken; install {engine.requires[1]}")
    return by


def first_two(paths: Sequence[Path]) -> tuple[MovedBy, MovedBy]:
    """The first two engines beside the harness, by name: the first that reads the first file, and the next that reads the last one.

    Raises:
        InvalidModel: a file cannot be read, or is no robot.
        InvalidRequest: there are no two.
    """
    beside = {name: one for name, one in engines_of_files().items() if not runs_elsewhere(one) and installed_version(one) is not None}
    chosen: list[str] = []
    for model_format in (format_of(paths[0]), format_of(paths[-1])):
        chosen += [name for name, one in beside.items() if model_format in one.call and name not in chosen][:1]
    if len(chosen) < 2:
        raise InvalidRequest(f"{' and '.join(chosen) or 'no engine'} beside the harness reads the files; say by --by twice who moves them")
    return MovedBy(chosen[0]), MovedBy(chosen[1])


@dataclass(frozen=True)
class GapSettings:
    """Two motions: of ``paths``, one for both or one each, by ``by``; ``steps`` of the first, of the second as many as last as long.

    ``start`` is {"q": [...], "v": [...]} by the joints of the first file, as JSON, "" for a moderate one that moves every joint;
    ``renamed`` as of ``harness.comparison.study``.
    """

    paths: tuple[Path, Path]
    by: tuple[MovedBy, MovedBy]
    steps: int
    floating_base: bool = False
    renamed: tuple[tuple[str, str], ...] = ()
    start: str = ""


# q and v of the joints of the first file.
_Place = tuple[Array, Array]


@dataclass(frozen=True)
class _Case:
    """One motion before it is computed: the robot of the file and as its reader has it, the rule, and the rest of the record."""

    robot: Robot
    read: Robot
    rule: StepRule
    mover: Mover


class GapStudy(Study):
    """The gap between two motions."""

    title, steps = "gap", 3

    def __init__(self, settings: GapSettings) -> None:
        super().__init__(Gaps())
        self.settings = settings

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._gap()]

    def _gap(self) -> Inquiry[None]:
        """Both motions from one start, and what their gap is due to."""
        prepared = yield from ask(call, _prepare, self.settings)
        if self.fails(prepared):
            return
        cases, names, start = prepared.value
        ends = yield [Task(None, call, (_move, case, *start, names)) for case in cases]
        for by, end in zip(self.settings.by, ends, strict=True):
            if not self.fails(end):
                yield Part(f"motion of {by.engine}", Gaps())
        if any(end.value is None for end in ends):
            return
        found = yield from ask(call, _gap, cases, start, names, [end.value for end in ends])
        if not self.fails(found):
            yield self.kept("shares", Gaps(gaps=[found.value]))


# Tasks for worker processes.


def _prepare(settings: GapSettings) -> tuple[tuple[_Case, _Case], tuple[str, ...], tuple[Array, Array]]:
    """Both cases, the joints of the first, and where both start."""
    robots = [robot_at(path, settings.floating_base) for path in settings.paths]
    refuse_unknown(robots, dict(settings.renamed), ())
    matching = match(robots[0], robots[1], dict(settings.renamed))
    if matching.problem:
        raise InvalidRequest(f"the files are not one robot: {matching.problem}")
    robots[1] = renamed_to(robots[1], {other: one for one, other in matching.names.items()})
    rules = [_rule(robot, by) for robot, by in zip(robots, settings.by, strict=True)]
    if any(rule in OWN_RULES for rule in rules) and not any(by.length for by in settings.by):
        # One's own steps are as long as those of the other.
        length = next((rule.length for rule in rules if rule not in OWN_RULES), LENGTH)
        rules = [replace(rule, length=length) for rule in rules]
    counts = (settings.steps, _as_long(settings.steps, rules[0].length, rules[1].length))
    cases = tuple(_case(*each) for each in zip(robots, settings.by, rules, counts, strict=True))
    start = Start.of(mechanism_of(cases[0].read))
    q, v = _given(settings.start, len(start.q), len(start.v)) if settings.start else (start.q, start.v)
    names = cases[0].read.joints
    _hold_coordinates(cases[0].read, cases[1].read, q, v)
    return (cases[0], cases[1]), names, (q, v)


def _given(text: str, nq: int, nv: int) -> tuple[Array, Array]:
    try:
        found = json.loads(text)
        q, v = (np.array(found[name], dtype=np.float64) for name in ("q", "v"))
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidRequest(f'{text!r}: expected {{"q": [...], "v": [...]}}') from error
    if (q.shape, v.shape) != ((nq,), (nv,)):
        raise InvalidRequest(f"the start has {q.size} positions and {v.size} velocities; expected {nq} and {nv}")
    return q, v


def _rule(robot: Robot, by: MovedBy) -> StepRule:
    own = engines_of_files()[by.engine].own_rules(read_any(robot.path, "a model").root, robot.format)
    noun = "integrator" if own else f"integrator of one's own by {by.engine}'s accelerations"
    rule, *_ = select(filter(None, [by.integrator]), {rule.name: rule for rule in own or OWN_RULES}, noun)
    return rule if by.length is None else replace(rule, length=by.length)


def _as_long(steps: int, length: float, other: float) -> int:
    count = round(steps * length / other)
    if count < 1 or abs(count * other - steps * length) > _ALIKE * steps * length:
        raise InvalidRequest(f"{steps} steps of {length:g} s are no whole number of steps of {other:g} s; choose steps that end together")
    return count


def _case(robot: Robot, by: MovedBy, rule: StepRule, steps: int) -> _Case:
    if any(joint.kind == JointKind.PLANAR for joint in robot.tree.joints):
        raise InvalidRequest(f"{robot.path.name} has a {JointKind.PLANAR} joint, which no rule moves")
    if any(joint.follows for joint in robot.tree.joints) or robot.equalities:
        raise InvalidRequest(f"{robot.path.name} ties joints beside its tree; the gap is that of trees")
    refuse_own_frames(robot.path, robot.tree)
    folded = read_by(robot, by.engine, engines_of_files()[by.engine], Stance.PLAIN)
    if set(folded.robot.joints) != set(robot.joints):
        raise InvalidRequest(f"{by.engine} reads other joints from {robot.path.name} than it has")
    mover = Mover(
        path=str(robot.path),
        engine=by.engine,
        integrator=rule.name,
        length=rule.length,
        steps=steps,
        readings=tuple(reading.sentence for reading, _ in folded.applied),
    )
    return _Case(robot, folded.robot, rule, mover)


def _hold_coordinates(first: Robot, second: Robot, q: Array, v: Array) -> None:
    """Refuse robots whose coordinates have other values at the same state."""
    states = States.at(q, v, np.zeros_like(v))
    second = replace(second, joints=first.joints)
    other = SameStates(first, second).of_second(states)
    if not (np.array_equal(other.q, states.q) and np.array_equal(other.v, states.v)):
        raise InvalidRequest("the files measure a ball or free joint in frames that are turned against each other")


def _move(case: _Case, q: Array, v: Array, names: Sequence[str]) -> tuple[Array, Array]:
    """State at which the engine ends, by the joints ``names``."""
    request = request_of(case.robot, Stance.PLAIN)
    try:
        loaded = engines_of_files()[case.mover.engine].read(request)
    except Refused as refusal:
        raise InvalidRequest(f"{case.mover.engine} refuses {case.robot.path.name}: {refusal}") from refusal

    def moved(q: Array, v: Array) -> tuple[Array, Array]:
        try:
            return loaded.advanced(q, v, case.rule, case.mover.steps)
        except NotOffered:
            return advanced(loaded, request.joints, q, v, case.rule, case.mover.steps)

    found_q, found_v = in_their_order(names, request.joints, (q, v), moved)
    if not (np.isfinite(found_q).all() and np.isfinite(found_v).all()):
        raise InvalidRequest(f"the motion of {case.mover.engine} by {case.rule.name} breaks down within {case.mover.steps} steps")
    return found_q, found_v


def _gap(cases: Sequence[_Case], start: _Place, names: Sequence[str], ends: Sequence[_Place]) -> Gap:
    first, second = (Motion(step_forces(case.read.tree, names), case.rule, case.mover, *end) for case, end in zip(cases, ends, strict=True))
    return gap_of(first, second, *start, mechanism_of(cases[0].read).attitudes)
