"""The share of contacts that slide by Coulomb's law: what their documented problem adds to the normal velocity, and takes away again.

Source: De Saxce, Feng, The bipotential method, Mathl. Comput. Modelling 28 (1998).
"""

from __future__ import annotations

import numpy as np

from harness.arrays import Array
from harness.programs.mechanisms.descent import problem_of
from harness.truth.declared import DeclaredMechanism


def slip_share(mechanism: DeclaredMechanism, inputs: Array, accelerations: Array, norm_factor: Array) -> Array:
    """(n,) energy norm of what half an ulp of De Saxce's correction mu |y_t| moves accelerations by, (n, nv), through y_n.

    The problem is documented with y_n + mu |y_t| in the dual cone, which solvers form. Where a contact slides fast that lightly touches,
    it is many times y_n. With W minus the derivative of forces and H = M + J' W J, a contact counts |H^-1 J' W e_n|_M mu |y_t|.
    """
    zones, problem = mechanism.zones, mechanism.problem
    found = np.zeros(len(accelerations))
    if zones is None or problem is None or all(cone.flow.is_convex for cone in zones.cones):
        return found
    parameters = np.ascontiguousarray(inputs[len(inputs) - len(mechanism.parameters) :].T)
    with np.errstate(all="ignore"):
        own = problem_of(zones, problem, inputs, parameters, None)
        y = own.left_by(accelerations)
        _, bent, system = own.system(y)
        usable = np.asarray(np.isfinite(system).all(axis=(1, 2)) & np.isfinite(y).all(axis=1))
        pushed = np.where(usable[:, None, None], own.jacobian.transpose(0, 2, 1) @ bent, 0.0)
        moved = norm_factor @ np.linalg.solve(np.where(usable[:, None, None], system, np.eye(mechanism.nv)), pushed)
        for cone, part in zip(zones.cones, zones.parts, strict=True):
            first, last = len(zones.clamps) + part.start, len(zones.clamps) + part.stop
            slip = np.linalg.norm(parameters[:, list(cone.friction)] * y[:, first + 1 : last], axis=1)
            slides = parameters[:, cone.sliding] == 1.0
            found += np.where(slides, np.linalg.norm(moved[:, :, first], axis=1) * slip, 0.0)
    return np.where(np.isfinite(found), found, 0.0)
