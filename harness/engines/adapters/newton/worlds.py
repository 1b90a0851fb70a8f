"""A file in equal worlds of Newton: steps of ``SolverFeatherstone`` in blocks of states.

Newton's generalised coordinates are its own: a rotation stands in q as (x, y, z, w); a ball joint turns about the axes of its parent's
frame; a free joint moves by the velocity of its body's centre of mass and turns about the axes of the world, and its applied force acts
in that centre. The accelerations that a step finds of a free joint are of the point of the body that is in the world's origin.

Source: Newton documentation, Conventions; ``newton/_src/solvers/featherstone/kernels.py``.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Mapping
from typing import Any

import newton
import numpy as np
import warp

from harness.arrays import Array
from harness.engines.adapters.newton.importing import Joined, armature_of, read_by, sanitized, starts_of
from harness.engines.adapters.newton.quantities import BLOCK, NewtonQuantities, filled
from harness.engines.coordinates import BALL, FREE, cross_matrix, multiplied, rotation, rotations
from harness.engines.interface import LoadedModel
from harness.engines.request import AskedJoint, Request
from harness.engines.state_by_state import pull_of
from harness.files.tree import WORLD

_INVERSE = np.array([1.0, -1.0, -1.0, -1.0])
# Length of a step [s], on which no acceleration depends.
_STEP = 1e-3


class NewtonFile(NewtonQuantities):
    """A model of ``BLOCK`` equal worlds, with its solver.

    Attributes:
        starts: the first position and the first velocity of each joint found, in its world.
    """

    def __init__(self, request: Request, robot: Any, joined: Joined) -> None:
        starts = starts_of(robot, joined)
        super().__init__(request, starts)
        self.applies_springs, self.applies_dampers = request.format == "mjcf", request.format != "usd"
        self.starts = starts
        self._links = {label.rpartition("/")[2]: number for number, label in enumerate(robot.body_label)}
        scene = newton.ModelBuilder()
        scene.replicate(robot, BLOCK)
        with warp.ScopedDevice("cpu"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._model = scene.finalize(skip_validation_inertia=request.aid is not None)
            if request.aid is not None:
                # Its importer passes over that of a file, docs/issues/newton-mjcf-gravity.md.
                self._model.set_gravity(request.aid.gravity)
                if request.format != "mjcf":
                    self._model.joint_armature.assign(np.tile(armature_of(request, robot, starts), BLOCK))
                if not self.applies_dampers:
                    self._model.joint_damping.zero_()
            for gains in ("joint_limit_ke", "joint_limit_kd", "joint_target_ke", "joint_target_kd"):
                getattr(self._model, gains).zero_()
            self._solver = newton.solvers.SolverFeatherstone(self._model)
            self._state, self._next, self._control = self._model.state(), self._model.state(), self._model.control()
        self._nq, self._nv = self._model.joint_coord_count // BLOCK, self._model.joint_dof_count // BLOCK
        children = self._model.joint_child.numpy()
        self._centres = self._model.body_com.numpy().astype(float)
        self._carried = {joint.name: children[number] for number, those in joined.items() for joint in those}
        # The quaternion of the frame of each joint in its body, of a stage: of an MJCF and a URDF it is that of the body.
        frames = np.array(robot.joint_X_c)[:, [6, 3, 4, 5]] if request.format == "usd" else ()
        self._frames = {joint.name: frames[number] for number, those in joined.items() for joint in those if len(frames)}
        self._rows = _rows_of_jacobians(self._model)
        self._references = _references(self._model, self.starts, request)

    def loaded(self) -> LoadedModel:
        model = self._model
        joints, bodies = model.joint_count // BLOCK, model.body_count // BLOCK
        parents, children = (one.numpy()[:joints].tolist() for one in (model.joint_parent, model.joint_child))
        counts = np.diff(model.joint_qd_start.numpy()[: joints + 1])
        moved: set[int] = set()
        for parent, child, count in zip(parents, children, counts, strict=True):
            if count or parent in moved:
                moved.add(child)
        masses = model.body_mass.numpy()[:bodies].astype(float)
        sizes = {joint.name: joint.kind.sizes for joint in self.found}
        return LoadedModel(sizes, tuple(model.gravity.numpy()[0].tolist()), float(sum(masses[body] for body in moved)))

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        tau = tau + self.supplied(q, v)
        answers = [self._of_block(*(one[start : start + BLOCK] for one in (q, v, tau))) for start in range(0, len(q), BLOCK)]
        found = np.concatenate([np.empty((0, len(self.v_columns))), *answers])
        return found if self.couplings is None else found[:, self._of_leaders]

    @property
    def _of_leaders(self) -> list[int]:
        """Columns of what moves by itself among those of the joints found."""
        ends = np.cumsum([0, *(len(joint.velocities) for joint in self.found)])
        places = {joint.name: range(*bounds) for joint, *bounds in zip(self.found, ends[:-1], ends[1:], strict=True)}
        return [column for joint in self.joints for column in places[joint.name]]

    def _of_block(self, q: Array, v: Array, tau: Array) -> Array:
        """Accelerations of the joints found, (n, their velocities), at n states of at most ``BLOCK``."""
        positions, velocities, forces = self._own(q, v, tau)
        with warp.ScopedDevice("cpu"):
            self._state.joint_q.assign(filled(positions))
            self._state.joint_qd.assign(filled(velocities))
            if self.aid.springs:
                forces = forces + self._pulls(velocities)
            self._control.joint_f.assign(filled(forces))
            self._solver.step(self._state, self._next, self._control, None, _STEP)
            found = self._solver.joint_qdd.numpy().reshape(BLOCK, -1)[: len(q)].astype(float)
        return np.hstack([np.empty((len(q), 0)), *(self._in_file(joint, positions, velocities, found) for joint in self.found)])

    def _own(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """Positions (n, nq), velocities and applied forces (n, nv) in Newton's coordinates."""
        positions, velocities, forces = np.zeros((len(q), self._nq)), *np.zeros((2, len(q), self._nv))
        for joint in self.found:
            (at, start), (nq, nv) = self.starts[joint.name], joint.kind.sizes
            own_q, own_v, own_tau = q[:, list(joint.positions)], v[:, list(joint.velocities)], tau[:, list(joint.velocities)]
            own_q = own_q - self._references.get(joint.name, 0.0)
            if nq > nv:
                turn, quaternions = rotations(own_q[:, -4:]), own_q[:, -4:]
                if nv == BALL[1] and joint.name in self._frames:
                    frame = self._frames[joint.name]
                    turn, quaternions = rotation(frame).T @ turn, multiplied(multiplied(frame * _INVERSE, quaternions), frame)
                own_q = np.hstack([own_q[:, :-4], quaternions[:, 1:], quaternions[:, :1]])
                turning, moment = (np.einsum("nij,nj->ni", turn, one[:, -3:]) for one in (own_v, own_tau))
                linear, force = own_v[:, :-3], own_tau[:, :-3]
                if nv == FREE[1]:
                    arm = turn @ self._centres[self._carried[joint.name]]
                    linear, moment = linear + np.cross(turning, arm), moment - np.cross(arm, force)
                own_v, own_tau = np.hstack([linear, turning]), np.hstack([force, moment])
            positions[:, at : at + nq], velocities[:, start : start + nv], forces[:, start : start + nv] = own_q, own_v, own_tau
        return positions, velocities, forces

    def _drift(self, positions: Array, velocities: Array) -> Array:
        found = np.zeros_like(velocities)
        for joint in (joint for joint in self.found if joint.kind.sizes == FREE):
            at, start = self.starts[joint.name]
            turn, turning = rotations(positions[:, at : at + 7][:, [-1, -4, -3, -2]]), velocities[:, start + 3 : start + 6]
            found[:, start : start + 3] = np.cross(turning, np.cross(turning, turn @ self._centres[self._carried[joint.name]]))
        return found

    def _in_file(self, joint: AskedJoint, positions: Array, velocities: Array, found: Array) -> Array:
        """(n, velocities of a joint) accelerations as the request has them."""
        (at, start), (nq, nv) = self.starts[joint.name], joint.kind.sizes
        own: Array = found[:, start : start + nv]
        if nq == nv:
            return own
        quaternions = positions[:, at : at + nq][:, [-1, -4, -3, -2]]
        back = rotations(quaternions).transpose(0, 2, 1)
        angular = own[:, -3:]
        turned: Array = np.einsum("nij,nj->ni", back, angular)
        if nv == BALL[1]:
            return turned @ rotation(self._frames[joint.name]).T if joint.name in self._frames else turned
        place, turning = positions[:, at : at + 3], velocities[:, start + 3 : start + 6]
        arm = np.einsum("nji,j->ni", back, self._centres[self._carried[joint.name]])
        speed = velocities[:, start : start + 3] - np.cross(turning, arm)
        return np.hstack([own[:, :3] + np.cross(angular, place) + np.cross(turning, speed), turned])

    def _pulls(self, velocities: Array) -> Array:
        """(n, nv) forces of springs between points, from Newton's own frames and Jacobians at the states that it is given."""
        newton.eval_fk(self._model, self._state.joint_q, self._state.joint_qd, self._state)
        frames = self._state.body_q.numpy().reshape(BLOCK, -1, 7).astype(float)
        jacobians = newton.eval_jacobian(self._model, self._state).numpy().astype(float)
        trees = self._model.articulation_count // BLOCK
        forces = np.zeros_like(velocities)
        for state, own in enumerate(velocities):

            def point_of(body: str, local: Array, state: int = state) -> tuple[Array, Array]:
                if body == WORLD:
                    return local, np.zeros((3, self._nv))
                number = self._links[sanitized(body, self.request.format)]
                frame = frames[state, number]
                turn = rotation(frame[[6, 3, 4, 5]])
                tree, row, columns = self._rows[number]
                found = np.zeros((6, self._nv))
                found[:, columns] = jacobians[state * trees + tree, row : row + 6, : len(columns)]
                linear, angular = found[:3], found[3:]
                arm = turn @ (local - self._centres[number])
                return frame[:3] + turn @ local, linear - cross_matrix(arm) @ angular

            for spring in self.aid.springs:
                pull = pull_of(spring, point_of, own)
                forces[state] -= pull.tension * pull.gradient
        return forces


def _rows_of_jacobians(model: Any) -> dict[int, tuple[int, int, range]]:
    """The articulation of each body of the first world, its first row in the Jacobian of that, and the velocities of its columns."""
    starts, velocities, children = (one.numpy().tolist() for one in (model.articulation_start, model.joint_qd_start, model.joint_child))
    found: dict[int, tuple[int, int, range]] = {}
    for tree, (first, end) in enumerate(itertools.pairwise(starts[: model.articulation_count // BLOCK + 1])):
        columns = range(velocities[first], velocities[end])
        found |= {children[joint]: (tree, 6 * (joint - first), columns) for joint in range(first, end)}
    return found


def _references(model: Any, starts: Mapping[str, tuple[int, int]], request: Request) -> dict[str, float]:
    """The position of each joint of an MJCF where Newton has it at zero: its coordinates are those of the file less ``ref``."""
    given = getattr(getattr(model, "mujoco", None), "dof_ref", None)
    if request.format != "mjcf" or given is None:
        return {}
    values = given.numpy().astype(float)
    return {joint.name: values[starts[joint.name][1]] for joint in request.joints if joint.name in starts and joint.kind.is_single}


def read(request: Request) -> NewtonFile:
    """See ``harness.engines.Engine.read``."""
    return read_by(request, newton.ModelBuilder, NewtonFile)
