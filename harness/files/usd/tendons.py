"""The tendons of MuJoCo's schema that are springs, dampers and inertias: on sums of joint positions, and straight from one site to another.

Source: MuJoCo documentation, OpenUSD, MjcTendon, and XML reference, ``tendon``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

from harness.files.document.source import Unread
from harness.files.document.stage import Prim
from harness.files.findings import FRICTION, TENDON_LIMITS
from harness.files.given import Given, Pose
from harness.files.tree import Coupling, Spring
from harness.files.usd.actuators import limited

TENDON = "MjcTendon"
# Body of a prim, and the prim's frame in it.
Placed = Callable[[Prim], tuple[str, Pose]]


def terms_of(prim: Prim, names: Mapping[str, str]) -> tuple[tuple[str, Fraction], ...]:
    """The joints of a fixed tendon with their multiples; ``names`` are those of moving joints by path.

    Raises:
        InvalidModel: one is no joint that moves, or has no multiple.
    """
    paths, multiples = prim.words("mjc:path"), prim.finite("mjc:path:coef")
    if len(paths) != len(multiples) or any(path not in names for path in paths):
        prim.refuse(
            f"has {len(paths)} joints in mjc:path and {len(multiples)} numbers in mjc:path:coef; name joints that move, with one each"
        )
    return tuple((names[path], multiple) for path, multiple in zip(paths, multiples, strict=True))


def spring_of(prim: Prim, names: Mapping[str, str], prims: Mapping[str, Prim], placed: Placed) -> Spring | Coupling | Unread | None:
    """The spring, damper and inertia that a tendon is, None where it is none, and why it is not read where it is of another shape."""
    stiffness, damping, armature = (prim.number(f"mjc:{name}") or Fraction(0) for name in ("stiffness", "damping", "armature"))
    if not stiffness and not damping and not armature:
        return None
    rest = prim.finite("mjc:springlength") or (Given(-1.0, prim.place, "mjc:springlength"),)
    lower, upper = rest[0], rest[-1]
    if stiffness and lower != upper:
        what, advice = "is slack between two lengths", "write one mjc:springlength twice"
    elif prim.word("mjc:type", "spatial") == "fixed":
        return Coupling(terms_of(prim, names), stiffness, damping, None if lower < 0 else lower, prim.place, armature)
    elif len(prim.words("mjc:path")) != 2 or any("MjcSiteAPI" not in prims[one].schemas for one in prim.words("mjc:path") if one in prims):
        what, advice = "does not run straight from one site to another", "lead it through two sites"
    elif stiffness and lower < 0:
        what, advice = "leaves its mjc:springlength to the reader", "write it"
    else:
        first, second = (placed(prims[path]) for path in prim.words("mjc:path"))
        return Spring((first, second), lower if stiffness else Fraction(0), stiffness, damping, prim.place, armature=armature)
    return Unread(prim.place, f"<{prim.path}> {what}", advice)


def bounds_of(prim: Prim) -> Iterator[str]:
    """Bounds of a tendon that no tree holds, by ``LeftOut.what``."""
    if prim.number("mjc:frictionloss"):
        yield FRICTION
    if limited(prim, "mjc:limited", "mjc:range") is not None:
        yield TENDON_LIMITS
