"""Random robots in USD: trees that hang on the world or float, with joints of every kind and several of one body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

# Position, and quaternion (w, x, y, z).
Frame = tuple[np.ndarray, np.ndarray]
_NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])
_KINDS = {"hinge": "Revolute", "slide": "Prismatic", "ball": "Spherical"}
_CHOSEN = ("hinge", "hinge", "slide", "ball", "slide and hinge")
# So that no body is hardly felt in float32.
_LEAST = 0.2


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return ", ".join(f"{value:.6g}" for value in values)


def random_stage(seed: int, kinds: Sequence[str] = _CHOSEN) -> str:
    """The text of a stage of one to five bodies, of which the first floats for every third seed, or stands where its joint puts it."""
    random = np.random.default_rng(seed)
    found = ['#usda 1.0\n( metersPerUnit = 1; upAxis = "Z" )']
    gravity = random.normal(size=3)
    found.append(f'def PhysicsScene "scene" {{ vector3f physics:gravityDirection = ({_numbers(gravity / np.linalg.norm(gravity))});')
    found.append(f"float physics:gravityMagnitude = {random.uniform(1, 20):.6g}; }}")
    for number in range(random.integers(1, 6)):
        floats = number == 0 and seed % 3 == 0
        several = [] if floats else kinds[random.integers(len(kinds))].split(" and ")
        frames = _frames(random) if len(several) < 2 else [(random.uniform(-1, 1, size=3), _NO_TURN), (np.zeros(3), _NO_TURN)]
        found.append(_body(random, number, floats, None if floats or number else frames))
        first = f"rel physics:body0 = </body_{random.integers(number)}>;" if number else ""
        found += [_joint(random, number, first, one, frames) for one in several]
    return "\n".join(found) + "\n"


def _body(random: np.random.Generator, number: int, floats: bool, standing: Sequence[Frame] | None) -> str:
    root, place, side = ', "PhysicsArticulationRootAPI"' if floats else "", "", random.uniform(_LEAST, 1, size=3)
    if standing is not None:
        (near, turn), (far, other) = standing
        turned = Rotation.from_quat(turn, scalar_first=True) * Rotation.from_quat(other, scalar_first=True).inv()
        place = f"double3 xformOp:translate = ({_numbers(near - turned.apply(far))}); "
        place += f"quatd xformOp:orient = ({_numbers(turned.as_quat(scalar_first=True))});"
        place += ' uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"];'
    return f"""def Xform "body_{number}" (apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"{root}]) {{
    {place}
    float physics:mass = {random.uniform(_LEAST, 5):.6g}; point3f physics:centerOfMass = ({_numbers(random.uniform(-0.5, 0.5, size=3))});
    float3 physics:diagonalInertia = ({_numbers(side[[1, 0, 0]] + side[[2, 2, 1]])});
    quatf physics:principalAxes = ({_numbers(_quaternion(random))});
}}"""


def _joint(random: np.random.Generator, number: int, first: str, kind: str, frames: Sequence[Frame]) -> str:
    placed = "".join(
        f"point3f physics:localPos{side} = ({_numbers(at)}); quatf physics:localRot{side} = ({_numbers(turn)}); "
        for side, (at, turn) in enumerate(frames)
    )
    own = f'{first} rel physics:body1 = </body_{number}>; uniform token physics:axis = "{"XYZ"[random.integers(3)]}"; {placed}'
    if kind != "ball":
        own += f"float newton:armature = {random.uniform(0, 0.3):.3g}; float newton:damping = {random.uniform(0, 0.01):.3g};"
    return f'def Physics{_KINDS[kind]}Joint "{kind}_{number}" (apiSchemas = ["MjcJointAPI"]) {{ {own} }}'


def _frames(random: np.random.Generator) -> list[Frame]:
    """Of a joint in its first and in its second body."""
    return [(random.uniform(-1, 1, size=3), _quaternion(random)) for _ in range(2)]


def _quaternion(random: np.random.Generator) -> np.ndarray:
    found = random.normal(size=4)
    return np.asarray(found / np.linalg.norm(found))
