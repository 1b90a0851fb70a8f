"""Random robots in USD: trees that hang on the world or float, with joints of every kind and several of one body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_BODY = '(apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"{}])'
_KINDS = {"hinge": "Revolute", "slide": "Prismatic", "ball": "Spherical"}
_CHOSEN = ("hinge", "hinge", "slide", "ball", "slide and hinge")
# So that no body is hardly felt in float32.
_LEAST = 0.2


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return ", ".join(f"{value:.6g}" for value in values)


def random_stage(seed: int, kinds: Sequence[str] = _CHOSEN) -> str:
    """The text of a stage of one to five bodies, of which the first floats for every third seed."""
    random = np.random.default_rng(seed)
    found = ['#usda 1.0\n( metersPerUnit = 1; upAxis = "Z" )']
    gravity = random.normal(size=3)
    found.append(f'def PhysicsScene "scene" {{ vector3f physics:gravityDirection = ({_numbers(gravity / np.linalg.norm(gravity))});')
    found.append(f"float physics:gravityMagnitude = {random.uniform(1, 20):.6g}; }}")
    for number in range(random.integers(1, 6)):
        floats = number == 0 and seed % 3 == 0
        root = ', "PhysicsArticulationRootAPI"' if floats else ""
        side = random.uniform(_LEAST, 1, size=3)
        found.append(f'def Xform "body_{number}" {_BODY.format(root)} {{ float physics:mass = {random.uniform(_LEAST, 5):.6g};')
        found.append(f"point3f physics:centerOfMass = ({_numbers(random.uniform(-0.5, 0.5, size=3))});")
        found.append(f"float3 physics:diagonalInertia = ({_numbers(side[[1, 0, 0]] + side[[2, 2, 1]])});")
        found.append(f"quatf physics:principalAxes = ({_numbers(_quaternion(random))}); }}")
        if not floats:
            first = f"rel physics:body0 = </body_{random.integers(number)}>;" if number else ""
            found += _joints(random, number, first, kinds[random.integers(len(kinds))])
    return "\n".join(found) + "\n"


def _joints(random: np.random.Generator, number: int, first: str, kind: str) -> list[str]:
    several, at = kind.split(" and "), _numbers(random.uniform(-1, 1, size=3))
    frames = [f"point3f physics:localPos0 = ({at});"]
    if len(several) == 1:
        frames += [f"quatf physics:localRot{side} = ({_numbers(_quaternion(random))});" for side in (0, 1)]
        frames.append(f"point3f physics:localPos1 = ({_numbers(random.uniform(-1, 1, size=3))});")
    found = []
    for one in several:
        axis = "XYZ"[random.integers(3)]
        own = f'{first} rel physics:body1 = </body_{number}>; uniform token physics:axis = "{axis}"; {" ".join(frames)}'
        if one != "ball":
            own += f" float newton:armature = {random.uniform(0, 0.3):.3g}; float newton:damping = {random.uniform(0, 0.01):.3g};"
        found.append(f'def Physics{_KINDS[one]}Joint "{one}_{number}" (apiSchemas = ["MjcJointAPI"]) {{ {own} }}')
    return found


def _quaternion(random: np.random.Generator) -> np.ndarray:
    found = random.normal(size=4)
    return np.asarray(found / np.linalg.norm(found))
