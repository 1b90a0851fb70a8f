"""The masses of a stage's bodies: as ``PhysicsMassAPI`` states them, or those of shapes of even density.

A mass of 0, an inertia of 0 and a centre at minus infinity say that there is none; they then follow from the colliders below the body. A
mass or density at a collider is stronger than that of its body, whose density is stronger than that of the collider's material. Where a
body states its mass and no inertia, its colliders share the mass as their volumes do, or as their own masses do.

The inertia of a collider is exact for spheres, cubes, cylinders and capsules. That of a mesh is an engine's own, and is refused.

Source: OpenUSD documentation, UsdPhysicsMassAPI; newton-usd-schemas, NewtonMassAPI, whose inertia overrides the principal one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from harness.files.document.stage import Prim, UsdDocument
from harness.files.given import ORIGIN, Given, Placement, Pose, Turn
from harness.files.tree import Body, Inertia, Solid
from harness.files.usd.frames import UNITS, Frames, times, turned

MASS, DENSITY, CENTRE = "physics:mass", "physics:density", "physics:centerOfMass"
INERTIA, AXES, FULL = "physics:diagonalInertia", "physics:principalAxes", "newton:inertia"
# [kg/m^3], of what states neither mass nor density.
_OF_WATER = 1000.0
COLLIDER, BODY, _MATERIAL = "PhysicsCollisionAPI", "PhysicsRigidBodyAPI", "material:binding"
# The diameter, edge or radius that UsdGeom gives a shape that states none.
_SIZES = {"Sphere": ("radius",), "Cube": ("size",), "Cylinder": ("radius", "height"), "Capsule": ("radius", "height")}
_DEFAULTS = {"Sphere": (1.0,), "Cube": (2.0,), "Cylinder": (1.0, 2.0), "Capsule": (0.5, 1.0)}
_WEIGHTLESS = ("Plane",)
# From the z axis, along which a solid lies.
_TURNS = {"X": (Turn(UNITS["Y"], Fraction(90), True),), "Y": (Turn(UNITS["X"], Fraction(-90), True),), "Z": ()}


class Masses:
    """Reads the masses of bodies."""

    def __init__(self, document: UsdDocument, frames: Frames) -> None:
        self._frames, self._units = frames, frames.units
        self._prims = {prim.path: prim for prim in document.prims}
        self._below: dict[str, list[Prim]] = {}
        for prim in document.prims:
            self._below.setdefault(prim.parent, []).append(prim)

    def of_body(self, prim: Prim, body: Body, moves: bool) -> Body:
        """The body with its inertia; one that nothing moves needs none that its file does not state.

        Raises:
            InvalidModel: a number has no meaning, or the inertia is that of a shape whose inertia no file states.
        """
        mass = self._positive(prim, MASS)
        moments, axes = self._moments(prim)
        if mass is not None and (moments or not list(self.colliders(prim.path))):
            return replace(body, inertia=self._explicit(prim, times(mass, self._units.kilogram), moments, axes))
        if not moves:
            return body
        solids = tuple(self._solids(prim))
        if moments or prim.finite(CENTRE):
            prim.refuse("states a centre or an inertia and not all of mass, centre and inertia; write all three", MASS)
        if mass is not None:
            solids = _sharing(solids, times(mass, self._units.kilogram), prim)
        return replace(body, solids=solids)

    def _explicit(self, prim: Prim, mass: Given, moments: Sequence[Given], axes: Pose) -> Inertia:
        centre = prim.finite(CENTRE)
        if not centre and list(self.colliders(prim.path)):
            prim.refuse(f"states its mass and inertia and no {CENTRE}, which engines take from its colliders; write it", MASS)
        unit = self._units.kilogram * self._units.metre**2
        own = tuple(times(moment, unit) for moment in moments) or (Fraction(0),) * 6
        at = Placement(self._units.lengths(centre) if centre else ORIGIN, axes[0].rotation if axes else ())
        return Inertia((at,), mass, (*own, *ORIGIN) if len(own) == 3 else own, prim.at(MASS))

    def _moments(self, prim: Prim) -> tuple[Sequence[Given], Pose]:
        """Three moments with their frame, or six in the axes of the body; none where the body states none."""
        full, principal = prim.finite(FULL), prim.finite(INERTIA)
        if full and len(full) != 6:
            prim.refuse(f"{FULL} holds {len(full)} numbers; expected 6: xx, yy, zz, xy, xz, yz", FULL)
        if full or not any(principal):
            return full, ()
        # A quaternion of zeros says that the axes are those of the body.
        is_turned = any(prim.finite(AXES)[1:])
        return principal, (Placement(rotation=(turned(prim, AXES),)),) if is_turned else ()

    def _positive(self, prim: Prim, name: str) -> Given | None:
        number = prim.number(name)
        if (name in prim.values and number is None) or (number is not None and number < 0):
            found = prim.values[name].numbers
            prim.refuse(f"{name} is {found[0] if found else 'empty'}; expected a finite number above zero, or 0 for none", name)
        return number or None

    # Shapes.

    def colliders(self, path: str) -> Iterator[Prim]:
        """The colliders at a body and below it, but for those of further bodies."""
        waiting = [self._prims[path]]
        while waiting:
            prim = waiting.pop()
            if COLLIDER in prim.schemas and prim.is_on("physics:collisionEnabled"):
                yield prim
            waiting += [child for child in reversed(self._below.get(prim.path, [])) if BODY not in child.schemas]

    def _solids(self, body: Prim) -> Iterator[Solid]:
        for prim in self.colliders(body.path):
            if prim.kind in _WEIGHTLESS:
                continue
            mass = self._positive(prim, MASS)
            if prim.kind not in _SIZES:
                what = f"is a {prim.kind or 'prim'} that gives body <{body.path}> the inertia of an engine's making, which no file states"
                prim.refuse(f"{what}; write the body {MASS}, {CENTRE}, {INERTIA} and {AXES}")
            if self._moments(prim)[0] or prim.finite(CENTRE):
                prim.refuse("is a collider with a centre or an inertia of its own, which is not read; write those of its body")
            yield self._solid(body, prim, None if mass is None else times(mass, self._units.kilogram))

    def _solid(self, body: Prim, prim: Prim, mass: Given | None) -> Solid:
        units, place = self._units, prim.place
        written = [
            prim.number(name) or Given(default, place, name) for name, default in zip(_SIZES[prim.kind], _DEFAULTS[prim.kind], strict=True)
        ]
        scale = [float(number) for number in prim.finite("xformOp:scale")] or [1.0] * 3
        sizes = [times(number, units.metre) for number in written]
        if prim.kind == "Cube":
            # Three numbers of one, which are three parameters.
            half = 0.5 * float(sizes[0])
            kind, size = "box", tuple(Given(half * factor, sizes[0].place, "size", at) for at, factor in enumerate(scale))
        else:
            if len(set(scale)) > 1:
                prim.refuse("is a round shape with a scale of its own along each axis, whose inertia is not read; write that of its body")
            kind = prim.kind.lower()
            size = tuple(
                times(number, scale[0] * (1.0 if name == "radius" else 0.5)) for number, name in zip(sizes, _SIZES[prim.kind], strict=True)
            )
        if min(size) <= 0:
            prim.refuse("has a size that is not positive; expected more than zero")
        along = _TURNS.get(prim.word("axis", "Z"), ()) if prim.kind in ("Cylinder", "Capsule") else ()
        pose = (*self._frames.between(body.path, prim.path, any_scale=True), *((Placement(rotation=along),) if along else ()))
        return Solid(kind, size, pose, mass, self._density(body, prim), place=place)

    def _density(self, body: Prim, prim: Prim) -> Fraction:
        """Density [kg/m^3] of a collider."""
        material = self._prims.get(next(iter(prim.words(f"{_MATERIAL}:physics") or prim.words(_MATERIAL)), ""))
        for one in (prim, body, material):
            number = None if one is None else self._positive(one, DENSITY)
            if number is not None:
                return times(number, self._units.kilogram / self._units.metre**3)
        return Given(_OF_WATER, prim.place, DENSITY)


def _sharing(solids: Sequence[Solid], mass: Given, body: Prim) -> tuple[Solid, ...]:
    """Solids whose masses sum to a mass."""
    shares = [float(solid.density if solid.mass is None else 0) * _volume(solid) + float(solid.mass or 0) for solid in solids]
    if not sum(shares):
        body.refuse("states its mass, and its colliders weigh nothing; write its inertia", MASS)
    parts = ((solid, solid.place or body.place, share / sum(shares)) for solid, share in zip(solids, shares, strict=True))
    return tuple(replace(solid, mass=Given(float(mass) * part, place, MASS)) for solid, place, part in parts)


def _volume(solid: Solid) -> float:
    radius, *rest = map(float, solid.size)
    if solid.kind == "box":
        return 8 * radius * rest[0] * rest[1]
    ball = 4 / 3 * math.pi * radius**3
    return {"sphere": ball, "capsule": ball}.get(solid.kind, 0.0) + (2 * math.pi * radius**2 * rest[0] if rest else 0.0)


def gravity_share(prim: Prim) -> Fraction:
    """Share of its weight that a body does not feel."""
    if (share := prim.number("mjc:body:gravcomp")) is not None and share:
        return share
    if prim.is_on("physxRigidBody:disableGravity", False):
        return Given(1.0, prim.at("physxRigidBody:disableGravity"), "physxRigidBody:disableGravity")
    return Fraction(0)


def gravity_of(scenes: Sequence[Prim], document: UsdDocument, frames: Frames) -> tuple[Fraction, Fraction, Fraction]:
    """Gravity [m/s^2] of the scene of a stage: that of the earth, down, where it does not say; zero where it is switched off.

    Raises:
        InvalidModel: a second scene has another one.
    """
    found = [_gravity(scene, document, frames) for scene in scenes] or [_down(document, None, None)]
    for scene, other in zip(scenes[1:], found[1:], strict=True):
        if tuple(map(float, other)) != tuple(map(float, found[0])):
            scene.refuse(
                f"is a second scene with another gravity than <{scenes[0].path}>; leave one of them out", "physics:gravityMagnitude"
            )
    return found[0]


_EARTH = 9.81
_SWITCHES = ("newton:gravityEnabled", "mjc:flag:gravity")


def _gravity(scene: Prim, document: UsdDocument, frames: Frames) -> tuple[Fraction, Fraction, Fraction]:
    if off := [name for name in _SWITCHES if not scene.is_on(name)]:
        zero = Given(0.0, scene.at(off[0]), off[0])
        return zero, zero, zero
    number = scene.number("physics:gravityMagnitude")
    magnitude = times(number, frames.units.metre) if number is not None and number >= 0 else None
    direction = [float(component) for component in scene.finite("physics:gravityDirection")]
    if not any(direction):
        return _down(document, magnitude, scene)
    size = math.hypot(*direction)
    # That is a unit vector where one component alone is not zero.
    return _along([component / size for component in direction], magnitude, scene, document)


def _down(document: UsdDocument, magnitude: Given | None, scene: Prim | None) -> tuple[Fraction, Fraction, Fraction]:
    value = document.layer.get("upAxis")
    up = value.words[0] if value is not None and value.words else "Y"
    return _along([-float(component) for component in UNITS.get(up, UNITS["Y"])], magnitude, scene, document)


def _along(
    direction: Sequence[float], magnitude: Given | None, scene: Prim | None, document: UsdDocument
) -> tuple[Fraction, Fraction, Fraction]:
    name = "physics:gravityMagnitude"
    place = document.prims[0].place if scene is None else scene.at(name)
    size = _EARTH if magnitude is None else float(magnitude)
    x, y, z = (Given(size * part, place, name, at) for at, part in enumerate(direction))
    return x, y, z
