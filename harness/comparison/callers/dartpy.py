"""DART as its user calls it: ``DartLoader.parseSkeleton`` with the root link fixed, then ``Skeleton.computeForwardDynamics``.

A free joint's position is a rotation vector, then a place; its velocity is the angular, then the linear one, both along the axes of its
parent. Source: DART documentation, dart::utils::DartLoader, dart::dynamics::Skeleton and FreeJoint.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.callers._state_by_state import StateByState, refuse_joints
from harness.comparison.callers._urdf import read_without_meshes
from harness.comparison.questions import Caller, Loaded, Refused, Request
from harness.engines.output import captured_standard_error
from harness.engines.rotations import FREE, rotation

# Of its messages in a terminal.
_COLOURS = re.compile("\x1b\\[[0-9;]*m")


class DartCaller(Caller):
    engine = "dartpy"
    formats: tuple[str, ...] = ("urdf",)
    requires = ("dartpy", "dartpy")
    optional = True
    factorises_mass_matrix = False
    supplied: Mapping[str, str] = {
        "urdf": (
            "gravity and springs of joints are supplied from the file, and no inertia where a link has none; "
            "dampers are its own, at a time step of 0"
        )
    }
    why_no_equalities = "computeForwardDynamics holds no joints together, which a step of its world does"
    call: Mapping[str, str] = {
        "urdf": (
            "loader.setOptions(DartLoaderOptions(defaultRootJointType=DartLoaderRootJointType.FIXED)); "
            "s = loader.parseSkeleton(PATH); s.computeForwardDynamics()"
        )
    }

    def load(self, request: Request) -> Loaded:
        import dartpy

        refuse_joints(request, "DART", [request.floating_base])
        loader, kinds = dartpy.utils.DartLoader(), dartpy.utils.DartLoaderRootJointType
        loader.setOptions(dartpy.utils.DartLoaderOptions(defaultRootJointType=kinds.FLOATING if request.floating_base else kinds.FIXED))

        def read(content: bytes) -> Any:
            # The reasons go to standard error alone.
            with captured_standard_error() as captured:
                skeleton = loader.parseSkeletonString(content.decode(), dartpy.common.Uri(request.path.resolve().as_uri()))
                if skeleton is None:
                    raise Refused(_COLOURS.sub("", " ".join((captured() or "its loader refuses the file without a reason").split())))
            return skeleton

        skeleton, notes = read_without_meshes(request, read)
        if request.aid is not None:
            if request.aid.armature.any():
                raise Refused("its algorithm knows no rotor inertias of joints, which no force supplies")
            skeleton.setGravity(request.aid.gravity)
            skeleton.setTimeStep(0.0)
            # It warns of a body without mass, and computes with one.
            with captured_standard_error():
                for body in skeleton.getBodyNodes():
                    if body.getName() not in request.aid.inertias:
                        body.setInertia(dartpy.dynamics.Inertia(0.0, np.zeros(3), np.zeros((3, 3))))
        return LoadedRobot(skeleton, request, notes)


class LoadedRobot(StateByState):
    """A ``Skeleton``."""

    rotation_first = True
    applies_dampers = True

    def __init__(self, skeleton: Any, request: Request, notes: tuple[str, ...]) -> None:
        places = {}
        for joint in skeleton.getJoints():
            if joint.getNumDofs():
                name = request.floating_base if joint.getNumDofs() == FREE[1] and request.floating_base else joint.getName()
                places[name] = int(joint.getIndexInSkeleton(0))
        super().__init__(request, places, skeleton.getNumDofs())
        self._skeleton, self.notes = skeleton, notes

    def _go_to(self, q: Array, v: Array) -> None:
        import dartpy

        positions = np.zeros(self.width)
        for name, size in self.columns.sizes.items():
            given = q[self.columns.spans(name)[0]]
            if size == FREE:
                pose = dartpy.math.Isometry3()
                pose.set_rotation(rotation(given[3:]))
                pose.set_translation(given[:3])
                given = dartpy.dynamics.FreeJoint.convertToPositions(pose)
            positions[self.places[name] : self.places[name] + len(given)] = given
        self._skeleton.setPositions(positions)
        self._skeleton.setVelocities(v)

    def _accelerations(self, force: Array) -> Array:
        self._skeleton.setForces(force)
        self._skeleton.computeForwardDynamics()
        return np.asarray(self._skeleton.getAccelerations())

    def _mass_matrix(self) -> Array:
        return np.asarray(self._skeleton.getMassMatrix())

    def _bias(self) -> Array:
        skeleton = self._skeleton
        dampers = np.array([dof.getDampingCoefficient() for dof in skeleton.getDofs()])
        return np.asarray(skeleton.getCoriolisAndGravityForces() + dampers * skeleton.getVelocities())


CALLER = DartCaller()
ENGINE = AidedEngine(CALLER)
