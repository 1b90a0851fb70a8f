"""Digits that engines lose at light links far from the point about which they form inertias: MuJoCo, and Newton."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.trees.canonical import CanonicalNode, canonical
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, Flags
from harness.truth.reference import ROUNDINGS, Reference, energy_norm
from harness.verdict import Verdict

# The centre of mass of a whole tree, and the origin of the world; see ``harness.engines.Engine``.
TREE, WORLD = "tree", "world"
_POINTS = {TREE: "the centre of mass of their tree", WORLD: "the origin of the world"}


def far_links_of(about: str) -> str:
    """The cause in a sentence, of an engine that forms inertias about a point."""
    return (
        f"no error is beyond what roundings of m r^2 do at light links far from {_POINTS[about]}, about which the engine forms "
        "inertias, and no number of the file explains them"
    )


class FarLinks:
    """The bodies that joints of one robot carry, and their distances from the point about which an engine forms inertias.

    They are those with every joint at zero, and from the origin of the world longer by what slides and free joints move. MuJoCo forms
    composite inertias about the centre of a tree, and Newton about the origin of the world: what a joint carries has m r^2 there, of which
    the small inertia about the joint's own axis is what is left of a difference. One unit roundoff of m r^2 stays in the entries of M,
    whatever the arithmetic of the rest.

    Source: MuJoCo documentation, Computation, ``mjData.cinert``: com-based body inertia; the hard case of this name in ``harness.hard``.

    Attributes:
        masses: (nv,) mass that the joint of each velocity carries [kg]. arms: (nv,) distance of its centre from the point [m].
        weight: length of gravity [m/s^2]. unit_roundoff: of the numbers that the engine computes with.
        moving: columns of q by which bodies come away from the point [m].
    """

    def __init__(self, robot: Robot, about: str = TREE, unit_roundoff: float = UNIT_ROUNDOFF) -> None:
        nodes = canonical(robot)
        places: dict[str, Array] = {"": np.zeros(3)}
        for name, node in nodes.items():
            places[name] = places[node.parent] + node.anchor
        carried = {name: _carried(nodes, places, name) for name in nodes}
        roots = [carried[name] for name, node in nodes.items() if not node.parent]
        mass = sum(one for one, _ in roots)
        centre = sum((one * where for one, where in roots), np.zeros(3)) / mass if mass and about == TREE else np.zeros(3)
        of_velocities = [carried[name] for name in robot.joints for _ in range(robot.joint(name).kind.velocities)]
        self.masses = np.array([own for own, _ in of_velocities])
        self.arms = np.array([float(np.linalg.norm(where - centre)) for _, where in of_velocities])
        self.unit_roundoff, self.moving = unit_roundoff, _linear(robot) if about == WORLD else []
        self.weight = float(np.linalg.norm([float(component) for component in robot.tree.gravity]))

    def excused(self, found: Comparison, truth: Reference, states: States, accelerations: Array) -> Comparison:
        """The judgement of accelerations (n, nv), unstable where they disagree by no more than the distance of the links explains."""
        disagree = found.verdicts == Verdict.DISAGREES.value
        if not disagree.any():
            return found
        lost = disagree & self.explain(truth, states, accelerations)
        return replace(found, verdicts=np.where(lost, Verdict.UNSTABLE.value, found.verdicts))

    def explain(self, truth: Reference, states: States, accelerations: Array) -> Flags:
        """(n,) whether the error of accelerations (n, nv) is not beyond what unit roundoffs of m r^2 in M, and of m r in forces, do."""
        # |M^-1 e_j|_M = |R^-T e_j| with M = R' R.
        inverse = np.linalg.inv(truth.norm_factor)
        reach = np.sqrt((inverse**2).sum(axis=2))
        # What a joint carries is accelerated by all joints, by their rates, and by gravity.
        moved = np.abs(truth.high).sum(axis=1) + (states.v**2).sum(axis=1)
        arms = self.arms + np.abs(states.q[:, self.moving]).sum(axis=1, keepdims=True)
        forces = self.masses * arms * (arms * moved[:, None] + self.weight)
        bound = ROUNDINGS * self.unit_roundoff * (reach * forces).sum(axis=1)
        error = energy_norm(truth.norm_factor, (accelerations - truth.high) - truth.low)
        return np.asarray(error <= bound)


def _linear(robot: Robot) -> list[int]:
    """Columns of the linear positions in q."""
    found: list[int] = []
    start = 0
    for name in robot.joints:
        kind = robot.joint(name).kind
        found += range(start, start + kind.linear)
        start += kind.positions
    return found


def _carried(nodes: dict[str, CanonicalNode], places: dict[str, Array], name: str) -> tuple[float, Array]:
    """Mass and centre, in the world, of all that moves with a joint."""
    mass, first = 0.0, np.zeros(3)
    for other, node in nodes.items():
        at = other
        while at and at != name:
            at = nodes[at].parent
        if at:
            mass += node.total.mass
            first = first + node.total.mass * (places[other] + node.total.centre)
    return mass, first / mass if mass else places[name]
