"""Contacts as an engine found them at one state, as plain data, and as constraints whose numbers are inputs of the truth.

Law and solver are so judged apart from geometry.

Source: MuJoCo documentation, Computation, section Contact; API reference, ``mjContact``.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from harness.files.equalities import SOLIMP, SOLREF, Constraint, SolverParameters
from harness.files.findings import CONTACTS
from harness.files.given import Given, Place
from harness.files.left_out import Declared
from harness.files.touching import ConeKind, PointCompliance, Touch

# Attributes of shapes and pairs of these by which their contacts have another law than the harness writes.
_UNREAD = {"adhesion": "has adhesion", "surfacevel": "has a surface that moves by itself"}


@dataclass(frozen=True)
class FoundContact:
    """One contact, in the world's frame.

    Attributes:
        bodies: the first and the second. point: (3,) [m]. frame: (9,), the rows of ``Touch.frame``.
        distance, margin, friction, sliding: as of ``Touch``.
        solref, solimp: as of ``SolverParameters``. compliance: as of ``Touch``, in place of these.
        why_not: what the harness has no rows for, "" where it has.
        shapes: names of the first and the second, as of ``Shape``; "" for what is no shape.
    """

    bodies: tuple[str, str]
    point: tuple[float, ...]
    frame: tuple[float, ...]
    distance: float
    margin: float
    friction: tuple[float, ...]
    solref: tuple[float, float] = SOLREF
    solimp: tuple[float, float, float, float, float] = SOLIMP
    sliding: tuple[float, float] = (0.0, 0.0)
    why_not: str = ""
    shapes: tuple[str, str] = ("", "")
    compliance: PointCompliance | None = None

    @property
    def pushes(self) -> bool:
        """True below the margin, and not at it; of a step wherever it is found, for it may push before the end of that.

        One that there are no rows for may pull beyond the margin, as one that adheres.
        """
        return self.compliance is not None or bool(self.why_not) or self.distance < self.margin


def contacts_of(found: Sequence[FoundContact], place: Place, cone: ConeKind) -> list[Constraint]:
    """The constraints of contacts that push, whose numbers stand at ``place``."""
    return [_contact(one, number, place, cone) for number, one in enumerate(one for one in found if one.pushes)]


def structure_of(contacts: Iterable[Constraint]) -> Hashable:
    """``Touch.structure`` of all contacts, with their softness."""
    return tuple((one.name, one.softness, one.says.structure) for one in contacts if isinstance(one.says, Touch))


def measured_in(contacts: Iterable[Constraint]) -> Iterator[Given]:
    """The numbers of contacts that another state of the same structure has otherwise."""
    touches = (one.says for one in contacts if isinstance(one.says, Touch))
    return (number for touch in touches for number in touch.measured if isinstance(number, Given))


def _contact(found: FoundContact, number: int, place: Place, cone: ConeKind) -> Constraint:
    name = f"contact {number}"

    def given(values: Sequence[float], what: str) -> list[Fraction]:
        return [Given(value, place, f"{name} {what}", index) for index, value in enumerate(values)]

    x, y, z = given(found.point, "point")
    axes = given(found.frame, "frame")
    distance, margin = given([found.distance], "distance") + given([found.margin], "margin")
    first, second, third = ((axes[start], axes[start + 1], axes[start + 2]) for start in (0, 3, 6))
    friction = tuple(given(found.friction, "friction"))
    touch = Touch(found.bodies, (x, y, z), (first, second, third), distance, margin, friction, cone, found.sliding, found.compliance)
    return Constraint("contact", place, place.line, touch, found.why_not, SolverParameters(found.solref, found.solimp), name=name)


def touching_of(declared: Iterable[Declared]) -> list[Constraint]:
    """The shapes of a file that may touch, and its pairs of such."""
    return [
        Constraint(one.place.tag or CONTACTS, one.place, one.place.line, None, _why_unread(one)) for one in declared if one.what == CONTACTS
    ]


def _why_unread(one: Declared) -> str:
    felt = (why for name, why in _UNREAD.items() if any(float(part or 0) for part in one.values.get(name, "").split()))
    return next(felt, "")
