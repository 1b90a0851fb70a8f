"""Joints of a URDF that mimic others in Pinocchio, whose forward dynamics all refuse such a model.

Its ``crba`` and ``rnea`` accept it, so that M and the bias are the engine's, of the joints that move by themselves; what is left is
one solve. Forces on a follower reach its leader through the engine's own ratio.

Source: Pinocchio 4.1, JointModelMimic; Featherstone, Rigid Body Dynamics Algorithms, section 3.2 (explicit constraints).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.adapters.pinocchio.versions import read_mimics
from harness.engines.reading import captured_standard_error
from harness.files.model_file import ModelFile

Columns = tuple[Array, Array, Array]


class MimicJoints:
    """The coupled model of a file beside ``tree``, the same with each follower as a joint of its own; ``root`` as the reader takes it.

    Raises:
        Unsupported: the reader refuses it, as where a follower is in another branch, and before its leader by name.
    """

    def __init__(self, tree: Any, file: ModelFile, root: Sequence[Any]) -> None:

        self._tree, self._tree_data = tree, tree.createData()
        with captured_standard_error() as captured:
            try:
                self.model = model = read_mimics(file.text, *root)
            except Unsupported:
                raise
            except Exception as error:
                # It takes joints by name, children and all, and wants a leader to come first.
                raise Unsupported(f"Pinocchio's reader of joints that mimic: {' '.join((captured() or str(error)).split())}") from error
        self._data = model.createData()
        model.gravity.linear = tree.gravity.linear
        # Velocities of the tree by those of the coupled model, and the tree's positions that the coupled model has.
        self.ratios = np.zeros((tree.nv, model.nv))
        self.positions, self.velocities = np.zeros(model.nq, dtype=int), np.zeros(model.nv, dtype=int)
        # Follower to its place in q, that of its leader, ratio and offset.
        self._followers: dict[str, tuple[int, int, float, float]] = {}
        for name in list(tree.names)[1:]:
            own, coupled = tree.joints[tree.getJointId(name)], model.joints[model.getJointId(name)]
            if coupled.shortname() == "JointModelMimic":
                mimic = coupled.extract()
                leader = tree.joints[tree.getJointId(model.names[self._leader(name)])]
                self.ratios[own.idx_v, coupled.idx_v] = mimic.scaling
                self._followers[name] = own.idx_q, leader.idx_q, float(mimic.scaling), float(mimic.offset)
                continue
            self.positions[coupled.idx_q : coupled.idx_q + own.nq] = range(own.idx_q, own.idx_q + own.nq)
            self.velocities[coupled.idx_v : coupled.idx_v + own.nv] = range(own.idx_v, own.idx_v + own.nv)
            self.ratios[own.idx_v : own.idx_v + own.nv, coupled.idx_v : coupled.idx_v + own.nv] = np.eye(own.nv)
        model.armature = tree.armature[self.velocities]

    def _leader(self, follower: str) -> int:
        place = list(self.model.mimicking_joints).index(self.model.getJointId(follower))
        return int(self.model.mimicked_joints[place])

    def accelerations(self, columns: Columns) -> Array:
        """(n, nv) accelerations of the tree at ``PinocchioModel.columns`` with all forces added."""
        import pinocchio

        configuration, velocity, force = columns
        found = np.empty((configuration.shape[1], self._tree.nv))
        still = np.zeros(self.model.nv)
        for state, (q, v, tau) in enumerate(zip(configuration.T, velocity.T, force.T, strict=True)):
            q, v = q[self.positions], v[self.velocities]
            upper = np.triu(pinocchio.crba(self.model, self._data, q))
            mass = upper + np.triu(upper, 1).T
            found[state] = self.ratios @ np.linalg.solve(mass, self.ratios.T @ tau - pinocchio.rnea(self.model, self._data, q, v, still))
        return found

    def with_forces_on_bodies(self, inputs: tuple[Array, ...]) -> tuple[Array, list[Any]]:
        """Accelerations of the tree, (nv,), at one q, v and tau, and no forces: couplings act through the joints."""
        import pinocchio

        [accelerations] = self.accelerations((inputs[0][:, None], inputs[1][:, None], inputs[2][:, None]))
        return accelerations, [pinocchio.Force.Zero() for _ in range(self._tree.njoints)]

    def generalised_forces(self, columns: Columns) -> Array:
        """What the couplings exert on the joints of the tree, (n, nv) [N or N m]: its inverse dynamics without the forces given."""
        import pinocchio

        moved = zip(*(each.T for each in columns), self.accelerations(columns), strict=True)
        return np.array([pinocchio.rnea(self._tree, self._tree_data, q, v, a) - tau for q, v, tau, a in moved])

    def gaps(self, configuration: Array) -> dict[str, Array]:
        """Follower's position beyond what its leader says, (n, 1) [m or rad], by the follower's name."""
        return {
            name: (configuration[own] - ratio * configuration[leader] - offset)[:, None]
            for name, (own, leader, ratio, offset) in self._followers.items()
        }

    def reproducer(self, source: str) -> tuple[str, str]:
        """Python text that makes the coupled model of the tree ``m``, and that evaluates the tree's accelerations at q, v and tau."""
        made = (
            f"r = pin.buildModelFromXML({source}, mimic=True); r.gravity.linear = m.gravity.linear\n"
            f"r.armature = m.armature[{self.velocities.tolist()}]; G = np.array({self.ratios.tolist()})\n"
            f"a, b = q[{self.positions.tolist()}], v[{self.velocities.tolist()}]\n"
            "M = np.triu(pin.crba(r, r.createData(), a)); M = M + np.triu(M, 1).T\n"
        )
        return made, "(G @ np.linalg.solve(M, G.T @ tau - pin.rnea(r, r.createData(), a, b, 0 * b)))"
