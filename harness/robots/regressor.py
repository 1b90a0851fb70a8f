"""The derivatives of inverse dynamics by the inertial parameters of bodies, in which it is linear: the joint torque regressor.

Sources: Atkeson, An, Hollerbach, Estimation of inertial parameters of manipulator loads and links, IJRR 5 (1986); Featherstone, Rigid
Body Dynamics Algorithms, section 2.13, for the parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from harness.files.tree import Tree
from harness.robots.constraints import untied
from harness.robots.force_quantities import ForceQuantities
from harness.robots.nodes import Pair
from harness.robots.quantity_writer import Block
from harness.robots.rigid import Lump
from harness.robots.spatial import Three, transposed

# Mass, first moments, and moments of inertia about the origin of a frame of the body.
PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_AXES = {"x": 0, "y": 1, "z": 2}


class RegressorQuantities(ForceQuantities):
    """Writes the regressor of one tree."""

    def regressor(self) -> Iterator[Block]:
        """By body, parameter and velocity: what a unit of the parameter adds to the generalised force.

        The parameters are about the anchor of the last joint of the body, along the axes of the body's frame.
        """
        numbers = {one.node.joint.name: number for number, one in enumerate(self._moving)}
        accelerations = self._accelerations(self._moving, self.given_accelerations)
        for joint in carrying_joints(self.tree, self._order):
            for parameter in PARAMETERS:
                unit = self._unit(numbers[joint], parameter, accelerations[numbers[joint]])
                values, sizes = self._column(numbers[joint], *unit)
                for column, value, size in zip(self.columns, values, sizes, strict=True):
                    name = f"derivative by {parameter} of the body behind {joint!r} of the generalised force on {column}"
                    yield Block(name, (value,), size)

    def _unit(self, number: int, parameter: str, acceleration: Pair) -> tuple[list[Pair], list[Pair], Lump]:
        """What a unit of a parameter of a node needs for its motion against gravity; vectors as long as what cancels in the components of
        that; and a lump by which the arms are measured."""
        one, (turning, of_origin) = self._moving[number], acceleration
        upward = self.minus(self.numbers(self.tree.gravity))
        axes, nothing = transposed(one.orientation), [self.still] * 3
        if parameter == "m":
            parts = [(self.still, of_origin), (self.still, upward)]
            return parts, parts, Lump(self.number(1), self.still, nothing)
        # As long as the square of the spin.
        squared = self.times(self._length(one.spin), one.spin)
        if parameter[0] == "m":
            axis = axes[_AXES[parameter[1]]]
            parts = [
                (self.cross(axis, of_origin), self.cross(turning, axis)),
                (self.cross(axis, upward), self.still),
                (self.still, self.cross(one.spin, self.cross(one.spin, axis))),
            ]
            return parts, [(of_origin, turning), (upward, self.still), (self.still, squared)], Lump(self.number(1), axis, nothing)
        first, second = (axes[_AXES[name]] for name in parameter[1:])
        momenta = []
        for angular in (turning, one.spin):
            momentum = self.times(self.dot(second, angular), first)
            mirrored = self.times(self.dot(first, angular), second)
            momenta.append(momentum if first is second else self.added(momentum, mirrored))
        parts = [(momenta[0], self.still), (self.cross(one.spin, momenta[1]), self.still)]
        return parts, [(turning, self.still), (squared, self.still)], Lump(self.zero, self.still, nothing)

    def _column(self, number: int, parts: list[Pair], that_cancel: list[Pair], lump: Lump) -> tuple[Three, Three]:
        """The generalised force of each velocity, and the sizes, where one node alone bears ``parts``."""
        moving = [replace(one, lumps=[]) for one in self._moving]
        moving[number] = replace(moving[number], lumps=[lump])
        of_node, of_sizes = ([own if at == number else [] for at in range(len(moving))] for own in (parts, that_cancel))
        values, sizes = [self.zero] * self.nv, [self.zero] * self.nv
        at = number
        while at >= 0:
            one = moving[at]
            moment, force = self._wrench(moving, of_node, at, one.position)
            size_of_moment, size_of_force = self._size(moving, of_sizes, at, one.position)
            for (about, along), column in zip(one.motions, one.node.columns, strict=True):
                values[column] = self.sum(values[column], self.sum(self.dot(moment, about), self.dot(force, along)))
                for motion, size in ((about, size_of_moment), (along, size_of_force)):
                    sizes[column] = self.sum(sizes[column], self.product(self._length(motion), size))
            at = one.node.parent
        return values, sizes


def carrying_joints(tree: Tree, joints: Sequence[str]) -> tuple[str, ...]:
    """The joints that bodies hang on, of several joints of a body the last one, in the order of ``joints``."""
    last = {body.joints[-1].name for body in untied(tree, joints).bodies if body.joints}
    return tuple(name for name in dict.fromkeys(joints) if name in last)
