"""A file's springs and dampers as forces on joints, for engines that apply none of them.

They are computed from the file and the engine's own positions and Jacobians, never from a potential energy, so that the comparison
stays independent.

Sources: SDFormat specification, joint ``dynamics``, for joint springs and dampers; Drake documentation, ``LinearSpringDamper``, for
springs between points.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.rotations import Columns
from harness.models.model_file import JointDamper, JointSpring, ModelFile, PointSpring

# World position (3,) of a point of a body, given in the body's frame, and its Jacobian (3, nv) for the columns of v.
PointOf = Callable[[str, Array], tuple[Array, Array]]


class SuppliedForces:
    """The force elements of a file, whose joints stand in q and v as ``columns`` say, and the reflected inertias of its joints.

    ``by_engine`` is the kind of element that the engine applies itself.

    Raises:
        Unsupported: the file holds a force that no force element expresses.
    """

    def __init__(self, file: ModelFile, columns: Columns, by_engine: type | tuple[type, ...] = ()) -> None:
        if file.unexpressed:
            raise Unsupported("; ".join(f"line {one.line}: {one.what}, which the harness cannot supply" for one in file.unexpressed))
        elements = [element for element in file.force_elements if not isinstance(element, by_engine)]
        self._springs = [(*columns.first[one.joint], one) for one in elements if isinstance(one, JointSpring)]
        self._dampers = [(*columns.spans(one.joint), one) for one in elements if isinstance(one, JointDamper)]
        self._points = [element for element in elements if isinstance(element, PointSpring)]
        self.armature = np.zeros(columns.nv)
        for armature in file.armatures:
            self.armature[columns.first[armature.joint][1]] = armature.reflected_inertia

    @property
    def empty(self) -> bool:
        """True where no force is supplied; inertias may be."""
        return not (self._springs or self._dampers or self._points)

    def at(self, q: Array, v: Array, point_of: PointOf) -> Array:
        """(nv,) forces [N or N m] at one state, at which the engine is."""
        forces = np.zeros(len(v))
        for position, row, spring in self._springs:
            forces[row] -= spring.stiffness * (q[position] - spring.reference)
        for _, rows, damper in self._dampers:
            forces[rows] -= damper.damping * v[rows]
        for spring in self._points:
            (point_a, jacobian_a), (point_b, jacobian_b) = (point_of(body, np.array(point)) for body, point in spring.ends)
            span = point_b - point_a
            length = np.linalg.norm(span)
            # Rate of the length is (its gradient) . velocity; the tension does work along it.
            gradient = (span / length) @ (jacobian_b - jacobian_a)
            forces -= (spring.stiffness * (length - spring.free_length) + spring.damping * (gradient @ v)) * gradient
        return forces
