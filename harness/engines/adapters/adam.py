"""adam's ``KinDynComputations`` with NumPy on a URDF: its mass matrix and its bias forces.

Its models have a floating base; see ``harness.engines.mass_and_bias`` for models on the world. Its gravity is 9.80665 m/s^2, rounded
to float32, where none is given; the harness gives its own. It knows neither springs, dampers nor rotors, which the harness supplies,
and passes over ``<mimic>``; such files are refused here.

Source: adam's documentation, ``adam.numpy.KinDynComputations``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines import LoadedModel, Unsupported, require_model
from harness.engines.mass_and_bias import FloatingBase, moving_mass, take_root_off
from harness.models.model_file import ModelFile

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism


class AdamModel(FloatingBase):
    def __init__(self, computations: Any, file: ModelFile, joints: Sequence[str], root: str | None, own_joints: Sequence[str]) -> None:
        super().__init__(file, joints, root, own_joints)
        self._computations, self._file = computations, file

    def loaded(self) -> LoadedModel:
        links = self._computations.rbdalgos.model.links
        masses = {name: float(_plain(link.inertial.mass)) for name, link in links.items() if link.inertial is not None}
        sizes = {name: self.columns.sizes.get(name, (1, 1)) for name in self.places}
        x, y, z = self._computations.g[:3].tolist()
        return LoadedModel(sizes, (x, y, z), moving_mass(self._file, self._root, masses))

    def _take(self) -> None:
        self._state = self.base, self.positions, self.base_velocity, self.velocities

    def _mass_matrix(self) -> Array:
        return np.asarray(self._computations.mass_matrix(*self._state[:2])).reshape(6 + len(self.positions), -1)

    def _bias_forces(self) -> Array:
        return np.asarray(self._computations.bias_force(*self._state)).ravel()

    def _velocity_and_gravity(self) -> tuple[Array, Array]:
        velocity = np.asarray(self._computations.coriolis_term(*self._state)).ravel()
        return velocity, np.asarray(self._computations.gravity_term(*self._state[:2])).ravel()

    def _frame(self, body: str) -> tuple[Array, Array]:
        pose, jacobian = (getattr(self._computations, name)(body, *self._state[:2]) for name in ("forward_kinematics", "jacobian"))
        return np.asarray(pose), np.asarray(jacobian).reshape(6, -1)


def _plain(number: Any) -> Any:
    """A number without the class in which adam keeps it."""
    return np.asarray(getattr(number, "array", number)).item()


class AdamEngine:
    requires = ("adam", "adam-robotics")
    formats = ("urdf",)
    optional = True
    factorises_mass_matrix = True

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> AdamModel:
        from adam.numpy import KinDynComputations

        file = require_model(source, "adam")
        text, root = take_root_off(file, "adam")
        own_joints = [name for name in file.joint_lines if name != root]
        gravities = np.array([0.0, 0.0, -gravity, 0.0, 0.0, 0.0])
        try:
            computations = KinDynComputations(with_origins(text.encode()), own_joints, gravity=gravities)
        except ValueError as error:
            # Of a prismatic joint it puts numbers of other shapes together than of a revolute one.
            if 'type="prismatic"' in text:
                raise Unsupported(f"adam's computations with NumPy raise an error on a model with a prismatic joint: {error}") from error
            raise
        return AdamModel(computations, file, joints, root, own_joints)


def with_origins(content: bytes) -> str:
    """The links and joints of a URDF alone, every frame with its origin and turn written out: adam takes no default for them, and its
    parser raises an error at elements that it does not know."""
    root = etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True))
    for element in list(root.iterchildren("*")):
        if element.tag not in ("link", "joint"):
            root.remove(element)
    for framed in [*root.iterfind("joint"), *root.iterfind("link/inertial")]:
        origin = framed.find("origin")
        origin = etree.SubElement(framed, "origin") if origin is None else origin
        for name in ("xyz", "rpy"):
            origin.set(name, origin.get(name, "0 0 0"))
    return str(etree.tostring(root, encoding="unicode"))


ENGINE = AdamEngine()
