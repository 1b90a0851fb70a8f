"""Steps from an engine's accelerations, as users write them who integrate by themselves.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., sections I.1 (symplectic Euler) and IV.8 (Lie group methods).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import multiplied
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import AskedJoint, by_joint
from harness.files.rules import StepRule

LENGTH = 0.002
_HALF = Fraction(1, 2)
EULER = StepRule("Euler", LENGTH)
RUNGE_KUTTA = StepRule(
    "RK4",
    LENGTH,
    stages=((_HALF,), (Fraction(0), _HALF), (Fraction(0), Fraction(0), Fraction(1))),
    weights=(Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6)),
)
OWN_RULES = (EULER, RUNGE_KUTTA)


def advanced(loaded: LoadedFile, joints: Sequence[AskedJoint], q: Array, v: Array, rule: StepRule, steps: int) -> tuple[Array, Array]:
    """q (nq,) and v (nv,) over ``joints`` after so many steps by a rule of ``OWN_RULES``, without applied forces.

    Raises:
        ValueError: the rule has stages, and a joint turns about a point.
    """
    if rule.stages and any(joint.kind.has_attitude for joint in joints):
        raise ValueError(f"{rule.name} of one's own is written for hinges and slides alone")
    accelerate = _accelerations_of(loaded, joints)
    for _ in range(steps):
        if rule.stages:
            q, v = _runge_kutta(accelerate, q, v, rule)
        else:
            v = v + rule.length * accelerate(q, v)
            q = _moved(joints, q, rule.length * v)
    return q, v


def _accelerations_of(loaded: LoadedFile, joints: Sequence[AskedJoint]) -> Callable[[Array, Array], Array]:
    def accelerations(q: Array, v: Array) -> Array:
        found = by_joint(loaded.joints, loaded.forward_dynamics(q[None], v[None], np.zeros((1, len(v)))))
        return np.concatenate([found[joint.name][0] for joint in joints])

    return accelerations


def _runge_kutta(accelerate: Callable[[Array, Array], Array], q: Array, v: Array, rule: StepRule) -> tuple[Array, Array]:
    rates, accelerations = [v], [accelerate(q, v)]
    for weights in rule.stages:
        at_q, at_v = (start + rule.length * _mixed(weights, slopes) for start, slopes in ((q, rates), (v, accelerations)))
        rates.append(at_v)
        accelerations.append(accelerate(at_q, at_v))
    return q + rule.length * _mixed(rule.weights, rates), v + rule.length * _mixed(rule.weights, accelerations)


def _mixed(weights: Sequence[Fraction], vectors: Sequence[Array]) -> Array:
    return np.asarray(sum(float(weight) * vector for weight, vector in zip(weights, vectors, strict=True)))


def _moved(joints: Sequence[AskedJoint], q: Array, way: Array) -> Array:
    """Positions after a way along the velocities: a rotation turns about the body's axes."""
    found = q.copy()
    for joint in joints:
        positions, velocities = list(joint.positions), list(joint.velocities)
        if joint.kind.has_attitude:
            half = way[velocities[-3:]] / 2
            angle = np.linalg.norm(half)
            turn = np.array([np.cos(angle), *(half * np.sinc(angle / np.pi))])
            found[positions[-4:]] = multiplied(q[positions[-4:]], turn)
            positions, velocities = positions[:-4], velocities[:-3]
        found[positions] += way[velocities]
    return found
