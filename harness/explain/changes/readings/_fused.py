"""Links of a URDF that MuJoCo fuses with the moving link that carries them, as its compiler does by default."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from harness.arrays import Array
from harness.engines.request import BodyInertia
from harness.engines.tree_request import frame_of
from harness.files.tree import WORLD, Body, Tree

# mjMINVAL.
LEAST_MASS = 1e-15


def carried(tree: Tree) -> Iterator[tuple[str, Body, Array, Array]]:
    """Each link from the root down, behind the moving link that it is a part of, WORLD for none: orientation (3, 3) and origin there."""
    carriers: dict[str, tuple[str, Array, Array]] = {}
    for body in _from_the_root_down(tree, WORLD):
        carrier, turn, origin = carriers.get(body.parent, (WORLD, np.eye(3), np.zeros(3)))
        if body.joints:
            carrier, turn, origin = body.name, np.eye(3), np.zeros(3)
        else:
            own_turn, own_origin = frame_of(body.pose)
            turn, origin = turn @ own_turn, origin + turn @ own_origin
        carriers[body.name] = carrier, turn, origin
        yield carrier, body, turn, origin


def _from_the_root_down(tree: Tree, name: str) -> Iterator[Body]:
    for body in tree.bodies:
        if body.parent == name:
            yield body
            # A link may bear the name of the world, with which it is one.
            yield from _from_the_root_down(tree, body.name) if body.name != WORLD else ()


def joined(one: BodyInertia, other: BodyInertia) -> BodyInertia:
    """Two bodies as one, in the frame of both."""
    mass = one.mass + other.mass
    centre = (one.mass * one.centre + other.mass * other.centre) / mass
    arms = [(part.mass, part.centre - centre) for part in (one, other)]
    about = sum((weight * (arm @ arm * np.eye(3) - np.outer(arm, arm)) for weight, arm in arms), np.zeros((3, 3)))
    return BodyInertia(mass, centre, one.matrix + other.matrix + about)
