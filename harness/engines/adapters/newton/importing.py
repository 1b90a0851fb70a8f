"""Newton's importers of MJCF, URDF and USD: a ``ModelBuilder`` of a file, and which of its joints are which of the file.

Source: Newton documentation, ``ModelBuilder.add_mjcf``, ``add_urdf`` and ``add_usd``; ``newton/_src/utils/import_mjcf.py`` for names.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

import newton
import numpy as np
import warp

from harness.arrays import Array
from harness.engines.interface import Unsupported
from harness.engines.loaded_file import LoadedFile
from harness.engines.reading import elements_of, text_of, without_shapes
from harness.engines.request import AskedJoint, Refused, Request
from harness.engines.warp_kernels import keep_compiled
from harness.files.joint_kinds import JointKind

# By the number of a joint of Newton, the joints of the request that it is made of.
Joined = Mapping[int, Sequence[AskedJoint]]
File = TypeVar("File", bound=LoadedFile)
# As of ``harness.files.mjcf.reading``.
_UNNAMED = re.compile(r"\(joint (\d+) of ([^()]+)\)")


def read_by(
    request: Request, builder: Callable[[], Any], load: Callable[[Request, Any, Joined], File], with_equalities: bool = False
) -> File:
    """A file in the solver that ``load`` gives what the importer has made of it, in a ``ModelBuilder`` of ``builder``; raises Refused."""
    keep_compiled(warp)
    if request.supplied_ball_joint:
        raise Unsupported(f"ball joint {request.supplied_ball_joint!r}, which no URDF has")
    for joint in request.joints:
        if joint.kind == JointKind.PLANAR:
            raise Refused(f"planar joint {joint.name!r}: its importer makes two slides of one, which cannot turn")
        if joint.kind == JointKind.FREE and not joint.is_measured_in_the_world:
            raise Refused(f"free joint {joint.name!r} is measured in a frame of the file")
    importer = _Importer(request, builder, load, with_equalities)
    try:
        return importer.file(str(request.path) if request.text is None else request.text)
    except Refused as refusal:
        # A mesh may be elsewhere, or of a kind that takes another package.
        if request.format != "urdf" or elements_of(request).find(".//geometry/mesh") is None:
            raise
        without = importer.file(text_of(without_shapes(elements_of(request), meshes_alone=True)))
        without.notes = (f"refused with its meshes, and read without them: {refusal}",)
        return without


class _Importer(Generic[File]):
    """Newton's importers, for one file."""

    def __init__(
        self, request: Request, builder: Callable[[], Any], load: Callable[[Request, Any, Joined], File], with_equalities: bool
    ) -> None:
        self._request, self._builder, self._load, self._with_equalities = request, builder, load, with_equalities

    def file(self, source: str) -> File:
        """A file, or its text, as the importer reads it.

        Raises:
            Refused: in the importer's words, or as ``stages.read_stage``.
        """
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                robot, joined = self._robot_of(source)
        except Refused:
            raise
        except Exception as error:
            raise Refused(f"{type(error).__name__}: {' '.join(str(error).split())}") from error
        return self._load(self._request, robot, joined)

    def _robot_of(self, source: str) -> tuple[Any, Joined]:
        request = self._request
        if request.format == "usd":
            # Imported late: files of other formats are read where OpenUSD is not.
            from harness.engines.adapters.newton.stages import read_stage

            return read_stage(request, self._builder)
        robot = self._builder()
        if request.format == "mjcf":
            robot.add_mjcf(source, skip_equality_constraints=not self._with_equalities)
            return robot, _joined(robot, request)
        if request.aid is not None:
            robot.default_shape_cfg.density = 0.0
        robot.add_urdf(source, floating=bool(request.floating_base) or None)
        return robot, _joined(robot, request)


def sanitized(name: str, model_format: str) -> str:
    """A name of an MJCF as the importer of that writes it."""
    return name.replace("-", "_") if model_format == "mjcf" else name


def _in_newton(joint: AskedJoint, model_format: str) -> str:
    """The name of a joint of a file as the importer writes it; of an MJCF's without a name it is made of that of its body."""
    unnamed = _UNNAMED.fullmatch(joint.name) if model_format == "mjcf" else None
    if unnamed is None:
        return sanitized(joint.name, model_format)
    ending = "freejoint" if joint.kind == JointKind.FREE else f"joint_{int(unnamed[1]) - 1}"
    return f"{sanitized(unnamed[2], model_format)}_{ending}"


def _joined(robot: Any, request: Request) -> Joined:
    """The joints of the request that each joint of Newton with velocities is made of, by its number.

    The importer of MJCF makes one joint of all that a body has, of whose names its own is made.

    Raises:
        Refused: a name is none of the file's.
    """
    joints = {_in_newton(joint, request.format): joint for joint in request.joints}
    found: dict[int, Sequence[AskedJoint]] = {}
    for number, label in enumerate(robot.joint_label):
        kind, count = newton.JointType(robot.joint_type[number]), sum(robot.joint_dof_dim[number])
        # A joint of no tree is an equality of the file.
        if kind == newton.JointType.FIXED or robot.joint_articulation[number] < 0:
            continue
        own = label.rpartition("/")[2]
        if own == "floating_base" and request.floating_base:
            own = sanitized(request.floating_base, request.format)
        parts = spelt(own, list(joints), count if kind == newton.JointType.D6 else 1)
        if parts is None:
            raise Refused(f"its importer names a joint {own!r}, by which none of the file is found")
        found[number] = [joints[name] for name in parts]
    return found


def spelt(joined: str, names: Sequence[str], count: int) -> list[str] | None:
    """That many names of which another is made, with underscores between them; None for one that is not made so."""
    if count == 1:
        return [joined] if joined in names else None
    for name in names:
        if joined.startswith(f"{name}_") and (rest := spelt(joined.removeprefix(f"{name}_"), names, count - 1)) is not None:
            return [name, *rest]
    return None


def starts_of(robot: Any, joined: Joined) -> dict[str, tuple[int, int]]:
    """The first position and the first velocity of each joint of the request; slides of a body go before its hinges."""
    found = {}
    for number, those in joined.items():
        at, start = robot.joint_q_start[number], robot.joint_qd_start[number]
        for joint in sorted(those, key=lambda one: one.kind != JointKind.SLIDE):
            found[joint.name] = at, start
            at, start = at + joint.kind.sizes[0], start + joint.kind.sizes[1]
    return found


def armature_of(request: Request, robot: Any, starts: Mapping[str, tuple[int, int]]) -> Array:
    """(nv,) rotor inertias that an aided request supplies, in Newton's order."""
    assert request.aid is not None
    found = np.zeros(robot.joint_dof_count, dtype=np.float32)
    for joint in (joint for joint in request.joints if joint.name in starts):
        found[starts[joint.name][1] :][: len(joint.velocities)] = request.aid.armature[list(joint.velocities)]
    return found
