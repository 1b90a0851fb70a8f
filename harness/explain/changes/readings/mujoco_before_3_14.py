"""MuJoCo before 3.14: its reader of URDF and its search for principal axes, which ends while products of inertia are left.

A link that no joint moves is fused with its parent, from the root down in the order of the tree, and each sum is turned to axes anew.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.engines.request import BodyInertia
from harness.engines.tree_request import frame_of
from harness.explain.changes.readings import computed, law, matrix_of, moments_of, readings_of, with_bodies, with_inertias
from harness.explain.changes.readings._fused import LEAST_MASS, carried, joined
from harness.files.tree import WORLD, Body, Inertia, Tree
from harness.trees.bodies.inertias import whole
from harness.trees.robot import Robot

# Of kEigEPS: the least product of inertia [kg m^2] that is turned away, and by how much less than 1 the cosine of a turn must be.
_LEAST_PRODUCT = _LEAST_TURN = 1e-12
# Of a symmetric matrix; of two that are equal the later is turned away.
_PRODUCTS = ((0, 1), (0, 2), (1, 2))
# Of the largest moment, what rounding leaves.
_ROUNDED = 2.0**-48


@law("rotation of an inertial origin", "links", supplied=True, each=with_bodies)
def _without_turned_inertials(body: Body) -> Body:
    inertia = body.inertia
    if inertia is None or not any(placement.rotation for placement in inertia.pose):
        return body
    return replace(body, inertia=replace(inertia, pose=tuple(replace(placement, rotation=()) for placement in inertia.pose)))


@law("digits of a full inertia", "bodies", each=with_bodies)
def _with_dropped_products(body: Body) -> Body:
    """A body with what is left of its inertia along the axes that the compiler takes for the principal ones."""
    inertia = whole(body)
    if inertia is None or not any(inertia.moments[3:]):
        return body
    matrix = matrix_of(inertia)
    changed = _with_moments(body, inertia, matrix, _along_found_axes(matrix))
    return body if changed is inertia else replace(body, inertia=changed, solids=())


def _with_moments(body: Body, inertia: Inertia, before: Array, now: Array) -> Inertia:
    """An inertia with other moments; itself where these differ by rounding."""
    if np.abs(now - before).max() <= _ROUNDED * np.abs(before).max():
        return inertia
    moments = tuple(computed(value, body, "moments", index) for index, value in enumerate(moments_of(now)))
    return replace(inertia, moments=moments)


@law("digits of a full inertia", "links", supplied=True, after=("rotation of an inertial origin", "mass of collision geometry"))
def _with_dropped_products_of_links(robot: Robot) -> Tree:
    """Products that are dropped of a link, and of each sum of fused links, are taken from the link that carries the others."""
    dropped = _dropped(robot.tree)

    def read(body: Body) -> Inertia | None:
        if body.inertia is None or body.name not in dropped:
            return body.inertia
        turn, matrix = frame_of(body.inertia.pose)[0], matrix_of(body.inertia)
        return _with_moments(body, body.inertia, matrix, matrix - turn.T @ dropped[body.name] @ turn)

    return with_inertias(robot.tree, read)


def _dropped(tree: Tree) -> dict[str, Array]:
    """The dropped part of the inertia of each moving link, with those fused with it, (3, 3) along the axes of the link [kg m^2]."""
    exact: dict[str, BodyInertia] = {}
    kept: dict[str, BodyInertia] = {}
    for carrier, body, turn, origin in carried(tree):
        inertia = whole(body)
        if carrier == WORLD or inertia is None or (not body.joints and float(inertia.mass) < LEAST_MASS):
            continue
        axes, centre = frame_of(inertia.pose)
        matrix = axes @ matrix_of(inertia) @ axes.T
        for found, of in ((exact, matrix), (kept, _along_found_axes(matrix))):
            one = BodyInertia(float(inertia.mass), origin + turn @ centre, turn @ of @ turn.T)
            found[carrier] = one if carrier not in found else joined(found[carrier], one)
        if not body.joints:
            kept[carrier] = replace(kept[carrier], matrix=_along_found_axes(kept[carrier].matrix))
    return {name: exact[name].matrix - kept[name].matrix for name in exact}


def _along_found_axes(matrix: Array) -> Array:
    """A symmetric matrix (3, 3) without the products that Jacobi's rotations leave when the compiler ends them.

    A turn is that of the compiler's quaternion, whose half sine is of the rounded cosine: one of 1e-6 rad has ten digits.
    """
    axes = np.eye(3)
    while True:
        turned = axes.T @ matrix @ axes
        row, column = max(_PRODUCTS, key=lambda place: (abs(turned[place]), place))
        if abs(turned[row, column]) < _LEAST_PRODUCT:
            break
        ratio = float((turned[column, column] - turned[row, row]) / (2 * turned[row, column]))
        tangent = math.copysign(1 / (abs(ratio) + math.sqrt(1 + ratio * ratio)), ratio)
        cosine = 1 / math.sqrt(1 + tangent * tangent)
        if cosine > 1 - _LEAST_TURN:
            break
        half = 0.5 - 0.5 * cosine
        sine = math.copysign(2 * math.sqrt(half * (1 - half)), ratio)
        rotation = np.eye(3)
        rotation[[row, column], [row, column]] = 1 - 2 * half
        rotation[row, column], rotation[column, row] = sine, -sine
        axes = axes @ rotation
    return np.asarray((axes * np.diag(turned)) @ axes.T)


_LOST = (
    "MuJoCo before 3.14 drops products of inertia below 1e-12 kg m^2, or that a rotation below 1.4e-6 rad would remove, when it computes "
    "principal axes",
    "upgrade to MuJoCo 3.14 or later, or give principal moments",
    "MuJoCo 3.13, user/user_util.cc, mjuu_eig3: it ends where a product or a turn is below kEigEPS; user_objects.cc, AccumulateInertia",
)
READINGS = readings_of(
    "mujoco",
    {
        ("mjcf",): {_with_dropped_products: _LOST},
        ("urdf",): {
            _with_dropped_products_of_links: _LOST,
            _without_turned_inertials: (
                "MuJoCo before 3.14 ignores the rpy of a link's <inertial><origin>",
                "upgrade to MuJoCo 3.14 or later, or write the inertia along the link's axes, without an rpy",
                "MuJoCo 3.13, xml/xml_urdf.cc: the orientation of the origin is overwritten by that of the principal axes",
            ),
        },
    },
    "<3.14",
    is_misread=True,
)
