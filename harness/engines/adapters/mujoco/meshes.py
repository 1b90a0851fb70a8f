"""Masses and inertias of the meshes of an MJCF, which no file states: MuJoCo's own compile of each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco

from harness.engines.adapters.mujoco.versions import compiling
from harness.files.mjcf.inertias import CompiledMesh, Number

# What a geom weighs follows from these.
_WEIGHED_BY = ("type", "size", "fromto", "meshname", "fitscale", "mass", "density", "typeinertia", "group")


def compiled_meshes(path: Path) -> dict[Number, CompiledMesh]:
    """The geoms of meshes by body and geom, as MuJoCo's own compile weighs them.

    Raises:
        ValueError: MuJoCo refuses the file; with its words. MemoryError: as ``versions.compiling``.

    Source: MuJoCo documentation, XML reference, ``asset/mesh`` and ``compiler``; mjCBody::InertiaFromGeom, by which a body with one
    geom has the mass and the principal moments of that.
    """
    # The default handler writes a log file into the current directory.
    mujoco.set_mju_user_warning(lambda message: None)
    spec = mujoco.MjSpec.from_file(str(path))
    # What moves geoms to other bodies, drops some, or changes what they weigh.
    spec.compiler.fusestatic = spec.compiler.discardvisual = False
    spec.compiler.boundmass = spec.compiler.boundinertia = 0.0
    spec.compiler.settotalmass = -1.0
    shapes = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    meshes = [geom for geom in spec.geoms if (geom.meshname or geom.type in shapes) and geom.parent.name != "world"]
    alone = [_alone(spec, geom) for geom in meshes]
    with compiling():
        model = spec.compile()
    return {
        (geom.parent.id - 1, geom.id - int(model.body_geomadr[geom.parent.id])): CompiledMesh(
            name=geom.name,
            mass=float(model.body_mass[body.id]),
            moments=model.body_inertia[body.id].tolist(),
            position=model.geom_pos[geom.id].tolist(),
            orientation=model.geom_quat[geom.id].tolist(),
        )
        for geom, body in zip(meshes, alone, strict=True)
    }


def _alone(spec: Any, geom: Any) -> Any:
    """A body behind all others that holds nothing but a copy of a geom."""
    body = spec.worldbody.add_body()
    copy = body.add_geom()
    for name in _WEIGHED_BY:
        setattr(copy, name, getattr(geom, name))
    return body
