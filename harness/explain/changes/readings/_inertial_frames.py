"""Inertial frames that are nearly those of their bodies, which MuJoCo's compiler takes for these.

It turns a full inertia to principal axes, the largest moment first, and so each of a URDF. Files that CAD programs write have centres of
mass at 1e-8 m and products of inertia of 1e-12 of the moments, which are nearly none.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.engines.request import BodyInertia
from harness.engines.tree_request import frame_of as tree_frame
from harness.explain.changes.readings import computed, element_at, law, matrix_of, moments_of, with_bodies
from harness.explain.changes.readings._fused import LEAST_MASS, carried, joined
from harness.explain.changes.shape_rules import ALIKE, frame_of
from harness.files.given import Given, Placement, Pose, vector
from harness.files.tree import WORLD, Body, Inertia, Solid, Tree
from harness.trees.bodies.inertias import whole
from harness.trees.robot import Robot

NAME = "inertial frames near those of bodies"
_UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])
# Of sums of links in float64: what rounding leaves of a turn, of a centre [m], and of a moment.
_ROUNDED = 2.0**-46


@law(NAME, "bodies", after=("centre of a massless body",), each=with_bodies)
def near_those_of_bodies(body: Body) -> Body:
    """The body whose mass is where its own frame is, or is turned as that, where both are nearly so.

    Of several shapes the compiler makes a frame of its own.
    """
    parts: list[Inertia | Solid] = [*filter(None, [body.inertia]), *(solid for solid in body.solids if not solid.is_massless)]
    if len(parts) != 1 or (isinstance(parts[0], Solid) and parts[0].ends):
        return body
    if isinstance(parts[0], Inertia) and isinstance(parts[0].moments[3], Given):
        return _of_its_own(body)
    position, turn = frame_of(parts[0].pose)
    apart = np.abs(np.abs(turn) - _UNTURNED).max()
    if apart >= ALIKE:
        return body
    if np.abs(position).max() < ALIKE:
        pose: Pose = ()
    elif len(parts[0].pose) == 1:
        pose = (replace(parts[0].pose[0], rotation=()),)
    else:
        return body
    if not apart and (pose or not position.any()):
        return body
    own = replace(parts[0], pose=pose)
    return replace(body, inertia=own, solids=()) if isinstance(own, Inertia) else replace(body, solids=(own,))


@law(NAME, "links", supplied=True, after=("least masses and inertias", "mass of collision geometry"))
def near_those_of_links(robot: Robot) -> Tree:
    """The tree whose moving links hold what MuJoCo fuses with them, where it takes the frame of the sum for theirs."""
    root = element_at(robot.tree.place)
    if root is not None and root.find("mujoco/compiler[@fusestatic='false']") is not None:
        return with_bodies(robot.tree, _of_its_own)
    parts: dict[str, list[tuple[str, BodyInertia]]] = {}
    for carrier, body, turn, origin in carried(robot.tree):
        inertia = whole(body)
        if carrier != WORLD and inertia is not None and (body.joints or float(inertia.mass) >= LEAST_MASS):
            axes, centre = tree_frame(inertia.pose)
            own = turn @ axes
            one = BodyInertia(float(inertia.mass), origin + turn @ centre, own @ matrix_of(inertia) @ own.T)
            parts.setdefault(carrier, []).append((body.name, one))
    sums = {carrier: functools.reduce(joined, [one for _, one in own]) for carrier, own in parts.items() if len(own) > 1}
    read = {carrier: found for carrier, total in sums.items() if (found := _taken(total)) is not None}
    gone = {name for carrier in read for name, _ in parts[carrier]}

    def change(body: Body) -> Body:
        if body.name in read:
            return _with(body, read[body.name])
        if body.name in gone:
            return replace(body, inertia=None, solids=())
        return body if body.name in sums or not body.joints else _of_its_own(body)

    return with_bodies(robot.tree, change)


def _of_its_own(body: Body) -> Body:
    """The body with its full inertia alone as MuJoCo has it."""
    if body.inertia is None or body.solids:
        return body
    turn, centre = tree_frame(body.inertia.pose)
    read = _taken(BodyInertia(float(body.inertia.mass), centre, turn @ matrix_of(body.inertia) @ turn.T))
    return body if read is None else _with(body, read)


def _with(body: Body, read: BodyInertia) -> Body:
    numbers = {"mass": [read.mass], "centre": read.centre.tolist(), "moments": moments_of(read.matrix)}
    found = {what: tuple(computed(value, body, what, place) for place, value in enumerate(values)) for what, values in numbers.items()}
    place = body.place if body.inertia is None else body.inertia.place
    return replace(body, inertia=Inertia((Placement(vector(found["centre"])),), found["mass"][0], found["moments"], place), solids=())


def _taken(own: BodyInertia) -> BodyInertia | None:
    """The inertia that is made of one along the axes of its body; None where that is the same but for rounding."""
    moments, axes = _principal(own.matrix)
    if np.abs(axes - axes.T).max() / 4 >= ALIKE or np.trace(axes) < 2:
        return None
    centre = own.centre if np.abs(own.centre).max() >= ALIKE else np.zeros(3)
    read = BodyInertia(own.mass, centre, np.diag(moments))
    moved = np.abs(read.centre - own.centre).max()
    turned = np.abs(read.matrix - own.matrix).max()
    return None if moved <= _ROUNDED and turned <= _ROUNDED * np.abs(moments).max() else read


def _principal(matrix: Array) -> tuple[Array, Array]:
    """Principal moments, the largest first, and their axes in columns, of which each points along that of the matrix."""
    own = np.diag(matrix)
    rounding = _ROUNDED * np.abs(own).max()
    if np.abs(matrix - np.diag(own)).max() <= rounding:
        # Moments that rounding sets apart are equal, and stay in their order.
        order = np.argsort(-np.round(own / rounding) if rounding else own, kind="stable")
        return own[order], np.eye(3)[:, order]
    moments, axes = np.linalg.eigh(matrix)
    axes = axes[:, ::-1]
    return moments[::-1], axes * np.where(np.diag(axes) < 0, -1.0, 1.0)
