"""What engines compute of a tree beside accelerations, as programs of positions, velocities, accelerations and the numbers of a file.

Everything is written along the world's axes, in blocks: a number, or a vector whose length says how large an error is. Each block
comes with how large the parts are that an algorithm may form of it and cancel, which no derivative shows. Algorithms add the
arms of a tree one after another, take momenta about a point of their own choice, as the centre of mass of the whole tree, and
turn vectors from frame to frame; so an arm counts with the sum of the lengths on the way to it.

Sources: Featherstone, Rigid Body Dynamics Algorithms, chapters 5 and 6 (inverse dynamics, composite rigid bodies); Goldstein,
Classical Mechanics, sections 1.1 and 1.2 (momentum, energy), 5.1 and 5.3 (rigid bodies).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

from harness.equations.program import StraightLineProgram, without_unused
from harness.files.tree import Given, Tree
from harness.robots.constraints import untied
from harness.robots.nodes import SIZES
from harness.robots.rigid import Lump
from harness.robots.spatial import Three
from harness.robots.wrenches import WrenchWriter


@dataclass(frozen=True)
class Block:
    """A vector of a quantity.

    Attributes:
        name: as a report says it. values: places of its components. size: place of how large the parts are that cancel in it.
    """

    name: str
    values: tuple[int, ...]
    size: int


@dataclass(frozen=True)
class ComputedQuantity:
    """The blocks of a quantity as programs.

    Attributes:
        program: from q, v, qdd, time and ``parameters``; its outputs are the components of the blocks, one after another.
        sizes: from the same inputs; its outputs are the sizes of the blocks.
        blocks: what each block is. width: the number of components of each.
    """

    program: StraightLineProgram
    sizes: StraightLineProgram
    parameters: tuple[Given, ...]
    blocks: tuple[str, ...]
    width: int


class QuantityWriter(WrenchWriter):
    """What all quantities of one tree take.

    ``read`` is another tree of the same joints, whose bodies and anchors are asked for: what is one body with two joints in one file is two
    bodies in another. ``has_other_points``: whether its anchors are other points, see ``have_same_points``.
    """

    def __init__(
        self,
        tree: Tree,
        joints: Sequence[str],
        linear_velocity_in_body: bool = False,
        read: Tree | None = None,
        has_other_points: bool = False,
    ) -> None:
        super().__init__(untied(tree, joints), joints, linear_velocity_in_body)
        self._moving = self.moving()
        self._roots = [self._root(self._moving, number) for number in range(len(self._moving))]
        self._anchors = self.points(self._moving)
        read = self.tree if read is None else untied(read, self._order)
        if has_other_points:
            # Another point is a number of another file, with roundings of its own.
            self._anchors = self.positions_of(read)
            self._plant(self.tree)
        self._last = {joint.name: body.joints[-1].name for body in read.bodies for joint in body.joints}

    def written(self, blocks: Iterable[Block]) -> ComputedQuantity:
        """The programs of blocks of this writer, all of one width."""
        blocks = list(blocks)
        values = {"values": [value for block in blocks for value in block.values]}
        program, sizes = self.program(values), self.program({"sizes": [block.size for block in blocks]})
        names = tuple(block.name for block in blocks)
        return ComputedQuantity(without_unused(program), without_unused(sizes), self.parameters, names, len(blocks[0].values))

    # How large things are.

    def size_of(self, value: int) -> int:
        """|value|."""
        return self._length([value])

    @cached_property
    def _extent(self) -> int:
        """The distance of the centre of mass from the roots, at most."""
        first, mass = self.zero, self.zero
        for number, one in enumerate(self._moving):
            for lump in one.lumps:
                reach = self.sum(self._from_root(number), self._length(lump.centre))
                first, mass = self.sum(first, self.product(lump.mass, reach)), self.sum(mass, lump.mass)
        return self.quotient(first, mass)

    def _from_root(self, number: int) -> int:
        """The length of the way from the first joint of the tree to a node."""
        way = self.zero
        while self._moving[number].node.parent >= 0:
            way = self.sum(way, self._length(self._moving[number].arm))
            number = self._moving[number].node.parent
        return way

    def _distance(self, number: int) -> int:
        """The length of the way from the world's origin to a node."""
        return self.sum(self._from_root(number), self._length(self._roots[number]))

    def _reach_of(self, number: int, point: Three) -> int:
        return self.sum(self._distance(number), self._length(self.less(point, self._moving[number].position)))

    def _sizes_of_columns(self, number: int, point: Three) -> dict[int, tuple[int, int]]:
        """What each velocity does to that of a point of a node's body, and to its spin, with arms taken from anywhere in the tree."""
        reach = self.sum(self._extent, self.sum(self._from_root(number), self._length(self.less(point, self._moving[number].position))))
        found: dict[int, tuple[int, int]] = {}
        at = number
        while at >= 0:
            one = self._moving[at]
            for (about, along), column in zip(one.motions, one.node.columns, strict=True):
                linear, angular = found.get(column, (self.zero, self.zero))
                turning = self._length(about)
                sliding = self.sum(self._length(along), self.product(turning, reach))
                found[column] = self.sum(linear, sliding), self.sum(angular, turning)
            at = one.node.parent
        return found

    def _speed(self, number: int, lump: Lump) -> int:
        return self._speeds(number, self.added(self._moving[number].position, lump.centre))[0]

    def _speeds(self, number: int, point: Three) -> tuple[int, int]:
        """How large the parts are of the velocity of a point of a node's body, and of its spin."""
        speed, spin = self.zero, self.zero
        for column, (linear, angular) in self._sizes_of_columns(number, point).items():
            rate = self.size_of(self._first_rate + column)
            speed, spin = self.sum(speed, self.product(rate, linear)), self.sum(spin, self.product(rate, angular))
        return speed, spin

    # Names.

    @cached_property
    def columns(self) -> list[str]:
        """What each velocity is called."""
        kinds = {joint.name: joint.kind for joint in self.tree.joints}
        counts = {name: SIZES[kinds[name]][1] for name in self._order}
        return [f"joint {name!r}" + (f"[{place}]" if count > 1 else "") for name, count in counts.items() for place in range(count)]

    def _named(self) -> Iterator[tuple[int, str]]:
        """The joints that have velocities of their own, in the order of these, each with the node that moves with its body."""
        numbers = {one.node.joint.name: number for number, one in enumerate(self._moving)}
        for name in self._order:
            yield numbers[self._last[name]], name

    @contextmanager
    def _at_zero(self) -> Iterator[None]:
        """Within it the nodes are those of the position zero, where quaternions are 1."""
        places = self._places
        self._places = {name: (self._zeros(len(positions), len(columns)), columns) for name, (positions, columns) in places.items()}
        self._plant(self.tree)
        try:
            yield
        finally:
            self._places = places
            self._plant(self.tree)

    def _zeros(self, positions: int, velocities: int) -> list[int]:
        found = [self.zero] * positions
        if positions > velocities:
            found[-4] = self.number(1)
        return found
