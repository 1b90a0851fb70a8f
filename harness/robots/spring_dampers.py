"""Joints that give time constant and damping ratio, from which stiffness and damping follow.

The inertia that they are for is the joint's own in the reference configuration with all other joints free: 1 / (M^-1)_jj. The
documentation speaks of the joint's inertia there; that other joints are free is MuJoCo 4.0, user/user_model.cc, AutoSpringDamper.

Source: MuJoCo documentation, XML reference, ``body/joint/springdamper``; Modeling, section Solver parameters, ``solref``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from harness.equations.balls import mass_matrix
from harness.equations.kernels import BallKernel
from harness.equations.program import without_unused
from harness.files.tree import Given, Joint, SpringDampers, Tree
from harness.robots.recursion import recursion_program

_BITS = 192


def with_spring_dampers(tree: Tree, asked: SpringDampers) -> Tree:
    """The tree whose joints that ask for it have the stiffness and damping that follow from their inertia, rounded to float64."""
    if not asked.given:
        return tree
    inertias = _inertias(tree)

    def changed(joint: Joint) -> Joint:
        if joint.name not in asked.given or joint.place is None:
            return joint
        time, ratio = asked.given[joint.name]
        stiffness = float(inertias[joint.name] / (_exactly(time) * _exactly(ratio)) ** 2) if asked.springs else 0.0
        damping = float(2 * inertias[joint.name] / _exactly(time)) if asked.dampers else 0.0
        # At the joint, for those of a class are other numbers at each.
        return replace(
            joint,
            stiffness=Given(stiffness, joint.place, "stiffness by springdamper"),
            damping=Given(damping, joint.place, "damping by springdamper"),
        )

    return replace(tree, bodies=tuple(replace(body, joints=tuple(map(changed, body.joints))) for body in tree.bodies))


def _exactly(number: Given) -> Any:
    import flint

    return flint.arb(float(number))


def _inertias(tree: Tree) -> dict[str, Any]:
    """1 / (M^-1)_jj of the joints of one axis, in balls."""
    import flint

    joints = tree.joints
    recursion = recursion_program(tree, [joint.name for joint in joints])
    program = without_unused(replace(recursion.program, outputs={"mass": recursion.program.outputs["mass"]}))
    with flint.ctx.workprec(_BITS):
        evaluate = BallKernel(program, len(recursion.parameters)).bind([float(value) for value in recursion.parameters])
        reference = [coordinate for joint in joints for coordinate in _reference(joint)]
        nv = sum(joint.kind.velocities for joint in joints)
        inverse = mass_matrix(evaluate(*reference, *[0.0] * (2 * nv + 1)), nv).inv()
        found, column = {}, 0
        for joint in joints:
            found[joint.name] = 1 / inverse[column, column]
            column += joint.kind.velocities
        return found


def _reference(joint: Joint) -> list[Any]:
    """The position of a joint at which its body stands where the file says; that of a free joint in the world is felt by no inertia."""
    import flint

    if joint.kind.is_single:
        written = flint.arb(float(joint.reference))
        return [written * flint.arb.pi() / 180 if joint.in_degrees else written]
    return [*[0.0] * (joint.kind.positions - 4), 1.0, 0.0, 0.0, 0.0]
