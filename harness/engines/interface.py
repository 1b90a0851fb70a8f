"""What a loaded model may be asked for beside accelerations, and the check of what it returns.

Each is a method of the model. q is (n, nq), v and qdd (n, nv), their columns as in ``forward_dynamics``; joints are those that ``load``
was given, each once.

- ``mass_matrix(q)``: M with reflected inertias, (n, nv, nv). ``gravity(q)``: what holds the model at rest against its weight, (n, nv).
  An engine that offers ``terms`` need not offer these two.
- ``bias(q, v)``: velocity terms and gravity, (n, nv), without springs and dampers.
- ``inverse_dynamics(q, v, qdd)``: the applied forces that give these accelerations beside springs and dampers, (n, nv).
- ``forward_dynamics_derivatives(q, v, tau)``: of the accelerations by q, v and tau, (n, 3, nv, nv), the accelerations by rows; and
  ``inverse_dynamics_derivatives(q, v, qdd)``: of the applied forces by q, v and qdd. Derivatives by q are along the engine's own
  velocities, whose components in v are kept: a ball joint turns about the axes of its body, and a free joint moves along these or along
  those of its parent, as ``linear_velocity_in_body`` says. Springs and dampers take part.
- ``regressor(q, v, qdd)``: of the applied forces without springs and dampers by the inertial parameters of bodies, (n, nv, joints, 10):
  of the body behind a joint m, its first moments mx, my, mz, and Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the point of ``positions``, along the
  axes of the body's frame. Of several joints of a body only the last is looked at.
- ``energies(q, v)``: kinetic energy, and potential energy up to a constant, of gravity and springs, (n, 2) [J].
- ``momenta(q, v)``: of all that moves, (n, 9): momentum [N s], and moments of momentum about the world's origin and about the centre
  of mass [N m s].
- ``positions(q)``: of each joint, (n, joints, 12): the anchor of the last joint of its body, which moves with the body [m], and the
  orientation of a frame of the body in the world, by rows. Which frame it is does not matter.
- ``velocities(q, v)``: of each joint, (n, joints, 6): the velocity of the same point, and the angular velocity of the body.
- ``jacobians(q)``: by which each velocity changes these, (n, joints, 6, nv).
- ``reactions(q, v, tau)``: what each joint transmits, (n, joints, 6): the force [N] and the moment [N m] that the parent exerts on the
  child; the moment is about the point of ``positions``. Springs between points pull from outside, and so do constraints that hold
  points or frames together; couplings of joints act through the joints. The row of a free joint is not looked at.
- ``step(q, v, tau, length, integrator)``: q and v after one step of that length [s] by an integrator that the engine declares a rule of,
  (n, nq + nv).

Vectors are along the world's axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array

if TYPE_CHECKING:
    from harness.engines import Model

METHODS = (
    "mass_matrix",
    "gravity",
    "bias",
    "inverse_dynamics",
    "energies",
    "momenta",
    "positions",
    "velocities",
    "jacobians",
    "reactions",
    "forward_dynamics_derivatives",
    "inverse_dynamics_derivatives",
    "regressor",
)


class Unsupported(Exception):
    """The engine cannot express the mechanism; the message is the reason. Verdict ``unsupported``."""


class NotOffered(Unsupported):
    """What was asked for is not among what the engine claims to compute, or the mechanism has nothing of the kind."""


class InvalidAnswer(Exception):
    """An engine returned something else than was asked for; the message says what. Verdict ``error``."""


def answer_of(model: Model, method: str, arguments: Sequence[Any], shape: tuple[int, ...]) -> Array:
    """What a method of the model returns, which may hold numbers that are not finite.

    Raises:
        InvalidAnswer: it is no array of that shape of floating-point numbers.
        NotOffered: the model has no such method.
    """
    asked = getattr(model, method, None)
    if asked is None:
        raise NotOffered(f"the engine offers no {method.replace('_', ' ')}")
    answer: Any = asked(*arguments)
    if not isinstance(answer, np.ndarray):
        found = f"a {type(answer).__name__}"
    elif answer.shape != shape or not np.issubdtype(answer.dtype, np.floating):
        found = f"an array of shape {answer.shape} of {answer.dtype}"
    else:
        return np.asarray(answer)
    raise InvalidAnswer(f"{method} returned {found}; expected an array of shape {shape} of float64")
