"""MuJoCo Warp, ``mujoco_warp``, on an MJCF model: ``mujoco_warp.forward`` on many worlds at once, in float32.

Its kernels are compiled at the first question of a cache, which takes minutes on a CPU, and kept there. It is asked about mechanisms, and
how far their contacts are from rigid ones: no user's file is judged in float32.

Source: MuJoCo documentation, MuJoCo Warp (MJWarp), with its list of what is not implemented.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from harness.engines import Engine
from harness.engines.moving import MotionsRequest, Moved, moved_as_they_stand
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines.adapters.mujoco_warp.device import WarpModel


class MujocoWarpEngine(Engine):
    title = "MuJoCo Warp"
    requires = ("mujoco_warp", "mujoco-warp")
    formats = ("mjcf",)
    optional = True
    factorises_mass_matrix = True
    has_soft_constraints = True
    reader = "mujoco"
    inertias_about = "tree"
    unit_roundoff = 2.0**-24

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> WarpModel:
        from harness.engines.adapters.mujoco_warp.device import load

        return load(file, joints)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand."""
        from harness.engines.adapters.mujoco_warp.moving import moved

        return moved_as_they_stand(self.title, request, moved, turns_freely=True)


ENGINE = MujocoWarpEngine()
