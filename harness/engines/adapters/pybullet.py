"""PyBullet on a URDF with a fixed base: its mass matrix and its inverse dynamics at no acceleration.

Its own forward dynamics are those of a time step, with dampers treated implicitly and with contacts. What it stores of
``<dynamics damping>`` is none of inverse dynamics; the harness supplies it, as springs and rotors, which its reader does not know.
Gravity is what its user sets. By default the inertias of links are made of their collision shapes; an aided PyBullet takes those of the
file, by ``URDF_USE_INERTIA_FROM_FILE``, and none for links that have none there.

Motions are those of its own steps, with contacts, between links of the file too, and with the inertias that stand there. Motors of joints
and damping, which it has by default, are off.

Source: PyBullet Quickstart Guide, ``loadURDF``, ``stepSimulation``, ``setJointMotorControl2``, ``changeDynamics``,
``calculateMassMatrix``, ``calculateInverseDynamics``, ``calculateJacobian``.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Mapping
from typing import Any

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines import Engine, LoadedModel, Unsupported
from harness.engines.coordinates import rotation
from harness.engines.loaded_file import refuse_joints
from harness.engines.moving import MotionsRequest, Moved, SimulatedFile, moved_as_they_stand
from harness.engines.reading import (
    captured_output,
    elements_of,
    links_without_inertia,
    moving_mass,
    text_of,
    without_root_joint,
    without_shapes,
)
from harness.engines.request import Refused, Request
from harness.engines.state_by_state import StateByState
from harness.files.findings import EFFORT, EQUALITIES, FRICTION, LIMITS

# pybullet.URDF_USE_INERTIA_FROM_FILE.
_INERTIAS_OF_FILE = 2
# pybullet.URDF_USE_SELF_COLLISION and URDF_USE_SELF_COLLISION_INCLUDE_PARENT: the ground may be a link of the file.
_LINKS_TOUCH = 8 | 8192
_GRAVITY = (0.0, 0.0, -9.81)
_NOTHING = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'


class PybulletModel(StateByState):
    """A body in a physics server of its own, which ends with it."""

    def __init__(self, loaded: tuple[int, int], notes: tuple[str, ...], request: Request) -> None:
        import pybullet

        self._server, self._body = loaded
        self.notes = notes
        weakref.finalize(self, pybullet.disconnect, self._server)
        infos = [self._ask("getJointInfo", self._body, index) for index in range(self._ask("getNumJoints", self._body))]
        moving = sorted((info for info in infos if info[2] != pybullet.JOINT_FIXED), key=lambda info: int(info[4]))
        super().__init__(request, {info[1].decode(): place for place, info in enumerate(moving)}, len(moving))
        self._indices, self._links = [info[0] for info in moving], {info[12].decode(): info[0] for info in infos}
        self._q, self._v = [0.0] * self.width, [0.0] * self.width
        self._gravity = request.gravity

    def _ask(self, function: str, *arguments: Any, **further: Any) -> Any:
        """The answer of a function of PyBullet in the server of the body."""
        import pybullet

        return getattr(pybullet, function)(*arguments, **further, physicsClientId=self._server)

    def loaded(self) -> LoadedModel:
        masses = {link: float(self._ask("getDynamicsInfo", self._body, index)[0]) for link, index in self._links.items()}
        return LoadedModel(self.sizes, self._gravity, moving_mass(self.request, masses))

    def _go_to(self, q: Array, v: Array) -> None:
        positions = np.zeros(self.width)
        for name in self.columns.sizes:
            positions[self.places[name]] = q[self.columns.spans(name)[0]][0]
        self._q, self._v = positions.tolist(), v.tolist()
        if self.aid.springs:
            for index, position in zip(self._indices, self._q, strict=True):
                self._ask("resetJointState", self._body, index, position)

    def _mass_matrix(self) -> Array:
        return np.array(self._ask("calculateMassMatrix", self._body, self._q))

    def _bias(self) -> Array:
        return self._inverse_dynamics(self._v, self._gravity)

    def _parts_of_bias(self) -> tuple[Array, Array, Array]:
        velocity = self._inverse_dynamics(self._v, (0.0, 0.0, 0.0))
        return velocity, self._inverse_dynamics([0.0] * self.width, self._gravity), np.zeros(self.width)

    def _inverse_dynamics(self, velocities: list[float], gravity: tuple[float, ...]) -> Array:
        self._ask("setGravity", *gravity)
        return np.array(self._ask("calculateInverseDynamics", self._body, self._q, velocities, [0.0] * self.width))

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        index, still = self._links[body], [0.0] * self.width
        state = self._ask("getLinkState", self._body, index, computeForwardKinematics=True)
        jacobians = self._ask("calculateJacobian", self._body, index, [0.0] * 3, self._q, still, still)
        # It gives the pose of the centre of mass in double precision, that of the link itself in single.
        turn = _turn(state[1]) @ _turn(state[3]).T
        return turn, np.array(state[0]) - turn @ np.array(state[2]), np.vstack([np.array(one) for one in jacobians])

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """See ``harness.hard.worst_cases``; what the harness supplies is part of tau, and of M."""
        added = self.take(q, v) + self.supplied(q[None], v[None])[0]
        forces, expected, armature = (values @ self.turn for values in (tau + added, certified, self.armature))
        mass = "np.array(p.calculateMassMatrix(b, q))" + (f" + np.diag({armature.tolist()})" if armature.any() else "")
        remark = "  # springs and dampers, which inverse dynamics do not know, are in tau" if added.any() else ""
        return (
            f"import numpy as np, pybullet as p, tempfile; f = tempfile.NamedTemporaryFile('w', suffix='.urdf'); "
            f"f.write({source}); f.flush(); p.connect(p.DIRECT); "
            "b = p.loadURDF(f.name, useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE); "
            f"p.setGravity(*{list(self._gravity)})\n"
            f"q, v, tau = {self._q}, {self._v}, {forces.tolist()}{remark}\n"
            f"print(np.linalg.solve({mass}, np.array(tau) - p.calculateInverseDynamics(b, q, v, [0.0] * len(q))).tolist(), "
            f"{expected.tolist()}, sep='\\n')  # engine, certified\n"
        )


def _turn(quaternion: Any) -> Array:
    x, y, z, w = quaternion
    return rotation(np.array([w, x, y, z]))


class PybulletEngine(Engine):
    title = "PyBullet"
    requires = ("pybullet", "pybullet")
    formats = ("urdf",)
    optional = True
    factorises_mass_matrix = True
    supplied: Mapping[str, str] = {
        "urdf": (
            "dampers, springs and rotor inertias of joints, and springs between points, are supplied from the file, "
            "and each link has the inertia that stands there"
        )
    }
    beside_tau: Mapping[str, str] = {
        EFFORT: "PyBullet tells both, and applies neither (PyBullet Quickstart Guide, getJointInfo: jointMaxForce, jointMaxVelocity)"
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "its mass matrix and inverse dynamics hold no joints together",
        FRICTION: "its mass matrix and inverse dynamics have no dry friction",
        LIMITS: "its mass matrix and inverse dynamics have no joint limits",
    }
    why_no_constraints = "PyBullet reads no constraints and couples no joints"
    call: Mapping[str, str] = {
        "urdf": (
            "b = p.loadURDF(PATH, useFixedBase=True); p.setGravity(0, 0, -9.81); p.calculateMassMatrix(b, q); "
            "p.calculateInverseDynamics(b, q, v, [0] * len(q))"
        )
    }

    def read(self, request: Request) -> PybulletModel:
        if request.text is not None:
            _, root = without_root_joint(request, "PyBullet")
            if root:
                line = next(joint.line for joint in request.joints if joint.name == root)
                raise Unsupported(f"line {line}: joint {root!r} is free or a ball joint, for which its inverse dynamics have no place in q")
        refuse_joints(request, "PyBullet", ())
        if request.aid is None:
            elements = elements_of(request)
            meshes = len(elements.findall("link/collision/geometry/mesh"))
            several = "es" if meshes > 1 else ""
            note = f"read without {meshes} mesh{several} of collision: the boxes around them stand in no file"
            read = _read(0, text_of(without_shapes(elements, meshes_alone=True)))
            return PybulletModel(read, (note,) if meshes else (), request)
        return PybulletModel(_read(_INERTIAS_OF_FILE, _with_inertias(request)), (), request)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand."""
        return moved_as_they_stand(self.title, request, _moved)


def _moved(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, joints) each, after the recorded steps of one motion."""
    import pybullet

    server, body = _read(_INERTIAS_OF_FILE | _LINKS_TOUCH, motion.file.path.read_text(encoding="utf-8"))
    try:
        known = {}
        for index in range(pybullet.getNumJoints(body, physicsClientId=server)):
            known[pybullet.getJointInfo(body, index, physicsClientId=server)[1].decode()] = index
        if lacking := [name for name in request.joints if name not in known]:
            raise Refused(f"it has no joint {lacking[0]!r}")
        joints = [known[name] for name in request.joints]
        for index in range(-1, len(known)):
            pybullet.changeDynamics(body, index, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=server)
        pybullet.setJointMotorControlArray(
            body, [*known.values()], pybullet.VELOCITY_CONTROL, forces=[0.0] * len(known), physicsClientId=server
        )
        pybullet.setGravity(*_GRAVITY, physicsClientId=server)
        pybullet.setTimeStep(motion.file.length, physicsClientId=server)
        for index, q, v in zip(joints, request.q.tolist(), request.v.tolist(), strict=True):
            pybullet.resetJointState(body, index, q, v, physicsClientId=server)
        states, done = [], 0
        for until in motion.counts:
            for _ in range(done, until):
                pybullet.stepSimulation(physicsClientId=server)
            done = until
            states.append([one[:2] for one in pybullet.getJointStates(body, joints, physicsClientId=server)])
    finally:
        pybullet.disconnect(server)
    found = np.array(states)
    return found[:, :, 0], found[:, :, 1]


def _read(flags: int, content: str) -> tuple[int, int]:
    """A body in a physics server of its own, and that server before it."""
    # The reasons go to standard output and error alone; it keeps files by their names.
    with captured_output() as captured, tempfile.NamedTemporaryFile(suffix=".urdf") as file:
        file.write(content.encode())
        file.flush()
        import pybullet

        server = pybullet.connect(pybullet.DIRECT)
        try:
            return server, pybullet.loadURDF(file.name, useFixedBase=True, flags=flags, physicsClientId=server)
        except pybullet.error as error:
            pybullet.disconnect(server)
            raise Refused(" ".join((captured() or str(error)).split())) from error


def _with_inertias(request: Request) -> str:
    """The text with an inertia of nothing where a link has none, for which PyBullet has one of its own, and without shapes."""
    root = without_shapes(elements_of(request))
    for link in links_without_inertia(root):
        link.append(etree.fromstring(_NOTHING))
    return text_of(root)


ENGINE = PybulletEngine()
