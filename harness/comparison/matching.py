"""Which joint of one file is which of another: by name, then as the user says, then by place and kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from harness.explain.changes.readings import with_joints, with_tree
from harness.files.tree import Joint, Tree
from harness.trees.robot import Robot


@dataclass(frozen=True)
class Matching:
    """The joints of two files.

    Attributes:
        names: {joint of the first: joint of the second}. by_place: those of the first that were matched by place and kind.
        only_first, only_second: joints that have no partner. otherwise: (first, second) partners of different kinds.
    """

    names: Mapping[str, str]
    by_place: tuple[str, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    otherwise: tuple[tuple[str, str], ...]

    @property
    def problem(self) -> str:
        """Why the two are no one robot, joint by joint; "" where every joint has its like."""
        parts = [f"only the first has joint {name}" for name in self.only_first]
        parts += [f"only the second has joint {name}" for name in self.only_second]
        parts += [f"joint {one} is {other} of another kind" for one, other in self.otherwise]
        return "; ".join(parts)


def match(first: Robot, second: Robot, renamed: Mapping[str, str]) -> Matching:
    """Match the joints of two robots; ``renamed`` is {joint of the first: joint of the second} as the user says."""
    ones, others = ({joint.name: joint for joint in robot.tree.joints} for robot in (first, second))
    names = {one: renamed.get(one, one) for one in ones if renamed.get(one, one) in others}
    by_place = _by_place(first.tree, second.tree, names)
    names |= by_place
    taken = set(names.values())
    return Matching(
        names=names,
        by_place=tuple(by_place),
        only_first=tuple(name for name in ones if name not in names),
        only_second=tuple(name for name in others if name not in taken),
        otherwise=tuple((one, other) for one, other in names.items() if ones[one].kind != others[other].kind),
    )


def _by_place(first: Tree, second: Tree, names: Mapping[str, str]) -> dict[str, str]:
    """Partners among the joints that have none: of one kind, behind partners, in the order of the files."""
    found: dict[str, str] = {}
    before, others_before = joints_before(first), joints_before(second)
    kinds, other_kinds = ({joint.name: joint.kind for joint in tree.joints} for tree in (first, second))
    for one, above in before.items():
        if one in names:
            continue
        known = {**names, **found}
        taken = set(known.values())
        free = (
            other
            for other, other_above in others_before.items()
            if other not in taken and other_kinds[other] == kinds[one] and other_above == (known.get(above, "") if above else "")
        )
        if (partner := next(free, None)) is not None:
            found[one] = partner
    return found


def joints_before(tree: Tree) -> dict[str, str]:
    """For each joint the one that carries it, "" for none; parents first."""
    last: dict[str, str] = {}
    found = {}
    for body in tree.bodies:
        above = last.get(body.parent, "")
        for joint in body.joints:
            found[joint.name], above = above, joint.name
        last[body.name] = above
    return found


def renamed_to(robot: Robot, names: Mapping[str, str]) -> Robot:
    """A robot with the names ``{joint: new name}`` of its joints."""

    def change(joint: Joint) -> Joint:
        return replace(joint, name=names.get(joint.name, joint.name), follows=names.get(joint.follows, joint.follows))

    if all(one == other for one, other in names.items()):
        return robot
    return with_tree(robot, with_joints(robot.tree, change))
