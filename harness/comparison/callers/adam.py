"""adam as its user calls it: ``adam.numpy.KinDynComputations`` of a file and all its moving joints, then its M and bias forces.

Its models have a floating base; one that is fixed to the world is the rows of the joints. Its parser refuses elements beside links and
joints that it does not know, and origins that are left out; an aided adam is given the links and joints alone, with all origins.

Source: adam's documentation, ``adam.numpy.KinDynComputations``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.callers._state_by_state import FloatingBase, refuse_joints
from harness.comparison.questions import Caller, Loaded, Refused, Request
from harness.engines.adapters.adam import with_origins
from harness.engines.output import captured_output


class AdamCaller(Caller):
    engine = "adam"
    formats: tuple[str, ...] = ("urdf",)
    requires = ("adam", "adam-robotics")
    optional = True
    factorises_mass_matrix = True
    supplied: Mapping[str, str] = {
        "urdf": "gravity, and dampers, springs and rotor inertias of joints, are supplied from the file; so are origins that it leaves out"
    }
    why_no_equalities = "its KinDynComputations couple no joints"
    call: Mapping[str, str] = {
        "urdf": "k = KinDynComputations(PATH, joints); k.mass_matrix(base, q); k.bias_force(base, q, base_velocity, v)"
    }

    def load(self, request: Request) -> Loaded:
        from adam.numpy import KinDynComputations

        refuse_joints(request, "adam", [request.floating_base])
        own_joints = [joint.name for joint in request.joints if joint.name != request.floating_base]
        # It prints the elements that it does not know.
        with captured_output():
            try:
                if request.aid is None:
                    return LoadedRobot(KinDynComputations(str(request.path), own_joints), request, own_joints)
                gravity = np.concatenate([request.aid.gravity, np.zeros(3)])
                computations = KinDynComputations(with_origins(request.path.read_bytes()), own_joints, gravity=gravity)
                return LoadedRobot(computations, request, own_joints)
            except Exception as error:
                raise Refused(" ".join(f"{type(error).__name__}: {error}".split())) from error


class LoadedRobot(FloatingBase):
    """adam's computations."""

    def __init__(self, computations: Any, request: Request, own_joints: Sequence[str]) -> None:
        super().__init__(request, own_joints)
        self._computations = computations

    def _take(self) -> None:
        self._state = self.base, self.positions, self.base_velocity, self.velocities

    def _whole_mass_matrix(self) -> Array:
        return np.asarray(self._computations.mass_matrix(*self._state[:2])).reshape(6 + len(self.positions), -1)

    def _whole_bias(self) -> Array:
        return np.asarray(self._computations.bias_force(*self._state)).ravel()


CALLER = AdamCaller()
ENGINE = AidedEngine(CALLER)
