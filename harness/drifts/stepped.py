"""Motions by an engine that exchanges no numbers: its accelerations, stepped by the rules that its users write, with what it applies alone.

Of the other side's numbers those are switched off that it does not apply; see ``without_what_is_not_applied``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from harness.arrays import Array
from harness.comparison.gap import OWN_RULES, advanced, in_their_order, refuse_own_frames
from harness.comparison.robot_library import robot_at
from harness.drifts.plan import MovingSide
from harness.engines import Engine
from harness.engines.loaded_file import LoadedFile
from harness.engines.moving import HeldNumbers, MotionsRequest, Moved, MovedFile, NumberKey, SimulatedFile
from harness.engines.request import AskedJoint
from harness.errors import InvalidRequest
from harness.explain.meant import request_of
from harness.files.findings import EQUALITIES, FRICTION, LIMITS
from harness.files.rules import StepRule
from harness.library import Stance
from harness.registry import select
from harness.results.cause import DriftCause

_OFF = {FRICTION: DriftCause.FRICTION, LIMITS: DriftCause.LIMITS, EQUALITIES: DriftCause.EQUALITIES}
_HALF_ULP = 2.0**-53


def without_what_is_not_applied(engine: Engine, side: MovingSide, numbers: HeldNumbers) -> HeldNumbers:
    """Numbers of another engine for a side, as they are where this engine moves it.

    Raises:
        Refused: the engine does not read the file. InvalidRequest: it has no such rule, or as ``read``.
    """
    loaded, _ = _loaded(engine, side.file)
    off = [DriftCause.GAIN, *(cause for kind, cause in _OFF.items() if kind in engine.why_off)]
    off += [DriftCause.CONTACT_GEOMETRY] * (engine.contacts is None)
    off += [DriftCause.DAMPING] * (not loaded.applies_dampers) + [DriftCause.SPRINGS] * (not loaded.applies_springs)
    changed: dict[DriftCause, dict[NumberKey, Array]] = {cause: dict(own) for cause, own in numbers.by_cause.items()}
    for cause in off:
        if cause in numbers.switches:
            changed[cause][numbers.switches[cause]] = np.zeros(1)
    rule = _rule(engine, side.integrator)
    changed[DriftCause.INTEGRATOR] |= numbers.rules[rule.name]
    return replace(numbers, by_cause=changed, integrator=f"{rule.name} of one's own", note="")


def stepped(engine: Engine, request: MotionsRequest) -> Moved:
    """The motions of a request, of files with no numbers laid over; raises as ``without_what_is_not_applied``."""
    tracks = []
    for motion in request.motions:
        loaded, joints = _loaded(engine, motion.file)
        assert not motion.over and motion.file.length is not None
        rule = replace(_rule(engine, motion.file.integrator), length=motion.file.length)
        move = partial(_track, (loaded, joints), rule, motion)
        tracks.append(in_their_order(request.joints, joints, (request.q, request.v), move))
    found = [np.array([track[part] for track in tracks]) for part in range(2)]
    return Moved(found[0], found[1], np.empty(0))


def _track(
    loaded: tuple[LoadedFile, Sequence[AskedJoint]], rule: StepRule, motion: SimulatedFile, q: Array, v: Array
) -> tuple[Array, Array]:
    generator = np.random.default_rng(motion.rounding) if motion.rounding else None
    track: tuple[list[Array], list[Array]] = ([], [])
    done = 0
    for until in motion.counts:
        for _ in range(1 if generator is None else until - done):
            q, v = advanced(*loaded, q, v, rule, until - done if generator is None else 1)
            if generator is not None:
                q, v = (values * (1 + generator.uniform(-1, 1, len(values)) * _HALF_ULP) for values in (q, v))
        done = until
        track[0].append(q)
        track[1].append(v)
    return np.array(track[0]), np.array(track[1])


def _rule(engine: Engine, name: str) -> StepRule:
    rule, *_ = select([name or OWN_RULES[0].name], {one.name: one for one in OWN_RULES}, f"integrator by {engine.name}'s accelerations")
    return rule


def _loaded(engine: Engine, file: MovedFile) -> tuple[LoadedFile, Sequence[AskedJoint]]:
    robot = robot_at(file.path)
    request = request_of(robot, Stance.PLAIN)
    refuse_own_frames(file.path, robot.tree)
    loaded = engine.read(request)
    if lacking := [joint.name for joint in request.joints if joint.name not in [one.name for one in loaded.found]]:
        raise InvalidRequest(f"{engine.name} reads no joint {lacking[0]!r} from {file.path.name}")
    return loaded, request.joints
