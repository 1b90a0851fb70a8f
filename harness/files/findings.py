"""Contents of a robot's file besides its equations of motion, as plain data."""

from __future__ import annotations

from dataclasses import dataclass

# Elements that engines are asked with besides, by ``LeftOut.what``.
EQUALITIES, ACTUATORS, FRICTION, LIMITS, TENDON_LIMITS = "equalities", "actuators", "dry friction", "joint limits", "tendon limits"
CONTACTS = "contacts"
# Those of a URDF that an engine may apply to other inputs than tau.
EFFORT, TRANSMISSIONS = "effort and velocity limits", "transmissions"
# What a file's author does about a base that is fixed, by the file's format.
FREE_BASE = {
    "urdf": "--floating-base",
    "mjcf": "give it a <freejoint/>",
    "usd": "disable the joint that fixes it",
}
SWITCHED_OFF = "is switched off in the file"


@dataclass(frozen=True)
class LeftOut:
    """A part of the file that the equations of motion do not hold.

    Attributes:
        what: in plural, such as "joint limits" or "visual and collision geometry".
        lines: of each such element in the order of the file; of one in an included file, that of the element that includes it.
        bears_on_motion: whether an engine that has it switched on could give other accelerations for it, at given tau.
        beside_tau: what the engines that were asked make of it on other inputs than tau, a sentence each.
    """

    what: str
    lines: tuple[int, ...]
    bears_on_motion: bool
    beside_tau: tuple[str, ...] = ()


@dataclass(frozen=True)
class Impossible:
    """An inertia that no body can have. The equations of motion are computed with it as it stands.

    Attributes:
        what: such as "indefinite inertia", "A + B < C", "negative mass", "massless moving link".
        found: mass [kg], then moments xx, yy, zz, xy, xz, yz [kg m^2] about the centre of mass, or the three principal moments.
        by_how_much: by which share of the largest moment (of the mass, where that is wrong) it is out of bounds.
        nearest: moments xx, yy, zz, xy, xz, yz of the nearest inertia that a body can have: the Frobenius norm of the difference
            of the matrices of second moments J = trace(I) / 2 1 - I is least, which makes J its projection on the cone of the
            positive semidefinite matrices. The same moments where nothing is wrong but the mass.
        file: name of the included file that has the line; "" for the robot's own.
    """

    body: str
    line: int
    what: str
    found: tuple[float, ...]
    by_how_much: float
    nearest: tuple[float, ...]
    file: str = ""

    @property
    def place(self) -> str:
        """ "line 3", or "inner.xml:3" in an included file."""
        return f"{self.file}:{self.line}" if self.file else f"line {self.line}"
