"""MuJoCo's ``mj_forward`` on an MJCF or URDF model, many states at a time through ``mujoco.batch.Batch``.

Applied forces go through ``qfrc_applied``. Automatic reset is switched off at load: with it, a batch
answers a state beyond 1e10 with the rest state's accelerations and no error. What MuJoCo's reader of URDF passes
over is supplied to it by ``harness.engines.adapters.mujoco.urdf``.

Its constraints are soft: what it solves instead of rigid ones is documented, and follows from the file
(``harness.engines.adapters.mujoco.law``). Solver, iterations and tolerance are those of the file.

Source: MuJoCo documentation, Computation; Python bindings, ``mujoco.batch``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.engines import ConstraintLaw, Engine, StepRule
from harness.engines.adapters.mujoco import law
from harness.engines.interface import CompiledNumber
from harness.engines.request import Ending, Request, SolverSettings
from harness.files.equalities import Constraint
from harness.files.findings import EFFORT, TRANSMISSIONS
from harness.files.model_file import ModelFile, document_of

if TYPE_CHECKING:
    from harness.engines.adapters.mujoco.model import MujocoModel
    from harness.engines.adapters.mujoco.robot import MujocoFile
    from harness.engines.moving import HeldNumbers, MotionsRequest, Moved, MovedFile
    from harness.files.mjcf.inertias import CompiledMesh, Number


class MujocoEngine(Engine):
    title = "MuJoCo"
    solvers = ("Newton", "CG", "PGS")
    # Other methods converge linearly, and PGS with elliptic cones not at all: docs/issues/mujoco-pgs-elliptic-cones.md.
    endings = (
        Ending(SolverSettings("Newton", 100, 0.0), 'set <option solver="Newton" iterations="100" tolerance="0"/>'),
        # Files for MJX search along a line in few iterations, and Newton's method ends where such a search finds nothing.
        Ending(
            SolverSettings("Newton", 100, 0.0, line_search=50),
            'set <option solver="Newton" iterations="100" ls_iterations="50" tolerance="0"/>',
        ),
        # docs/issues/mujoco-sparse-newton.md
        Ending(
            SolverSettings("Newton", 100, 0.0, jacobian="dense"),
            'set <option jacobian="dense"/>, or use another version than MuJoCo 4.0.0',
            "With a sparse Jacobian of constraints, its Newton solver factorises a wrong Hessian, as MuJoCo 4.0.0 does",
        ),
    )
    beside_tau: Mapping[str, str] = {
        EFFORT: (
            "MuJoCo bounds by effort what actuators do that a user adds, as actuatorfrcrange, and has no velocity limits "
            "(MuJoCo 4.0, xml/xml_urdf.cc)"
        ),
        TRANSMISSIONS: "MuJoCo reads none (MuJoCo documentation, Modeling, URDF extensions)",
    }
    requires = ("mujoco", "mujoco")
    formats = ("mjcf", "urdf")
    oldest: Mapping[str, str] = dict.fromkeys(formats, "3.3.0")
    factorises_mass_matrix = True
    has_soft_constraints = True
    contacts = staticmethod(law.contacts)
    unjudged = staticmethod(law.unjudged)
    supplied: Mapping[str, str] = {
        "urdf": (
            "gravity, springs and rotor inertias of joints, springs between points and a ball joint are supplied from the file, "
            "and each link keeps its own inertia"
        ),
        "mjcf": "its reader takes what the file holds; nothing is supplied",
    }
    inertias_about = "tree"
    call: Mapping[str, str] = dict.fromkeys(
        formats,
        "m = mujoco.MjModel.from_xml_path(PATH); m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT; mujoco.mj_forward(m, d)",
    )

    def read(self, request: Request) -> MujocoFile:
        from harness.engines.adapters.mujoco.robot import read

        return read(request)

    def compiled(self, request: Request) -> tuple[CompiledNumber, ...]:
        from harness.engines.adapters.mujoco.robot import compiled_numbers

        return compiled_numbers(request)

    def compiled_meshes(self, path: Path) -> Mapping[Number, CompiledMesh]:
        from harness.engines.adapters.mujoco.meshes import compiled_meshes

        return compiled_meshes(path)

    def held_numbers(self, file: MovedFile) -> HeldNumbers:
        from harness.engines.adapters.mujoco.moving import held_numbers

        return held_numbers(file)

    def moved(self, request: MotionsRequest) -> Moved:
        from harness.engines.adapters.mujoco.moving import moved

        return moved(request)

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> MujocoModel:
        from harness.engines.adapters.mujoco.model import load

        return load(file, joints, gravity)

    def step_rules(self, file: ModelFile) -> tuple[StepRule, ...]:
        """See ``harness.engines.adapters.mujoco.law``."""
        return self.own_rules(document_of(file).root, file.format)

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        return law.laws_in(law.settings(root, model_format), constraints)

    def fuses(self, root: Any, model_format: str) -> bool:
        return law.fuses(root, model_format)

    def own_rules(self, root: Any, model_format: str) -> tuple[StepRule, ...]:
        return law.rules_in(law.settings(root, model_format))


ENGINE = MujocoEngine()
