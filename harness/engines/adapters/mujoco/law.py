"""The law of each constraint that MuJoCo documents, from the model file alone.

Stiffness and damping follow from ``solref``, the impedance from ``solimp``. Two things stand in the program alone: couplings of joints
and tendons leave J' v out, so that a coupling that is not linear is wrong by it however stiff it is; and a body that only slides along
its axes, and carries none, has for its inverse weight 1/m instead of a mean over three directions.

Source: MuJoCo documentation, Computation, section Solver parameters; Modeling, URDF extensions; XML reference,
``compiler/fusestatic``; MuJoCo 4.0, engine_core_constraint.c (getsolparam, mj_makeImpedance, mj_diagApprox, mj_Jdotv).
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Literal

from lxml import etree

from harness.files.equalities import Equality, Linkage, Meeting, SolverParameters, TendonLinkage, Weld
from harness.files.mjcf.attributes import is_on
from harness.files.model_file import ModelFile, document_of
from harness.files.rules import ConstraintLaw, Impedance, InverseWeight

# mjMINIMP, mjMAXIMP and mjMINVAL.
LEAST_IMPEDANCE, MOST_IMPEDANCE, LEAST_NUMBER = 0.0001, 0.9999, 1e-15
_TIMESTEP = 0.002
_OF_BODIES: tuple[Literal["translation", "rotation"], ...] = ("translation", "rotation")


def settings(root: etree._Element, model_format: str) -> etree._Element:
    """The element in which compiler and options stand: that of a URDF's extension, where it has one."""
    extension = root.find("mujoco") if model_format == "urdf" else root
    return root if extension is None else extension


def fuses(root: etree._Element, model_format: str) -> bool:
    """Whether the compiler makes bodies that no joint moves one with their parents, which it does by itself in a URDF alone."""
    told = [compiler.get("fusestatic") for compiler in settings(root, model_format).iterfind("compiler[@fusestatic]")]
    return told[-1] == "true" if told else model_format == "urdf"


def constraint_laws(file: ModelFile) -> dict[str, ConstraintLaw]:
    """The law of each constraint by name; those of a URDF, which says nothing of it, are as soft as MuJoCo's defaults."""
    if not file.constraints:
        return {}
    return laws_in(document_of(file).root, file.constraints)


def laws_in(root: etree._Element, constraints: Iterable[Equality]) -> dict[str, ConstraintLaw]:
    """The law of each of some constraints of the file with this root element."""
    least_time = _least_time_constant(root)
    exact = [flag.get("diagexact") for flag in root.iterfind("option/flag[@diagexact]")][-1:] == ["enable"]
    return {one.name: _law(one, least_time, exact) for one in constraints}


def _least_time_constant(root: etree._Element) -> Fraction:
    """What ``solref`` is raised to: two steps, unless the flag "refsafe" is off."""
    written = [option.get("timestep") for option in root.iterfind("option[@timestep]")]
    return 2 * Fraction(float(written[-1]) if written else _TIMESTEP) if is_on(root, "refsafe") else Fraction(0)


def _law(constraint: Equality, least_time: Fraction, exact: bool) -> ConstraintLaw:
    softness = constraint.softness or SolverParameters()
    impedance = _impedance(softness)
    stiffness, damping = _stiffness_and_damping(softness, Fraction(impedance.most), least_time)
    return ConstraintLaw(
        impedance=impedance,
        stiffness=float(stiffness),
        damping=float(damping),
        weights=None if exact else _weights(constraint),
        has_curvature=isinstance(constraint.says, Meeting),
        least_regularisation=LEAST_NUMBER,
    )


def _impedance(softness: SolverParameters) -> Impedance:
    least, most, width, midpoint, power = softness.solimp
    bounded = (min(MOST_IMPEDANCE, max(LEAST_IMPEDANCE, value)) for value in (least, most, midpoint))
    least, most, midpoint = bounded
    return Impedance(least, most, max(0.0, width), midpoint, max(1.0, power))


def _stiffness_and_damping(softness: SolverParameters, most: Fraction, least_time: Fraction) -> tuple[Fraction, Fraction]:
    time, ratio = map(Fraction, softness.solref)
    least = Fraction(LEAST_NUMBER)
    if time <= 0:
        return -time / max(least, most**2), -ratio / max(least, most)
    time = max(time, least_time)
    return 1 / max(least, (most * time * ratio) ** 2), 2 / max(least, most * time)


def _weights(constraint: Equality) -> tuple[tuple[InverseWeight, ...], ...]:
    says = constraint.says
    if isinstance(says, Meeting):
        translation, rotation = (tuple(InverseWeight(kind, body) for body in says.bodies) for kind in _OF_BODIES)
        return (translation,) * 3 + ((rotation,) * 3 if isinstance(says, Weld) else ())
    if isinstance(says, Linkage):
        return (tuple(InverseWeight("joint", name) for name in (says.joint, says.leader) if name is not None),)
    assert isinstance(says, TendonLinkage)
    return (tuple(InverseWeight("tendon", one.name) for one in says.tendons),)
