"""PyBullet as its user calls it: ``loadURDF`` with a fixed base, then ``calculateMassMatrix`` and ``calculateInverseDynamics``.

Its forward dynamics are those of a time step. Gravity is what its user sets. By default the inertias of links are made of their collision
shapes; an aided PyBullet takes those of the file, and none for links that have none there.

Source: PyBullet Quickstart Guide, ``loadURDF``, ``calculateMassMatrix``, ``calculateInverseDynamics``.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Mapping

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.callers._state_by_state import StateByState, refuse_joints
from harness.comparison.callers._urdf import elements_of, text_of, without_shapes
from harness.comparison.questions import Caller, Loaded, Refused, Request
from harness.engines.output import captured_output

_GRAVITY = (0.0, 0.0, -9.81)
# pybullet.URDF_USE_INERTIA_FROM_FILE.
_INERTIAS_OF_FILE = 2
_NOTHING = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'


class PybulletCaller(Caller):
    engine = "pybullet"
    formats: tuple[str, ...] = ("urdf",)
    requires = ("pybullet", "pybullet")
    optional = True
    factorises_mass_matrix = True
    supplied: Mapping[str, str] = {
        "urdf": "dampers, springs and rotor inertias of joints are supplied from the file, and each link has the inertia that stands there"
    }
    why_no_equalities = "its mass matrix and inverse dynamics hold no joints together"
    call: Mapping[str, str] = {
        "urdf": (
            "b = p.loadURDF(PATH, useFixedBase=True); p.setGravity(0, 0, -9.81); p.calculateMassMatrix(b, q); "
            "p.calculateInverseDynamics(b, q, v, [0] * len(q))"
        )
    }

    def load(self, request: Request) -> Loaded:
        refuse_joints(request, "PyBullet", ())
        if request.aid is None:
            return LoadedRobot(_read(0, text_of(without_shapes(elements_of(request), meshes_alone=True))), _notes(request), request)
        return LoadedRobot(_read(_INERTIAS_OF_FILE, _with_inertias(request)), (), request)


def _notes(request: Request) -> tuple[str, ...]:
    """That meshes are taken out, where links collide by some."""
    meshes = elements_of(request).findall("link/collision/geometry/mesh")
    return (
        (f"read without {len(meshes)} mesh{'es' if len(meshes) > 1 else ''} of collision: the boxes around them stand in no file",)
        if meshes
        else ()
    )


def _read(flags: int, content: bytes) -> tuple[int, int]:
    """A body in a physics server of its own, and that server before it."""
    # The reasons go to standard output and error alone; it keeps files by their names.
    with captured_output() as captured, tempfile.NamedTemporaryFile(suffix=".urdf") as file:
        file.write(content)
        file.flush()
        import pybullet

        server = pybullet.connect(pybullet.DIRECT)
        try:
            return server, pybullet.loadURDF(file.name, useFixedBase=True, flags=flags, physicsClientId=server)
        except pybullet.error as error:
            pybullet.disconnect(server)
            raise Refused(" ".join((captured() or str(error)).split())) from error


def _with_inertias(request: Request) -> bytes:
    """The text with an inertia of nothing where a link has none, for which PyBullet has one of its own, and without shapes."""
    root = without_shapes(elements_of(request))
    for link in root.iterfind("link"):
        if link.find("inertial") is None:
            link.append(etree.fromstring(_NOTHING))
    return text_of(root)


class LoadedRobot(StateByState):
    """A body in a physics server of its own, which ends with it."""

    def __init__(self, loaded: tuple[int, int], notes: tuple[str, ...], request: Request) -> None:
        import pybullet

        server, body = loaded
        weakref.finalize(self, pybullet.disconnect, server)
        infos = [pybullet.getJointInfo(body, index, physicsClientId=server) for index in range(pybullet.getNumJoints(body, server))]
        moving = sorted((info for info in infos if info[2] != pybullet.JOINT_FIXED), key=lambda info: int(info[4]))
        super().__init__(request, {info[1].decode(): place for place, info in enumerate(moving)}, len(moving))
        self._server, self._body, self.notes = server, body, notes
        self._q, self._v = [0.0] * self.width, [0.0] * self.width
        pybullet.setGravity(*(_GRAVITY if request.aid is None else request.aid.gravity), physicsClientId=server)

    def _go_to(self, q: Array, v: Array) -> None:
        positions = np.zeros(self.width)
        for name in self.columns.sizes:
            positions[self.places[name]] = q[self.columns.spans(name)[0]][0]
        self._q, self._v = positions.tolist(), v.tolist()

    def _mass_matrix(self) -> Array:
        import pybullet

        return np.array(pybullet.calculateMassMatrix(self._body, self._q, physicsClientId=self._server))

    def _bias(self) -> Array:
        import pybullet

        still = [0.0] * self.width
        return np.array(pybullet.calculateInverseDynamics(self._body, self._q, self._v, still, physicsClientId=self._server))


CALLER = PybulletCaller()
ENGINE = AidedEngine(CALLER)
