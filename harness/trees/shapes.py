"""Shapes of a file in the world, as a program of the positions of its joints.

Source: MuJoCo documentation, XML reference, ``body/geom``, attributes ``type``, ``size`` and ``fromto``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from harness.files.joint_kinds import JointKind
from harness.files.shapes import BOX, Shape
from harness.files.tree import WORLD, Tree
from harness.programs.terms import length
from harness.trees.bodies.spatial import placed
from harness.trees.nodes import joints_by_themselves, kinematics
from harness.trees.world_motion import in_world


@dataclass(frozen=True)
class PlacedShape:
    """A shape in the world at one state, in ``arb``.

    Attributes:
        centre, axis: (3,), of the z axis of its frame. radius, half: half the length; 0 where the shape has none.
        size: of the lengths that are added for its place [m].
        axes, halves: of a box, the three axes of its frame and half its edges along them.
    """

    shape: Shape
    centre: Sequence[Any]
    axis: Sequence[Any]
    radius: Any
    half: Any
    size: float
    axes: Sequence[Sequence[Any]] = ()
    halves: Sequence[Any] = ()


class ShapesInWorld:
    """The shapes of a tree whose joints have their positions in this order, to the precision of ``flint.ctx`` at which they are made."""

    def __init__(self, tree: Tree, joints: Sequence[str], shapes: Sequence[Shape]) -> None:
        nodes = kinematics(tree, joints)
        self._shapes, self._evaluate = shapes, _program(in_world(nodes), shapes)
        kinds = joints_by_themselves(tree)
        self._others = [0.0] * (2 * sum(kinds[name].velocities for name in joints) + 1)
        self._reaches = [_Reach.of(tree, joints, shape) for shape in shapes]

    def at(self, q: Sequence[float]) -> list[PlacedShape]:
        """All of them at one configuration, (nq,), at the precision of ``flint.ctx``."""
        outputs = self._evaluate(*map(float, q), *self._others) if self._shapes else {}
        return [
            PlacedShape(shape, own[:3], own[3:6], own[6], own[7], reach.at(q), *_of_box(own[3:6], own[8:]))
            for shape, reach, own in zip(self._shapes, self._reaches, (outputs[str(n)] for n in range(len(self._shapes))), strict=True)
        ]


def _program(world: Any, shapes: Sequence[Shape]) -> Callable[..., dict[str, list[Any]]]:
    builder, outputs = world.kinematics.builder, {}
    for number, shape in enumerate(shapes):
        frame = placed(builder, shape.pose, world.frame_of(shape.body))
        sizes = [builder.number(one) for one in shape.size]
        if shape.ends:
            first, second = map(builder.vector, shape.ends)
            sizes = [*sizes * (2 if shape.kind == BOX else 1), builder.number(Fraction(1, 2)) * length(second + -first)]
        box = [*frame.turn[:, 0], *frame.turn[:, 1], *sizes] if shape.kind == BOX else []
        radius, half, *_ = [builder.zero] * 2 if box else [*sizes, builder.zero, builder.zero]
        outputs[str(number)] = [*frame.shift, *frame.turn[:, 2], radius, half, *box]
    if not shapes:
        return dict
    evaluate: Callable[..., dict[str, list[Any]]] = builder.written(outputs).in_balls()
    return evaluate


def _of_box(axis: Sequence[Any], rest: Sequence[Any]) -> tuple[Sequence[Sequence[Any]], Sequence[Any]]:
    """Axes and halves of a box; none of another shape."""
    return ((rest[:3], rest[3:6], axis), rest[6:]) if rest else ((), ())


@dataclass(frozen=True)
class _Reach:
    """Lengths that are added for the place of a shape: those of the file, and those of joints by their columns in q."""

    fixed: float
    columns: Sequence[int]

    def at(self, q: Sequence[float]) -> float:
        return self.fixed + sum(abs(float(q[column])) for column in self.columns)

    @classmethod
    def of(cls, tree: Tree, joints: Sequence[str], shape: Shape) -> _Reach:
        bodies, kinds, first = {body.name: body for body in tree.bodies}, joints_by_themselves(tree), dict[str, int]()
        for name in joints:
            first[name] = sum(kinds[other].positions for other in joints[: len(first)])
        fixed, columns, body = _lengths([shape.pose, shape.size, shape.ends]), list[int](), shape.body
        while body != WORLD:
            one = bodies[body]
            fixed += _lengths([one.pose])
            for joint in one.joints:
                # An anchor is added, and taken away again.
                fixed += 2 * _lengths([joint.anchor]) + abs(float(joint.reference))
                if joint.kind.linear and joint.name in first:
                    columns += range(first[joint.name], first[joint.name] + (3 if joint.kind is JointKind.FREE else 1))
            body = one.parent
        return cls(fixed, columns)


def _lengths(values: Any) -> float:
    return sum(map(abs, _flat(values)), 0.0)


def _flat(value: Any) -> Iterator[float]:
    """The lengths in poses, vectors and numbers."""
    if isinstance(value, Fraction | float | int):
        yield float(value)
    elif hasattr(value, "position"):
        yield from _flat((value.position, value.other_end or ()))
    else:
        for part in value:
            yield from _flat(part)
