"""The masses of MJCF bodies: from ``<inertial>`` or from geoms, and what the ``compiler`` element changes about them.

What meshes weigh is no number of a file, and nothing here judges it: who reads a robot gives a function by which an engine compiles its
file. The numbers enter the tree as those of the geom, and the robot says of which.

Source: MuJoCo documentation, XML reference, ``compiler``, ``body/inertial`` and ``body/geom``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from lxml import etree

from harness.files.document.source import Source, not_negative, positive
from harness.files.document.xml import describe
from harness.files.given import ORIGIN, Direction, Given, Placement, Quaternion, vector
from harness.files.mjcf.attributes import JOINTS, Attributes, inside, resolved, resolved_text
from harness.files.tree import Body, Bounds, Inertia, Solid

# Sizes that each takes, and those that it takes beside two points.
_SIZES = {"sphere": (1, 0), "capsule": (2, 1), "cylinder": (2, 1), "ellipsoid": (3, 1), "box": (3, 1)}
_WEIGHTLESS = ("plane", "hfield")
_OF_WATER = 1000.0


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


def _number_of(geom: etree._Element) -> Number:
    body = next(geom.iterancestors("body"))
    root = next(body.iterancestors("mujoco"))
    bodies = [one for world in root.iterchildren("worldbody") for one in world.iter("body")]
    geoms = [one for one in body.iter("geom") if next(one.iterancestors("body")) is body]
    return bodies.index(body), geoms.index(geom)


class Inertias:
    """Reads them by what the ``compiler`` elements say; meshes are compiled when the first is asked for."""

    def __init__(self, source: Source, attributes: Attributes, compile_meshes: CompileMeshes | None) -> None:
        self._source, self._attributes, self._compile_meshes = source, attributes, compile_meshes
        self._meshes: Mapping[Number, CompiledMesh] | None = None
        self._from_geoms = attributes.compiler("inertiafromgeom", "auto", ("auto", "true", "false"))
        (least_mass,), (least_moment,), (total,) = (
            attributes.compiler_numbers(name, (Fraction(0),)) for name in ("boundmass", "boundinertia", "settotalmass")
        )
        balances = attributes.compiler("balanceinertia", "false", ("true", "false")) == "true"
        self.bounds = Bounds(least_mass, least_moment, balances) if least_mass > 0 or least_moment > 0 or balances else None
        # What all bodies are to weigh; None where the file does not say.
        self.total_mass = total if total > 0 else None
        self._groups = tuple(map(int, attributes.compiler_numbers("inertiagrouprange", (Fraction(0), Fraction(5)))))

    def of_body(self, element: etree._Element, body: Body) -> Body:
        """The body with its masses."""
        inertial = element.find("inertial")
        if inertial is not None and self._from_geoms != "true":
            return replace(body, inertia=self._explicit(inertial))
        if self._from_geoms == "false":
            return body
        geoms = list(inside(element, "geom"))
        if self.total_mass is None and not _moves(element):
            # No file needs to state the inertia of what stands still.
            geoms = [geom for geom in geoms if not self._is_mesh(geom)]
        return replace(body, solids=tuple(solid for geom in geoms for solid in self._solid(geom)))

    def _explicit(self, element: etree._Element) -> Inertia:
        source, place = self._source, self._source.place(element)
        mass, pose = source.number(element, "mass", None), self._attributes.pose(element)
        if "fullinertia" not in element.attrib:
            return Inertia(pose, mass, (*source.numbers(element, "diaginertia", (0, 0, 0)), *ORIGIN), place)
        if "diaginertia" in element.attrib:
            source.refuse(
                element, f"<inertial> of {describe(element.getparent())} has both diaginertia and fullinertia; expected one of them"
            )
        if pose[-1].rotation:
            source.refuse(element, f"{describe(element)} has fullinertia and an orientation; expected one of them")
        return Inertia(pose, mass, source.numbers(element, "fullinertia", None, count=6), place)

    def _solid(self, geom: etree._Element) -> Iterator[Solid]:
        """The solid that a geom adds to its body, or nothing."""
        source, attributes = self._source, self._attributes
        group = attributes.number(geom, "group", 0.0)
        if not self._groups[0] <= group <= self._groups[1]:
            return
        mass = attributes.number(geom, "mass", 0.0, not_negative) if resolved(geom, "mass") is not None else None
        density = attributes.number(geom, "density", _OF_WATER, not_negative)
        kind = "mesh" if self._is_mesh(geom) else resolved_text(geom, "type", "sphere")
        is_massless = not (density if mass is None else mass)
        # A massless solid adds nothing, and stays for those that read its mass otherwise.
        if kind in _WEIGHTLESS or (is_massless and kind not in _SIZES and kind != "mesh"):
            return
        if kind == "mesh" and is_massless:
            nothing = Fraction(0)
            yield Solid(kind, (), attributes.pose(geom), nothing, nothing, place=source.place(geom), moments=ORIGIN)
            return
        if kind == "mesh" and self._compile_meshes is not None:
            yield self._mesh(geom, self._compile_meshes)
            return
        if kind not in _SIZES:
            source.refuse(
                geom,
                f"{describe(geom)} gives its body the inertia of a {kind} of MuJoCo's making, which no file states; "
                'write the body an <inertial>, or the geom mass="0"',
            )
        shell = resolved_text(geom, "shellinertia", "false") == "true"
        if shell and kind == "ellipsoid" and not is_massless:
            source.refuse(
                geom, f"{describe(geom)} is the shell of an ellipsoid, whose area has no closed form; write the body an <inertial>"
            )
        yield self._with_sizes(geom, Solid(kind, (), attributes.pose(geom), mass, density, shell, None, source.place(geom)))

    def _mesh(self, geom: etree._Element, compile_meshes: CompileMeshes) -> Solid:
        """The solid of a geom; raises InvalidModel where the engine has none there."""
        source, place = self._source, self._source.place(geom)
        if self._meshes is None:
            try:
                self._meshes = compile_meshes(source.document.path)
            except ValueError as error:
                source.refuse(geom, f"{describe(geom)} gives its body the inertia of a mesh, and the file does not compile: {error}")
        compiled = self._meshes.get(_number_of(geom))
        if compiled is None or compiled.name != geom.get("name", ""):
            problem = "gives its body the inertia of a mesh, and is not where the engine has one; write the body an <inertial>"
            source.refuse(geom, f"{describe(geom)} {problem}")

        def given(values: Sequence[float], what: str) -> tuple[Given, ...]:
            return tuple(Given(float(value), place, f"{what} of the compiled mesh", index) for index, value in enumerate(values))

        (mass,) = given((compiled.mass,), "mass")
        pose = Placement(vector(given(compiled.position, "position")), (Quaternion(given(compiled.orientation, "orientation")),))
        return Solid("mesh", (), (pose,), mass, mass, place=place, moments=given(compiled.moments, "moments"))

    def _is_mesh(self, geom: etree._Element) -> bool:
        """True where a geom has the shape, or the size, of a mesh."""
        return resolved(geom, "mesh") is not None or resolved_text(geom, "type") in ("mesh", "sdf")

    def _with_sizes(self, geom: etree._Element, solid: Solid) -> Solid:
        attributes, place = self._attributes, self._source.place(geom)
        points = attributes.numbers(geom, "fromto", (0,) * 6) if resolved(geom, "fromto") is not None else ()
        count = _SIZES[solid.kind][bool(points)]
        if not count:
            self._source.refuse(geom, f"{describe(geom)} is a {solid.kind} with fromto; expected a capsule, cylinder, ellipsoid or box")
        sizes = attributes.numbers(geom, "size", (0, 0, 0))[:count]
        complaint = positive(tuple(map(float, sizes)))
        if complaint:
            found = " ".join(str(float(size)) for size in sizes)
            self._source.refuse(geom, f"{describe(geom)} is a {solid.kind} of size {found}, of which one {complaint}; it takes {count}")
        if not points:
            return replace(solid, size=sizes)
        first, second = vector(points[:3]), vector(points[3:])
        if first == second:
            line = "" if points[0].place == place else f" of line {points[0].place.line}"
            self._source.refuse(geom, f"{describe(geom)} reaches from a point to itself by the fromto{line}; expected two points")
        between = Placement(first, (Direction(second, first),), second)
        return replace(solid, size=sizes, pose=(*solid.pose[:-1], between), ends=(first, second))


def _moves(body: etree._Element) -> bool:
    """True where a joint moves a body."""
    return any(next(inside(one, *JOINTS), None) is not None for one in (body, *body.iterancestors("body")))
