"""adam's ``KinDynComputations`` with NumPy on a URDF and all its moving joints: its mass matrix and its bias forces.

Its models have a floating base; see ``harness.engines.state_by_state`` for models on the world. Its gravity is 9.80665 m/s^2, rounded
to float32, where none is given; the harness gives its own to an aided one. It knows neither springs, dampers nor rotors, which the harness
supplies, and passes over ``<mimic>``; a mechanism's model with one is refused. Its parser refuses elements beside links and joints that it
does not know, and origins that are left out; an aided adam is given the links and joints alone, with all origins.

Source: adam's documentation, ``adam.numpy.KinDynComputations``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines import Engine, LoadedModel, Unsupported
from harness.engines.loaded_file import refuse_joints
from harness.engines.reading import captured_output, elements_of, moving_mass, text_of, without_root_joint
from harness.engines.request import Refused, Request
from harness.engines.state_by_state import FloatingBase, StateByState
from harness.files.findings import EQUALITIES, FRICTION, LIMITS


class AdamModel(StateByState):
    """adam's computations."""

    def __init__(self, computations: Any, request: Request, own_joints: Sequence[str], root: str) -> None:
        self._base = FloatingBase(request, own_joints, root)
        super().__init__(request, self._base.places, self._base.width)
        self._computations = computations

    def loaded(self) -> LoadedModel:
        links = self._computations.rbdalgos.model.links
        masses = {name: float(_plain(link.inertial.mass)) for name, link in links.items() if link.inertial is not None}
        return LoadedModel(self.sizes, tuple(self._computations.g[:3].tolist()), moving_mass(self.request, masses))

    def _go_to(self, q: Array, v: Array) -> None:
        base = self._base
        base.go_to(self.columns, q, v)
        self._state = base.pose, base.positions, base.velocity, base.velocities

    def _mass_matrix(self) -> Array:
        return np.asarray(self._computations.mass_matrix(*self._state[:2])).reshape(self.width, -1)

    def _bias(self) -> Array:
        return np.asarray(self._computations.bias_force(*self._state)).ravel()

    def _parts_of_bias(self) -> tuple[Array, Array, Array]:
        velocity = np.asarray(self._computations.coriolis_term(*self._state)).ravel()
        return velocity, np.asarray(self._computations.gravity_term(*self._state[:2])).ravel(), np.zeros(self.width)

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        pose = np.asarray(self._computations.forward_kinematics(body, *self._state[:2]))
        jacobian = np.asarray(self._computations.jacobian(body, *self._state[:2])).reshape(6, -1)
        return pose[:3, :3], pose[:3, 3], jacobian


def _plain(number: Any) -> Any:
    """A number without the class in which adam keeps it."""
    return np.asarray(getattr(number, "array", number)).item()


class AdamEngine(Engine):
    title = "adam"
    requires = ("adam", "adam-robotics")
    formats = ("urdf",)
    optional = True
    factorises_mass_matrix = True
    supplied: Mapping[str, str] = {
        "urdf": (
            "gravity, and dampers, springs and rotor inertias of joints, and springs between points, are supplied from the file; "
            "so are origins that it leaves out"
        )
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "its KinDynComputations couple no joints",
        FRICTION: "its KinDynComputations apply no dry friction",
        LIMITS: "its KinDynComputations know no joint limits",
    }
    why_no_constraints = "adam reads no constraints and couples no joints"
    call: Mapping[str, str] = {
        "urdf": "k = KinDynComputations(PATH, joints); k.mass_matrix(base, q); k.bias_force(base, q, base_velocity, v)"
    }

    def read(self, request: Request) -> AdamModel:
        from adam.numpy import KinDynComputations

        elements, root = without_root_joint(request, "adam")
        refuse_joints(request, "adam", [root])
        own_joints = [joint.name for joint in request.joints if joint.name != root]
        # It prints the elements that it does not know.
        with captured_output():
            try:
                if request.aid is None:
                    return AdamModel(KinDynComputations(str(request.path), own_joints), request, own_joints, root)
                gravity = np.concatenate([request.aid.gravity, np.zeros(3)])
                content = with_origins(elements_of(request) if elements is None else elements)
                return AdamModel(KinDynComputations(content, own_joints, gravity=gravity), request, own_joints, root)
            except Exception as error:
                # Of a prismatic joint it puts numbers of other shapes together than of a revolute one.
                if request.text is not None and 'type="prismatic"' in request.text and isinstance(error, ValueError):
                    what = "adam's computations with NumPy raise an error on a model with a prismatic joint"
                    raise Unsupported(f"{what}: {error}") from error
                raise Refused(" ".join(f"{type(error).__name__}: {error}".split())) from error


def with_origins(root: etree._Element) -> str:
    """The links and joints of a URDF alone, every frame with its origin and turn written out: adam takes no default for them, and its
    parser raises an error at elements that it does not know."""
    for element in list(root.iterchildren("*")):
        if element.tag not in ("link", "joint"):
            root.remove(element)
    for framed in [*root.iterfind("joint"), *root.iterfind("link/inertial")]:
        origin = framed.find("origin")
        origin = etree.SubElement(framed, "origin") if origin is None else origin
        for name in ("xyz", "rpy"):
            origin.set(name, origin.get(name, "0 0 0"))
    return text_of(root)


ENGINE = AdamEngine()
