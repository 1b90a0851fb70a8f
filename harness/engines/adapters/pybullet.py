"""PyBullet on a URDF: its mass matrix and its inverse dynamics at no acceleration.

Its own forward dynamics are those of a time step, with dampers treated implicitly and with contacts. What it stores of
``<dynamics damping>`` is none of inverse dynamics; the harness supplies it, as springs and rotors, which its reader does not know. The
inertias are those of the file by ``URDF_USE_INERTIA_FROM_FILE``; without that flag they are made of collision shapes.

Source: PyBullet Quickstart Guide, ``loadURDF``, ``calculateMassMatrix``, ``calculateInverseDynamics``, ``calculateJacobian``.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import LoadedModel, Unsupported, require_model
from harness.engines.mass_and_bias import MassAndBias, moving_mass, take_root_off
from harness.engines.output import captured_standard_error
from harness.engines.rotations import Columns, rotation
from harness.models.model_file import ModelFile

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism


class PybulletModel(MassAndBias):
    """A body in a physics server of its own, which ends with the model."""

    def __init__(self, server: int, body: int, file: ModelFile, joints: Sequence[str], gravity: float) -> None:
        import pybullet

        weakref.finalize(self, pybullet.disconnect, server)
        self._server, self._body, self._file = server, body, file
        self._gravity = 0.0, 0.0, -gravity
        infos = [pybullet.getJointInfo(body, index, physicsClientId=server) for index in range(self._count())]
        moving = sorted((info for info in infos if info[2] != pybullet.JOINT_FIXED), key=lambda info: int(info[4]))
        self._indices = [info[0] for info in moving]
        self._places = {info[1].decode(): place for place, info in enumerate(moving)}
        self._links = {info[12].decode(): info[0] for info in infos}
        super().__init__(file, Columns(joints, dict.fromkeys(joints, (1, 1))))
        self._order = [self._places[name] for name in self.columns.sizes if name in self._places]
        self._own: tuple[list[float], list[float]] = [], []

    def _count(self) -> int:
        import pybullet

        return int(pybullet.getNumJoints(self._body, physicsClientId=self._server))

    def loaded(self) -> LoadedModel:
        import pybullet

        masses = {
            link: float(pybullet.getDynamicsInfo(self._body, index, physicsClientId=self._server)[0]) for link, index in self._links.items()
        }
        return LoadedModel(dict.fromkeys(self._places, (1, 1)), self._gravity, moving_mass(self._file, None, masses))

    def _go_to(self, q: Array, v: Array) -> None:
        import pybullet

        positions, velocities = np.zeros((2, len(self._places)))
        positions[self._order], velocities[self._order] = q, v
        self._own = positions.tolist(), velocities.tolist()
        if not self.supplied.empty:
            for index, position in zip(self._indices, self._own[0], strict=True):
                pybullet.resetJointState(self._body, index, position, physicsClientId=self._server)

    def _mass(self) -> Array:
        import pybullet

        own = np.array(pybullet.calculateMassMatrix(self._body, self._own[0], physicsClientId=self._server))
        return own[np.ix_(self._order, self._order)]

    def _bias(self) -> Array:
        return self._inverse_dynamics(self._own[1], self._gravity)

    def _parts_of_bias(self) -> tuple[Array, Array]:
        return self._inverse_dynamics(self._own[1], (0.0, 0.0, 0.0)), self._inverse_dynamics([0.0] * len(self._places), self._gravity)

    def _inverse_dynamics(self, velocities: list[float], gravity: tuple[float, float, float]) -> Array:
        import pybullet

        pybullet.setGravity(*gravity, physicsClientId=self._server)
        still = [0.0] * len(self._places)
        forces = pybullet.calculateInverseDynamics(self._body, self._own[0], velocities, still, physicsClientId=self._server)
        return np.array(forces)[self._order]

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        import pybullet

        index, still = self._links[body], [0.0] * len(self._places)
        state = pybullet.getLinkState(self._body, index, computeForwardKinematics=True, physicsClientId=self._server)
        jacobians = pybullet.calculateJacobian(self._body, index, [0.0] * 3, self._own[0], still, still, physicsClientId=self._server)
        # It gives the pose of the centre of mass in double precision, that of the link itself in single.
        turn = _turn(state[1]) @ _turn(state[3]).T
        return turn, np.array(state[0]) - turn @ np.array(state[2]), np.vstack([np.array(one)[:, self._order] for one in jacobians])

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """See ``harness.hard.reproducer``; what the harness supplies is part of tau, and of M."""
        self._go_to(q, v)
        added = self._passive(q, v)
        forces, expected, armature = np.zeros((3, len(self._places)))
        forces[self._order], expected[self._order], armature[self._order] = tau + added, certified, self.supplied.armature
        mass = "np.array(p.calculateMassMatrix(b, q))" + (f" + np.diag({armature.tolist()})" if armature.any() else "")
        remark = "  # springs and dampers, which inverse dynamics do not know, are in tau" if added.any() else ""
        return (
            f"import numpy as np, pybullet as p, tempfile; f = tempfile.NamedTemporaryFile('w', suffix='.urdf'); "
            f"f.write({source}); f.flush(); p.connect(p.DIRECT); "
            "b = p.loadURDF(f.name, useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE); "
            f"p.setGravity(*{list(self._gravity)})\n"
            f"q, v, tau = {self._own[0]}, {self._own[1]}, {forces.tolist()}{remark}\n"
            f"print(np.linalg.solve({mass}, np.array(tau) - p.calculateInverseDynamics(b, q, v, [0.0] * len(q))).tolist(), "
            f"{expected.tolist()}, sep='\\n')  # engine, certified\n"
        )


def _turn(quaternion: Any) -> Array:
    x, y, z, w = quaternion
    return rotation(np.array([w, x, y, z]))


class PybulletEngine:
    requires = ("pybullet", "pybullet")
    formats = ("urdf",)
    optional = True
    factorises_mass_matrix = True

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> PybulletModel:
        import pybullet

        file = require_model(source, "pybullet")
        text, root = take_root_off(file, "PyBullet")
        if root is not None:
            line = file.joint_lines[root]
            raise Unsupported(f"line {line}: joint {root!r} is free or a ball joint, for which its inverse dynamics have no place in q")
        server = pybullet.connect(pybullet.DIRECT)
        with tempfile.TemporaryDirectory() as folder, captured_standard_error() as captured:
            path = Path(folder) / "model.urdf"
            path.write_text(text, encoding="utf-8")
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_IGNORE_VISUAL_SHAPES | pybullet.URDF_IGNORE_COLLISION_SHAPES
            try:
                body = pybullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=server)
            except pybullet.error as error:
                pybullet.disconnect(server)
                raise ValueError(captured() or str(error)) from error
        return PybulletModel(server, body, file, joints, gravity)


ENGINE = PybulletEngine()
