"""The load audit: what an engine holds after loading, against what the system says, before any comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.engines import LoadedModel
from harness.errors import InvalidModel
from harness.files.model_file import ModelFile
from harness.library import nearest

if TYPE_CHECKING:
    from harness.programs.mechanisms.mechanism import Mechanism

# Coarser than what the comparison sees by far: the audit finds another mechanism, the comparison finds
# another digit.
AUDIT_TOLERANCE = 1e-6


def audit(loaded: LoadedModel | None, model: ModelFile | None, mechanism: Mechanism) -> None:
    """Check constraints by name, joints by name and size, gravity and total mass; nothing where an engine reads no file.

    What the engine does not say is not checked.

    Raises:
        InvalidModel: with the line, the value found and the value expected.
    """
    if model is not None:
        require_constraints(model, mechanism)
    if loaded is None or model is None:
        return
    for joint in mechanism.joints:
        if joint not in loaded.joints:
            hint = nearest(joint, sorted(loaded.joints)) if loaded.joints else "the model has none at all"
            raise InvalidModel(model.path, model.root_line, f"has no moving joint {joint!r}, which the system needs; {hint}")
    for joint, (positions, velocities) in loaded.joints.items():
        line = model.joint_lines.get(joint, model.root_line)
        if joint not in mechanism.joints:
            raise InvalidModel(model.path, line, f"joint {joint!r} moves, but the system has joints {', '.join(mechanism.joints)} only")
        nq, nv = mechanism.joint_sizes[joint]
        if (positions, velocities) != (nq, nv):
            kind = {(4, 3): "a ball joint", (7, 6): "a free joint"}.get((nq, nv), "a joint of one degree of freedom")
            problem = f"joint {joint!r} has nq = {positions} and nv = {velocities}, expected {nq} and {nv}; use {kind}"
            raise InvalidModel(model.path, line, problem)
    expected = (0.0, 0.0, -mechanism.gravity)
    if any(abs(found - wanted) > AUDIT_TOLERANCE * mechanism.gravity for found, wanted in zip(loaded.gravity, expected, strict=True)):
        # Adding zero turns -0 into 0.
        found_text, expected_text = (" ".join(f"{component + 0.0:g}" for component in vector) for vector in (loaded.gravity, expected))
        raise InvalidModel(model.path, model.gravity_line, f"gravity is {found_text} m/s^2, expected {expected_text} as the system says")
    if abs(loaded.total_mass - mechanism.total_mass) > AUDIT_TOLERANCE * mechanism.total_mass:
        masses = f"{loaded.total_mass:.10g} kg in all, expected {mechanism.total_mass:.10g} kg as the system says"
        raise InvalidModel(model.path, model.root_line, f"the moving bodies have {masses}")


def require_constraints(model: ModelFile, mechanism: Mechanism) -> None:
    """Check that a file has the constraints of a mechanism, by name.

    Raises:
        InvalidModel: it lacks one, or has another.
    """
    wanted = () if mechanism.constraints is None else mechanism.constraints.names
    found = {constraint.name: constraint.line for constraint in model.constraints}
    for name in wanted:
        if name not in found:
            hint = nearest(name, sorted(found)) if found else "the model has none at all"
            raise InvalidModel(model.path, model.root_line, f"has no constraint {name!r}, which the system needs; {hint}")
    for name, line in found.items():
        if name not in wanted:
            expected = f"the system has {', '.join(map(repr, wanted))} only" if wanted else "the system has none"
            raise InvalidModel(model.path, line, f"constraint {name!r} ties joints, but {expected}")
