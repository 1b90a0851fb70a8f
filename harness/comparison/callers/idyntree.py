"""iDynTree as its user calls it: ``ModelLoader.loadModelFromFile``, then M and bias forces of ``KinDynComputations``.

Its models have a floating base; one that is fixed to the world is the rows of the joints, with the base at rest where the file has it.
Gravity is what its user hands over. Source: iDynTree documentation, ModelLoader and KinDynComputations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.callers._state_by_state import FloatingBase, refuse_joints
from harness.comparison.callers._urdf import root_link
from harness.comparison.questions import Caller, Loaded, Refused, Request
from harness.engines.output import captured_standard_error

_GRAVITY = (0.0, 0.0, -9.81)


class IdyntreeCaller(Caller):
    engine = "idyntree"
    formats: tuple[str, ...] = ("urdf",)
    requires = ("idyntree", "idyntree")
    optional = True
    factorises_mass_matrix = True
    supplied: Mapping[str, str] = {"urdf": "dampers, springs and rotor inertias of joints are supplied from the file"}
    why_no_equalities = "KinDynComputations couples no joints"
    call: Mapping[str, str] = {
        "urdf": (
            "loader.loadModelFromFile(PATH); k.loadRobotModel(loader.model()); k.setRobotState(base, q, base_velocity, v, gravity); "
            "k.getFreeFloatingMassMatrix(M); k.generalizedBiasForces(h)"
        )
    }

    def load(self, request: Request) -> Loaded:
        import idyntree.bindings as idyntree

        refuse_joints(request, "iDynTree", [request.floating_base])
        loader = idyntree.ModelLoader()
        # The reasons go to standard error alone.
        with captured_standard_error() as captured:
            if not loader.loadModelFromFile(str(request.path)):
                raise Refused(" ".join((captured() or "its parser refuses the file without a reason").split()))
        return LoadedRobot(loader.model().copy(), request)


class LoadedRobot(FloatingBase):
    """An iDynTree ``Model``."""

    def __init__(self, model: Any, request: Request) -> None:
        import idyntree.bindings as idyntree

        indices = [index for index in range(model.getNrOfJoints()) if model.getJoint(index).getNrOfDOFs()]
        offsets = {model.getJointName(index): int(model.getJoint(index).getDOFsOffset()) for index in indices}
        super().__init__(request, sorted(offsets, key=lambda name: offsets[name]))
        self._gravity = np.array(_GRAVITY if request.aid is None else request.aid.gravity, dtype=float)
        self._computations = idyntree.KinDynComputations()
        self._computations.loadRobotModel(model)
        self._computations.setFrameVelocityRepresentation(idyntree.MIXED_REPRESENTATION)
        self._matrix = idyntree.MatrixDynSize(6 + len(offsets), 6 + len(offsets))
        self._forces = idyntree.FreeFloatingGeneralizedTorques(model)
        self._place_base(model)

    def _place_base(self, model: Any) -> None:
        """Put the base where the root link of the file is in the world's origin: it is another where the parser leaves out that link."""
        root, base = root_link(self.request), model.getLinkName(model.getDefaultBaseLink())
        if root != base and self.request.floating_base:
            raise Refused(f"its base is link {base!r}, not the root {root!r}, of whose motion the harness asks", root)
        if root != base:
            self.base = np.linalg.inv(model.getFrameTransform(model.getFrameIndex(root)).asHomogeneousTransform().toNumPy())

    def _take(self) -> None:
        self._computations.setRobotState(self.base, self.positions, self.base_velocity, self.velocities, self._gravity)

    def _whole_mass_matrix(self) -> Array:
        self._computations.getFreeFloatingMassMatrix(self._matrix)
        return np.array(self._matrix.toNumPy())

    def _whole_bias(self) -> Array:
        self._computations.generalizedBiasForces(self._forces)
        return np.concatenate([self._forces.baseWrench().toNumPy(), self._forces.jointTorques().toNumPy()])


CALLER = IdyntreeCaller()
ENGINE = AidedEngine(CALLER)
