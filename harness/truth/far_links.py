"""The digits that MuJoCo loses at light links far from the centre of mass of their tree, about which it forms inertias."""

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

FAR_LINKS = (
    "no error is beyond what roundings of m r^2 do at light links far from the centre of mass of their tree, about which the engine forms "
    "inertias, and no number of the file explains them"
)


class FarLinks:
    """The bodies that joints of one robot carry, and their distances from the centre of all, with every joint at zero.

    MuJoCo forms composite inertias about that centre: what a joint carries has m r^2 there, of which the small inertia about the joint's
    own axis is what is left of a difference. One unit roundoff of m r^2 stays in the entries of M, whatever the arithmetic of the rest.

    Source: MuJoCo documentation, Computation, ``mjData.cinert``: com-based body inertia; the hard case of this name in ``harness.hard``.

    Attributes:
        masses: (nv,) mass that the joint of each velocity carries [kg]. arms: (nv,) distance of its centre from that of all [m].
        weight: length of gravity [m/s^2].
    """

    def __init__(self, robot: Robot) -> None:
        nodes = canonical(robot)
        places: dict[str, Array] = {"": np.zeros(3)}
        for name, node in nodes.items():
            places[name] = places[node.parent] + node.anchor
        carried = {name: _carried(nodes, places, name) for name in nodes}
        roots = [carried[name] for name, node in nodes.items() if not node.parent]
        mass = sum(one for one, _ in roots)
        centre = sum((one * where for one, where in roots), np.zeros(3)) / mass if mass else np.zeros(3)
        of_velocities = [carried[name] for name in robot.joints for _ in range(robot.joint(name).kind.velocities)]
        self.masses = np.array([own for own, _ in of_velocities])
        self.arms = np.array([float(np.linalg.norm(where - centre)) for _, where in of_velocities])
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
        forces = self.masses * self.arms * (self.arms * moved[:, None] + self.weight)
        bound = ROUNDINGS * UNIT_ROUNDOFF * (reach * forces).sum(axis=1)
        error = energy_norm(truth.norm_factor, (accelerations - truth.high) - truth.low)
        return np.asarray(error <= bound)


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
