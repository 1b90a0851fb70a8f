"""What meshes weigh, as an engine compiled them: numbers that no file of a robot states, and that nothing here judges.

Who reads a robot gives a function that compiles its file; the numbers enter the tree as those of the geom, and the robot says of which.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from harness.files.document.source import Source
from harness.files.document.xml import describe
from harness.files.tree import Given, Placement, Quaternion, Solid, vector


@dataclass(frozen=True)
class CompiledMesh:
    """A geom that has the shape or the size of a mesh.

    Attributes:
        name: of the geom, "" for none.
        mass: [kg]. moments: (3,) principal moments [kg m^2] about the centre of mass.
        position, orientation: of the principal frame in the frame of the body, [m] and (w, x, y, z).
    """

    name: str
    mass: float
    moments: Sequence[float]
    position: Sequence[float]
    orientation: Sequence[float]


# Number of the body and number of the geom in it, both from 0 in the order of the file with its included files and replicas.
Number = tuple[int, int]
# Raises ValueError with the engine's words where it does not compile the file.
CompileMeshes = Callable[[Path], Mapping[Number, CompiledMesh]]


class Meshes:
    """The meshes of one file, compiled when the first is asked for."""

    def __init__(self, path: Path, compile_meshes: CompileMeshes) -> None:
        self._path, self._compile = path, compile_meshes
        self._found: Mapping[Number, CompiledMesh] | None = None

    def solid(self, source: Source, geom: etree._Element) -> Solid:
        """The solid of a geom; raises InvalidModel where the engine has none there."""
        if self._found is None:
            try:
                self._found = self._compile(self._path)
            except ValueError as error:
                source.refuse(geom, f"{describe(geom)} gives its body the inertia of a mesh, and the file does not compile: {error}")
        number, place = _number(geom), source.place(geom)
        compiled = self._found.get(number)
        if compiled is None or compiled.name != geom.get("name", ""):
            source.refuse(
                geom,
                f"{describe(geom)} gives its body the inertia of a mesh, and is not where the engine has one; write the body an <inertial>",
            )

        def given(values: Sequence[float], what: str) -> tuple[Given, ...]:
            return tuple(Given(float(value), place, f"{what} of the compiled mesh", index) for index, value in enumerate(values))

        (mass,) = given((compiled.mass,), "mass")
        pose = Placement(vector(given(compiled.position, "position")), (Quaternion(given(compiled.orientation, "orientation")),))
        return Solid("mesh", (), (pose,), mass, mass, place=place, moments=given(compiled.moments, "moments"))


def _number(geom: etree._Element) -> Number:
    body = next(geom.iterancestors("body"))
    root = next(body.iterancestors("mujoco"))
    bodies = [one for world in root.iterchildren("worldbody") for one in world.iter("body")]
    geoms = [one for one in body.iter("geom") if next(one.iterancestors("body")) is body]
    return bodies.index(body), geoms.index(geom)
