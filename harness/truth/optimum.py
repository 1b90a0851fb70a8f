"""A robot with some constraints of its file, whose accelerations are the optimum that an engine documents for them.

Equalities act on both sides, dry friction up to its bound, and limits on one side where they are reached: rows of one program all the same.

A textbook's dry friction and limits are rows of it too, by Coulomb's law and as rigid stops.

Source: MuJoCo documentation, Computation, sections Constraint model and Solver parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from harness.files.equalities import AnyRows, Constraint, DryFriction, Equality, Limit, Tendon, TendonLinkage
from harness.files.rules import ConstraintLaw, rigid_law
from harness.programs.mechanisms.mechanism import Mechanism
from harness.trees.inverse_weights import inverse_weights_of
from harness.trees.mechanism import RobotMechanism, named, tied_tree
from harness.trees.robot import Robot
from harness.truth.declared import declared


def optimum(
    mechanism: RobotMechanism,
    robot: Robot,
    constraints: Sequence[Constraint],
    laws: Mapping[str, ConstraintLaw],
    fuses: bool,
    step: float | None = None,
) -> Mechanism:
    """The mechanism with those constraints that have rows and a law, by their names; ``fuses`` as of ``inverse_weights_of``.

    ``robot`` has the equations of motion of the mechanism. Without constraints, accelerations are those over a step of the length
    ``step`` [s], where that is no None.

    Raises:
        KeyError: one is about a body or joint that the tree does not have. ValueError: as ``inverse_weights_of``.
    """
    acting = sorted((one for one in constraints if one.name in laws and one.rows), key=lambda one: not isinstance(one, Equality))
    if not acting and step is not None:
        # Most answers are of an instant.
        from harness.trees.metric import started

        written, numbers = started(robot.tree, robot.joints, step)
        own = (*named(written.parameters), *((name, value, "") for name, value in numbers))
        return replace(mechanism, program=written.program, parameters=own, given=written.parameters, other_charts=(), charts_in_body=())
    if not acting:
        return mechanism
    rows = {one.name: one.rows for one in acting if one.rows is not None}
    written = mechanism.written
    if (of_step := next((laws[one.name].of_step for one in acting), None)) is not None:
        # Most laws are of an instant.
        from harness.trees.metric import in_metric

        written = in_metric(robot.tree, robot.joints, of_step.length)
    tied = tied_tree(robot.tree, robot.joints, rows, written=written)
    if any(laws[one.name].in_body for one in acting):
        # Most laws are of velocities in the frame of the parent.
        from harness.trees.turning import turning_with_bodies

        tied = replace(tied, constraints=turning_with_bodies(tied.constraints, robot))
    weights = inverse_weights_of(
        mechanism.robot.tree,
        (part for one in acting for row in laws[one.name].weights or () for part in row),
        fuses,
        (tendon for one in acting for tendon in _tendons(one.rows)),
    )
    equalities = {one.name for one in acting if isinstance(one, Equality)}
    holding = tied.constraints.first(sum(name in equalities for name in tied.constraints.rows))
    plain = replace(mechanism, parameters=named(tied.parameters), constraints=holding, other_charts=(), charts_in_body=())
    return replace(declared(plain, {one.name: laws[one.name] for one in acting}, weights, tied.constraints), given=tied.parameters)


def _tendons(rows: AnyRows | None) -> Sequence[Tendon]:
    if isinstance(rows, DryFriction | Limit):
        return () if isinstance(rows.of, str) else (rows.of,)
    return rows.tendons if isinstance(rows, TendonLinkage) else ()


def held_rigid(mechanism: Mechanism) -> Mechanism:
    """The mechanism with its rows of dry friction and limits by Coulomb's law and as rigid stops; itself without any.

    Source: Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, chapter 5.
    """
    tied, bounded = mechanism.constraints, mechanism.bounded
    if bounded is None:
        return mechanism
    values, bounds = {name: value for name, value, _ in mechanism.parameters}, dict(mechanism.dry_friction)
    ranges = {name: (-values[bounds[name]], values[bounds[name]]) if name in bounds else (0.0, math.inf) for name in bounded.names}
    ranges |= {} if tied is None else dict.fromkeys(tied.names, ConstraintLaw.force_range)
    rows = bounded if tied is None else tied.some(tied.independent).beside(bounded)
    return declared(mechanism, {name: rigid_law(ranges[name]) for name in rows.names}, {}, rows)
