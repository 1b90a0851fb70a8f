"""Two files: one robot or not, and what differs, ranked by what each difference alone does to the accelerations.

Whether they are one robot is decided by their certified accelerations at the same states. What differs is found in the files: number
by number where they are built alike, else between what moves together, in frames that no author chose.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import replace

import numpy as np

from harness.certify.compare import compare
from harness.comparison.frames import differences_of_nodes
from harness.comparison.matching import match, renamed_to
from harness.comparison.numbers import OtherShape, different_numbers, place_text, ranked
from harness.comparison.same_states import SameStates
from harness.comparison.truth import Meant, change, columns_of, read_as
from harness.explain.changes.readings import freed, with_joints, with_tree
from harness.files.tree import Joint
from harness.results.comparison import FileDifference, PairRecord
from harness.trees.robot import Robot
from harness.verdict import Verdict


def hold_against(first: Meant, second: Robot, renamed: Mapping[str, str]) -> PairRecord:
    """The second file against the first, at the states of the first."""
    matching = match(first.robot, second, renamed)
    record = PairRecord(
        first=str(first.robot.path),
        second=str(second.path),
        same=False,
        remarks=[f"joint {one} is {matching.names[one]} by place and kind" for one in matching.by_place],
    )
    if matching.problem or first.undetermined:
        return replace(record, problem=matching.problem or first.undetermined)
    second = renamed_to(second, {other: one for one, other in matching.names.items()})
    led, (first, second) = _mimics(first, second), _freed(first, second)
    same_states = SameStates(first.robot, second)
    other = read_as(first, second, same_states)
    if other.undetermined:
        return replace(record, problem=f"{second.path.name}: {other.undetermined}")
    columns = columns_of(other.joints, first.robot.joints)
    compared = compare(first.truth, same_states.of_first(other.truth.high.astype(np.longdouble) + other.truth.low)[:, columns])
    verdicts = set(compared.verdicts[first.truth.certified & other.truth.certified].tolist())
    same = verdicts == {Verdict.AGREES.value} and not led
    backward, relative = compared.known("backward_error"), compared.known("relative_error")
    try:
        differences = ranked(first, second, different_numbers(first.robot.tree, second.tree))
    except OtherShape:
        differences = differences_of_nodes(first, second)
    return replace(
        record,
        same=same,
        backward_error=float(backward.max()) if len(backward) else None,
        relative_error=float(relative.max()) if len(relative) else None,
        equivalent=same and bool(differences),
        differences=[*led, *differences],
    )


def _mimics(first: Meant, second: Robot) -> list[FileDifference]:
    """The joints that move by themselves in one file only."""
    found = []
    for one in first.robot.tree.joints:
        other = second.joint(one.name)
        if one.follows != other.follows:
            alone = change(first, read_as(first, _free(first.robot, {one.name}))) if one.follows else None
            places = [place_text(joint.places.get("multiplier")) for joint in (one, other)]
            said = [f"mimics {joint.follows}" if joint.follows else "moves by itself" for joint in (one, other)]
            found.append(
                FileDifference(
                    what=f"joint {one.name}", first=said[0], second=said[1], first_place=places[0], second_place=places[1], alone=alone
                )
            )
    return found


def _freed(first: Meant, second: Robot) -> tuple[Meant, Robot]:
    """Both with the joints free that do not mimic the same joint in both, so that the rest can be compared."""
    names = {joint.name for joint in first.robot.tree.joints if joint.follows != second.joint(joint.name).follows}
    if not names:
        return first, second
    return read_as(first, _free(first.robot, names)), _free(second, names)


def _free(robot: Robot, names: Set[str]) -> Robot:
    def change(joint: Joint) -> Joint:
        return freed(joint) if joint.name in names else joint

    return with_tree(robot, with_joints(robot.tree, change))
