"""What MuJoCo computes beside accelerations; ``harness.engines.interface`` says what each is.

Source: MuJoCo documentation, API reference.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from harness.arrays import Array
from harness.engines.adapters.mujoco import versions
from harness.engines.interface import NotOffered


class MujocoQuantities:
    """The methods of an ``MjModel`` whose joints have places in q and v."""

    model: Any
    _joints: Sequence[Sequence[Any]]

    @property
    @abstractmethod
    def addresses(self) -> tuple[list[int], list[int]]:
        """Places of the joints in the engine's own q and v."""

    def mass_matrix(self, q: Array) -> Array:
        """``mj_fullM``."""
        velocities = self.addresses[1]
        found = np.empty((len(q), self.model.nv, self.model.nv))
        for state, data in enumerate(self._placed(q)):
            versions.fill_mass_matrix(self.model, data, found[state])
        return np.ascontiguousarray(found[:, velocities][:, :, velocities])

    def bias(self, q: Array, v: Array) -> Array:
        """``qfrc_bias``."""
        return np.array([data.qfrc_bias[self.addresses[1]] for data in self._placed(q, v)])

    def gravity(self, q: Array) -> Array:
        """``qfrc_bias`` at rest."""
        return self.bias(q, np.zeros((len(q), len(self.addresses[1]))))

    def inverse_dynamics(self, q: Array, v: Array, qdd: Array) -> Array:
        """``mj_inverse``."""
        velocities, found = self.addresses[1], np.empty_like(v)
        for state, data in enumerate(self._placed(q, v)):
            data.qacc[velocities] = qdd[state]
            mujoco.mj_inverse(self.model, data)
            found[state] = data.qfrc_inverse[velocities]
        return found

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """``mjd_transitionFD`` are differences of a step."""
        raise NotOffered("MuJoCo has finite differences of a step alone, mjd_transitionFD, which harness bench measures")

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """``mjd_inverseFD`` are differences."""
        raise NotOffered("MuJoCo has finite differences of it alone, mjd_inverseFD, which harness bench measures")

    def energies(self, q: Array, v: Array) -> Array:
        """``mj_energyVel`` and ``mj_energyPos``."""
        found = np.empty((len(q), 2))
        for state, data in enumerate(self._placed(q, v)):
            mujoco.mj_energyPos(self.model, data)
            mujoco.mj_energyVel(self.model, data)
            found[state] = data.energy[::-1]
        return found

    def momenta(self, q: Array, v: Array) -> Array:
        """``mj_subtreeVel`` of the world, whose centre of mass includes that of bodies which stand still."""
        model, found = self.model, np.empty((len(q), 9))
        moving = model.body_weldid != 0
        masses = np.where(moving, model.body_mass, 0.0)
        stands_still = bool((model.body_mass[~moving] > 0).any())
        for state, data in enumerate(self._placed(q, v)):
            mujoco.mj_subtreeVel(model, data)
            momentum = model.body_subtreemass[0] * data.subtree_linvel[0]
            about_origin = data.subtree_angmom[0] + np.cross(data.subtree_com[0], momentum)
            about_centre = data.subtree_angmom[0]
            if stands_still:
                about_centre = about_origin - np.cross(masses @ data.xipos / masses.sum(), momentum)
            found[state] = *momentum, *about_origin, *about_centre
        return found

    def positions(self, q: Array) -> Array:
        """``xpos`` and ``xmat``."""
        bodies = self._bodies
        found = np.empty((len(q), len(bodies), 12))
        for state, data in enumerate(self._placed(q)):
            found[state, :, :3], found[state, :, 3:] = self.anchors(data), data.xmat[bodies]
        return found

    def velocities(self, q: Array, v: Array) -> Array:
        """``mj_objectVelocity``, moved from the origin of the body to the anchor."""
        bodies, found, velocity = self._bodies, np.empty((len(q), len(self._bodies), 6)), np.empty(6)
        for state, data in enumerate(self._placed(q, v)):
            for place, (body, anchor) in enumerate(zip(bodies, self.anchors(data), strict=True)):
                mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
                spin, linear = velocity[:3], velocity[3:]
                found[state, place, :3], found[state, place, 3:] = linear + np.cross(spin, anchor - data.xpos[body]), spin
        return found

    def jacobians(self, q: Array) -> Array:
        """``mj_jac``."""
        model, velocities = self.model, self.addresses[1]
        found, linear, angular = np.empty((len(q), len(self._bodies), 6, len(velocities))), *np.empty((2, 3, model.nv))
        for state, data in enumerate(self._placed(q)):
            for place, (body, anchor) in enumerate(zip(self._bodies, self.anchors(data), strict=True)):
                mujoco.mj_jac(model, data, linear, angular, anchor, body)
                found[state, place] = np.concatenate([linear, angular])[:, velocities]
        return found

    def anchors(self, data: Any) -> Array:
        """Of each joint the anchor of the last joint of its body, (joints, 3); that of a slide in ``xanchor`` is where it stood before."""
        bodies, model = self._bodies, self.model
        last = model.body_jntadr[bodies] + model.body_jntnum[bodies] - 1
        arms = np.einsum("bij,bj->bi", data.xmat[bodies].reshape(-1, 3, 3), model.jnt_pos[last])
        return np.asarray(data.xpos[bodies] + arms)

    @cached_property
    def _bodies(self) -> Any:
        """The body of each joint."""
        return np.array([self.model.joint(parts[0]).bodyid[0] for parts in self._joints])

    def _placed(self, q: Array, v: Array | None = None, tau: Array | None = None) -> Iterator[Any]:
        """The same ``MjData`` after ``mj_forward`` at each state."""
        data, (positions, velocities) = mujoco.MjData(self.model), self.addresses
        for state in range(len(q)):
            data.qpos[positions], data.qvel[velocities] = q[state], 0.0 if v is None else v[state]
            if tau is not None:
                data.qfrc_applied[velocities] = tau[state]
            mujoco.mj_forward(self.model, data)
            yield data
