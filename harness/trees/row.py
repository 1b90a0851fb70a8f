"""One row of a constraint on the moving bodies of a tree: where its multiplier acts, its Jacobian, and what it asks of accelerations.

Source: Featherstone, Rigid Body Dynamics Algorithms, section 3.2 (constraints on position, and their derivatives).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from harness.programs.mechanisms.mechanism import BIAS, JACOBIAN, RATE, RESIDUAL
from harness.programs.terms import Term, Vector, cross
from harness.trees.bodies.rigid import Spatial, power, spatial
from harness.trees.world_motion import World, accelerations_of_nodes


@dataclass(frozen=True)
class Row:
    """One row of a constraint; moments and forces are along the world's axes.

    Attributes:
        constraint: its name.
        on_nodes: (number of a node, moment about the origin of its frame and force) of a multiplier of 1.
        on_columns: (place of a velocity, generalised force).
        residual: what the row leaves.
        known: the part of the row's acceleration that is due to neither the accelerations of nodes nor those of velocities.
    """

    constraint: str
    residual: Term
    known: Term
    on_nodes: tuple[tuple[int, Spatial], ...] = ()
    on_columns: tuple[tuple[int, Term], ...] = ()


def jacobian_of(world: World, row: Row) -> Vector:
    """By which each velocity changes a row, (nv,)."""
    found = world.kinematics.builder.zeros(world.kinematics.nv)
    for number, (moment, force) in row.on_nodes:
        for one in world.up_from(number):
            arm = world.moving[number].position + -one.position
            for (about, along), column in one.rates:
                found[column] = found[column] + (moment @ about + force @ (along + cross(about, arm)))
    for column, factor in row.on_columns:
        found[column] = found[column] + factor
    return found


def equations_of_rows(world: World, rows: Sequence[Row]) -> dict[str, list[Term]]:
    """The outputs of ``harness.programs.mechanisms.mechanism`` for rows."""
    jacobian = [jacobian_of(world, row) for row in rows]
    rates = [row @ world.kinematics.coordinates.velocities for row in jacobian]
    # Of nodes where no velocity changes.
    carried = accelerations_of_nodes(world, world.kinematics.builder.zeros(world.kinematics.nv))
    return {
        RESIDUAL: [row.residual for row in rows],
        JACOBIAN: [entry for row in jacobian for entry in row],
        RATE: rates,
        BIAS: [sum((power(acts, carried[number]) for number, acts in row.on_nodes), row.known) for row in rows],
    }


def opposed(row: Row) -> Row:
    """The row of minus what is left."""
    acts = tuple((number, spatial(-moment, -force)) for number, (moment, force) in row.on_nodes)
    return replace(row, known=-row.known, on_nodes=acts, on_columns=tuple((column, -factor) for column, factor in row.on_columns))


def plus(row: Row, factor: Term, acts: Sequence[tuple[int, Spatial]]) -> Row:
    """The row whose multiplier does besides ``factor`` times what ``acts`` does, on the same nodes."""
    both = tuple((number, own + factor * added) for (number, own), (_, added) in zip(row.on_nodes, acts, strict=True))
    return replace(row, on_nodes=both)
