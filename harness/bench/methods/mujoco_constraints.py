"""MuJoCo on models with constraints, by solver and by impedance: what each costs, and how far from rigid it is.

The default solver is Newton's method, of at most 100 iterations to a tolerance of 1e-8. Its first step ends there, with what a
factorisation of M + J' D J loses, and more steps to a tolerance of 0 give the rest. The impedance d of a constraint is 0.9 on the
manifold by default, and 0.9999 at most; the nearer to 1, the smaller the distance from rigid. Its regularisation is (1 - d) / d times an
inverse weight of the file's zero position, or with the flag ``diagexact`` times the exact diagonal of J M^-1 J' at the state. Each
choice is another problem that MuJoCo documents, and its answers are held against that one.

Source: MuJoCo documentation, Computation, sections Constraint solver and Solver parameters; XML reference, option and equality.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from harness.bench.methods import Method, Prepared
from harness.bench.methods.mujoco import batch
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.files.text.attributes import Attributes, with_attributes
from harness.library import CONSTRAINED
from harness.programs.states import States


def _changed(attributes: Attributes, scene: Scene, states: States) -> Prepared:
    if "mjcf" not in scene.models:
        raise Unsupported(f"{scene.mechanism.name} has no MJCF model")
    changed = with_attributes(scene.models["mjcf"], attributes)
    return batch(False, replace(scene, models={**scene.models, "mjcf": changed}), states)


def _method(name: str, solver: str = "Newton", impedance: str = "", exact: bool = False, tolerance: str = "") -> Method:
    attributes = {"option": {"solver": solver} | ({"tolerance": tolerance} if tolerance else {})}
    if exact:
        attributes["option/flag"] = {"diagexact": "enable"}
    if impedance:
        attributes["equality/*"] = {"solimp": f"{impedance} {impedance}"}
    prepare = partial(_changed, attributes)
    return Method(f"mujoco batch, {name}", "mjcf", prepare, loop="MuJoCo", growth="up to 3", of=(CONSTRAINED,))


NEWTON = _method("Newton")
CONJUGATE_GRADIENTS = _method("CG", "CG")
PROJECTED_GAUSS_SEIDEL = _method("PGS", "PGS")
SOFT = _method("impedance 0.9", impedance="0.9")
STIFF = _method("impedance 0.9999", impedance="0.9999")
STIFF_TO_THE_END = _method("impedance 0.9999, tolerance 0", impedance="0.9999", tolerance="0")
SOFT_EXACT = _method("impedance 0.9, diagexact", impedance="0.9", exact=True)
STIFF_EXACT = _method("impedance 0.9999, diagexact", impedance="0.9999", exact=True)
