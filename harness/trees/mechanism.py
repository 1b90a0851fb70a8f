"""A robot as a mechanism, for all that works on mechanisms: certified reference, data roundoff, sampling.

The parameters are the numbers of the file, each the float64 that an engine reads, so that data roundoff includes the rounding of
each decimal as it does for the parameters of a system.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile
from harness.files.tree import Given, Joint
from harness.programs.evaluation import mass_matrix, solved
from harness.programs.mechanisms.applied_forces import forces_of
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import right_hand_side
from harness.programs.states import DEFAULT_RATES, States
from harness.trees.bodies.spatial import FileProgram, parameter_name
from harness.trees.recursion import recursion_program
from harness.trees.robot import Robot, tree_of

# Of a joint without limits [m].
_REACH = (-1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class RobotMechanism(Mechanism):
    """A mechanism with the robot whose equations it has, which engines that read robots' files are handed.

    Attributes:
        given: the numbers of the file that are its parameters.
        digest: of the file's content, which an engine may make more of than its equations hold; "" where no engine reads it.
        request: what an engine that reads the file by itself is to load; None where none does.
    """

    robot: Robot
    given: tuple[Given, ...] = ()
    digest: str = ""
    request: Any = None

    @property
    def handed_to_engines(self) -> Any:
        return self.request or self

    @property
    def key(self) -> Hashable:
        return super().key, self.digest


def named(numbers: Sequence[Given]) -> tuple[tuple[str, float, str], ...]:
    """Numbers of a file as the parameters of a mechanism."""
    return tuple((parameter_name(value), float(value), "") for value in numbers)


def mechanism_of(robot: Robot) -> RobotMechanism:
    """The mechanism whose joints are ``robot.joints`` in this order; positions are sampled within the limits of joints that have some.

    Its q holds a quaternion for each ball or free joint, as of ``recursion_program``; it has no energies and no text.
    """
    started = time.perf_counter()
    joints = [robot.joint(name) for name in robot.joints]
    recursion = recursion_program(robot.tree, robot.joints)
    has_free = any(joint.kind == JointKind.FREE for joint in joints)
    in_body = (recursion_program(robot.tree, robot.joints, linear_velocity_in_body=True).program,) if has_free else ()
    ranges = [bounds for joint in joints for bounds in _ranges(joint)]
    rates = [DEFAULT_RATES] * len(ranges)
    rotating = [turns for joint in joints for turns in joint.kind.turning]
    firsts = itertools.accumulate((joint.kind.velocities for joint in joints), initial=0)
    attitudes = [first + joint.kind.linear for joint, first in zip(joints, firsts, strict=False) if joint.kind.has_attitude]
    return RobotMechanism(
        name=robot.path.stem,
        description=f"The robot of {robot.path.name}.",
        source="",
        coordinates=tuple(f"{joint.name} {suffix}".rstrip() for joint in joints for suffix in joint.kind.coordinates),
        joints=tuple(joint.name for joint in joints for _ in joint.kind.coordinates),
        parameters=named(recursion.parameters),
        given=recursion.parameters,
        gravity=math.hypot(*map(float, robot.tree.gravity)),
        total_mass=robot.total_mass,
        rotating=tuple(rotating),
        position_ranges=tuple(ranges),
        rate_ranges=tuple(rates),
        **forces_of(recursion.program, recursion.numbers, ranges, rates, attitudes),
        attitudes=tuple(attitudes),
        charts_in_body=in_body,
        program=recursion.program,
        equations_text="",
        equations_mathml="",
        derivation_seconds=time.perf_counter() - started,
        robot=robot,
    )


def _ranges(joint: Joint) -> tuple[tuple[float, float] | None, ...]:
    """The range of each coordinate; None for an angle without limits."""
    if joint.limits is not None and joint.kind.is_single:
        low, high = map(float, joint.limits)
        return ((math.radians(low), math.radians(high)) if joint.in_degrees else (low, high),)
    return tuple(None if turns else _REACH for turns in joint.kind.turning)


BITS, LEAST_BITS = 192, 80


def accelerations(model: ModelFile, joints: Sequence[str], gravity: float, states: States) -> Array:
    """qdd, (n, nv), at states as ``recursion_program`` takes them; NaN where fewer than ``LEAST_BITS`` bits of one are certain.

    ``gravity`` [m/s^2, along -z] is for a URDF, which holds none. No float64 kernel is compiled.

    Raises:
        InvalidModel: as ``read_robot``. ValueError: the model has other joints.
    """
    return accelerations_of(recursion_program(tree_of(model, gravity), joints), states)


def accelerations_of(recursion: FileProgram, states: States) -> Array:
    """``accelerations`` of a tree's program."""
    import flint

    nv, found = states.v.shape[1], np.full_like(states.v, np.nan)
    with flint.ctx.workprec(BITS):
        evaluate = recursion.in_balls()
        for row, (q, v, tau, time) in enumerate(zip(states.q, states.v, states.tau, states.time, strict=True)):
            outputs = evaluate(*q.tolist(), *v.tolist(), *tau.tolist(), float(time))
            force = right_hand_side(outputs, [flint.arb(applied) for applied in tau.tolist()])
            solution = solved(mass_matrix(outputs["mass"], nv), force)
            if all(ball.rel_accuracy_bits() >= LEAST_BITS or ball == 0 for ball in solution):
                found[row] = [float(ball) for ball in solution]
    return found
