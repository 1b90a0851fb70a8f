"""iDynTree's ``KinDynComputations`` on a URDF: its mass matrix and its generalised bias forces.

Its models have a floating base, and its articulated-body algorithm no other; see ``harness.engines.state_by_state`` for models on
the world, whose base is at rest where the file has it. It stores ``<dynamics damping>`` and applies none, and knows neither springs nor
rotors, which the harness supplies. Gravity is what its user hands over. Its parser passes over ``<mimic>`` without a word; a
mechanism's model with one is refused.

Source: iDynTree documentation, ModelLoader and KinDynComputations, ``getFreeFloatingMassMatrix``, ``generalizedBiasForces``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Engine, LoadedModel
from harness.engines.loaded_file import refuse_joints
from harness.engines.reading import captured_standard_error, elements_of, moving_mass, root_link, text_of, without_root_joint
from harness.engines.request import Refused, Request
from harness.engines.state_by_state import FloatingBase, StateByState
from harness.files.findings import EQUALITIES, FRICTION, LIMITS


class IdyntreeModel(StateByState):
    """An iDynTree ``Model``."""

    def __init__(self, model: Any, request: Request, root: str) -> None:
        import idyntree.bindings as idyntree

        indices = [index for index in range(model.getNrOfJoints()) if model.getJoint(index).getNrOfDOFs()]
        offsets = {model.getJointName(index): int(model.getJoint(index).getDOFsOffset()) for index in indices}
        self._base = FloatingBase(request, sorted(offsets, key=lambda name: offsets[name]), root)
        super().__init__(request, self._base.places, self._base.width)
        self._model = model
        self._gravity = np.array(request.gravity)
        self._computations = idyntree.KinDynComputations()
        self._computations.loadRobotModel(model)
        self._computations.setFrameVelocityRepresentation(idyntree.MIXED_REPRESENTATION)
        self._matrix = idyntree.MatrixDynSize(6 + len(offsets), 6 + len(offsets))
        self._jacobian = idyntree.MatrixDynSize(6, 6 + len(offsets))
        self._forces = idyntree.FreeFloatingGeneralizedTorques(model)
        if not root or root == request.floating_base:
            self._place_base()

    def _place_base(self) -> None:
        """Put the base where the root link of the file is in the world's origin: it is another where the parser leaves out that link."""
        root, base = root_link(elements_of(self.request)), self._model.getLinkName(self._model.getDefaultBaseLink())
        if root != base and self.request.floating_base:
            raise Refused(f"its base is link {base!r}, not the root {root!r}, of whose motion the harness asks")
        if root != base:
            pose = self._model.getFrameTransform(self._model.getFrameIndex(root)).asHomogeneousTransform()
            self._base.pose = np.linalg.inv(pose.toNumPy())

    def loaded(self) -> LoadedModel:
        model = self._model
        masses = {model.getLinkName(index): model.getLink(index).inertia().getMass() for index in range(model.getNrOfLinks())}
        return LoadedModel(self.sizes, tuple(self._gravity.tolist()), moving_mass(self.request, masses))

    def _go_to(self, q: Array, v: Array) -> None:
        self._base.go_to(self.columns, q, v)
        self._set(self._base.velocity, self._base.velocities, self._gravity)

    def _set(self, base_velocity: Array, velocities: Array, gravity: Array) -> None:
        self._computations.setRobotState(self._base.pose, self._base.positions, base_velocity, velocities, gravity)

    def _mass_matrix(self) -> Array:
        self._computations.getFreeFloatingMassMatrix(self._matrix)
        return np.array(self._matrix.toNumPy())

    def _bias(self) -> Array:
        self._computations.generalizedBiasForces(self._forces)
        return np.concatenate([self._forces.baseWrench().toNumPy(), self._forces.jointTorques().toNumPy()])

    def _parts_of_bias(self) -> tuple[Array, Array, Array]:
        base = self._base
        self._set(base.velocity, base.velocities, np.zeros(3))
        velocity = self._bias()
        self._set(np.zeros(6), np.zeros(len(base.velocities)), self._gravity)
        gravity = self._bias()
        self._set(base.velocity, base.velocities, self._gravity)
        return velocity, gravity, np.zeros(self.width)

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        self._computations.getFrameFreeFloatingJacobian(body, self._jacobian)
        pose = self._computations.getWorldTransform(body).asHomogeneousTransform().toNumPy()
        return pose[:3, :3], pose[:3, 3], np.array(self._jacobian.toNumPy())


class IdyntreeEngine(Engine):
    title = "iDynTree"
    requires = ("idyntree", "idyntree")
    formats = ("urdf",)
    optional = True
    factorises_mass_matrix = True
    supplied: Mapping[str, str] = {
        "urdf": "dampers, springs and rotor inertias of joints, and springs between points, are supplied from the file"
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "KinDynComputations couples no joints",
        FRICTION: "KinDynComputations applies no dry friction",
        LIMITS: "KinDynComputations knows no joint limits",
    }
    why_no_constraints = "iDynTree reads no constraints and couples no joints"
    call: Mapping[str, str] = {
        "urdf": (
            "loader.loadModelFromFile(PATH); k.loadRobotModel(loader.model()); k.setRobotState(base, q, base_velocity, v, gravity); "
            "k.getFreeFloatingMassMatrix(M); k.generalizedBiasForces(h)"
        )
    }

    def read(self, request: Request) -> IdyntreeModel:
        import idyntree.bindings as idyntree

        elements, root = without_root_joint(request, "iDynTree")
        text = request.text if elements is None else text_of(elements)
        refuse_joints(request, "iDynTree", [root])
        loader = idyntree.ModelLoader()
        # The reasons go to standard error alone.
        with captured_standard_error() as captured:
            read = loader.loadModelFromFile(str(request.path)) if text is None else loader.loadModelFromString(text, "urdf")
            if not read:
                raise Refused(" ".join((captured() or "its parser refuses the file without a reason").split()))
        return IdyntreeModel(loader.model().copy(), request, root)


ENGINE = IdyntreeEngine()
