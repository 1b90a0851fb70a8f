"""Two files: one robot or not, and what differs, ranked by what each difference alone does to the accelerations.

Whether they are one robot is decided by their certified accelerations at the same states. What differs is found in the files: number
by number where they are built alike, else between what moves together, in frames that no author chose.
"""

from __future__ import annotations

from collections.abc import Mapping

from harness.certify.compare import compare
from harness.compare.frames import differences_of_nodes
from harness.compare.matching import match, renamed_to
from harness.compare.numbers import OtherShape, different_numbers, ranked
from harness.compare.truth import Meant, read_as
from harness.results.comparison import PairRecord
from harness.robots.robot import Robot
from harness.verdict import Verdict


def hold_against(first: Meant, second: Robot, renamed: Mapping[str, str]) -> PairRecord:
    """The second file against the first, at the states of the first."""
    paths = {"first": str(first.robot.path), "second": str(second.path)}
    matching = match(first.robot, second, renamed)
    remarks = [f"joint {one} is {matching.names[one]} by place and kind" for one in matching.by_place]
    if matching.problem:
        return PairRecord(**paths, same=False, problem=matching.problem, remarks=remarks)
    second = renamed_to(second, {other: one for one, other in matching.names.items()})
    if led := [name for name in first.robot.joints if name not in second.joints]:
        return PairRecord(**paths, same=False, problem=f"joint {', '.join(led)} mimics another in the second file only", remarks=remarks)
    if freed := [name for name in second.joints if name not in first.robot.joints]:
        return PairRecord(**paths, same=False, problem=f"joint {', '.join(freed)} mimics another in the first file only", remarks=remarks)
    if first.certified is None:
        return PairRecord(**paths, same=False, problem=first.undetermined, remarks=remarks)
    other = read_as(first, second)
    columns = [column for name in first.robot.joints for column in _columns(other, name)]
    accelerations = (other.truth.high + other.truth.low)[:, columns]
    compared = compare(first.truth, accelerations)
    verdicts = set(compared.verdicts[first.truth.certified & other.truth.certified].tolist())
    same = verdicts == {Verdict.AGREES.value}
    backward, relative = compared.known("backward_error"), compared.known("relative_error")
    try:
        differences = ranked(first, second, different_numbers(first.robot.tree, second.tree))
    except OtherShape:
        differences = differences_of_nodes(first, second)
    return PairRecord(
        **paths,
        same=same,
        backward_error=float(backward.max()) if len(backward) else None,
        relative_error=float(relative.max()) if len(relative) else None,
        equivalent=same and bool(differences),
        differences=differences,
        remarks=remarks,
    )


def _columns(meant: Meant, name: str) -> list[int]:
    return next(list(joint.velocities) for joint in meant.joints if joint.name == name)

