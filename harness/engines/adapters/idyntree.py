"""iDynTree's ``KinDynComputations`` on a URDF: its mass matrix and its generalised bias forces.

Its models have a floating base, and its articulated-body algorithm no other; see ``harness.engines.mass_and_bias`` for models on
the world. It stores ``<dynamics damping>`` and applies none, and knows neither springs nor rotors, which the harness supplies.
Its parser passes over ``<mimic>`` without a word; such files are refused here.

Source: iDynTree documentation, KinDynComputations, ``getFreeFloatingMassMatrix``, ``generalizedBiasForces``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import LoadedModel, require_model
from harness.engines.mass_and_bias import FloatingBase, moving_mass, take_root_off
from harness.engines.output import captured_standard_error
from harness.models.model_file import ModelFile

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism


class IdyntreeModel(FloatingBase):
    def __init__(self, model: Any, file: ModelFile, joints: Sequence[str], root: str | None, gravity: float) -> None:
        import idyntree.bindings as idyntree

        indices = [index for index in range(model.getNrOfJoints()) if model.getJoint(index).getNrOfDOFs()]
        offsets = {model.getJointName(index): model.getJoint(index).getDOFsOffset() for index in indices}
        super().__init__(file, joints, root, sorted(offsets, key=lambda name: int(offsets[name])))
        self._model, self._file, self._gravity = model, file, [0.0, 0.0, -gravity]
        self._computations = idyntree.KinDynComputations()
        self._computations.loadRobotModel(model)
        self._computations.setFrameVelocityRepresentation(idyntree.MIXED_REPRESENTATION)
        self._matrix = idyntree.MatrixDynSize(6 + len(offsets), 6 + len(offsets))
        self._jacobian = idyntree.MatrixDynSize(6, 6 + len(offsets))
        self._forces = idyntree.FreeFloatingGeneralizedTorques(model)

    def loaded(self) -> LoadedModel:
        model = self._model
        masses = {model.getLinkName(index): model.getLink(index).inertia().getMass() for index in range(model.getNrOfLinks())}
        sizes = dict.fromkeys(self.places, (1, 1)) | {name: size for name, size in self.columns.sizes.items() if name in self.places}
        x, y, z = self._gravity
        return LoadedModel(sizes, (x, y, z), moving_mass(self._file, self._root, masses))

    def _take(self) -> None:
        self._set(self.base_velocity, self.velocities, self._gravity)

    def _set(self, base_velocity: Array, velocities: Array, gravity: Sequence[float]) -> None:
        self._computations.setRobotState(self.base, self.positions, base_velocity, velocities, np.array(gravity))

    def _mass_matrix(self) -> Array:
        self._computations.getFreeFloatingMassMatrix(self._matrix)
        return np.asarray(self._matrix.toNumPy())

    def _bias_forces(self) -> Array:
        self._computations.generalizedBiasForces(self._forces)
        return np.concatenate([self._forces.baseWrench().toNumPy(), self._forces.jointTorques().toNumPy()])

    def _velocity_and_gravity(self) -> tuple[Array, Array]:
        self._set(self.base_velocity, self.velocities, [0.0] * 3)
        velocity = self._bias_forces()
        self._set(np.zeros(6), np.zeros(len(self.velocities)), self._gravity)
        gravity = self._bias_forces()
        self._take()
        return velocity, gravity

    def _frame(self, body: str) -> tuple[Array, Array]:
        self._computations.getFrameFreeFloatingJacobian(body, self._jacobian)
        pose = self._computations.getWorldTransform(body).asHomogeneousTransform().toNumPy()
        return np.array(pose), np.array(self._jacobian.toNumPy())


class IdyntreeEngine:
    requires = ("idyntree", "idyntree")
    formats = ("urdf",)
    optional = True
    factorises_mass_matrix = True

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> IdyntreeModel:
        import idyntree.bindings as idyntree

        file = require_model(source, "idyntree")
        text, root = take_root_off(file, "iDynTree")
        loader = idyntree.ModelLoader()
        # The reasons go to standard error alone.
        with captured_standard_error() as captured:
            read = loader.loadModelFromString(text, "urdf")
        if not read:
            raise ValueError(captured() or "its parser refuses the model without a reason")
        return IdyntreeModel(loader.model().copy(), file, joints, root, gravity)


ENGINE = IdyntreeEngine()
