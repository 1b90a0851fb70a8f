"""The answer of two files held against each other: one robot or not, and what differs, equal kinds together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from harness.results.comparison import FileDifference, FilesComparison, PairRecord, names_apart
from harness.results.conclusion import MOST_ROWS, MOST_ROWS_OF_SEVERAL, Conclusion, at_most, conclude_alike
from harness.results.detail import Detail, telling
from harness.results.readings import felt_text, share_of_qdd, share_text
from harness.results.table import Cell, Column, Table, counted, error_text, grouped
from harness.verdict import AGREEMENT

# Rows of the table, and names in a sentence; further ones are counted.
MOST_DIFFERENCES, MOST_NAMES = 8, 3


def conclusions(found: FilesComparison, detail: Detail = Detail.BRIEF) -> list[Conclusion]:
    """Each pair of files, then each file, first those that cannot be read; of several files the engines have few rows, and of many none."""
    most = {1: MOST_ROWS, 2: MOST_ROWS_OF_SEVERAL}.get(len(found.files), 0)
    pairs = [conclude_pair(pair, detail) for pair in found.pairs]
    asked = found.files if found.subjects or not found.pairs else []
    # A file that cannot be read answers what was asked of several.
    asked = sorted(asked, key=lambda file: not file.problem)
    return [*pairs, *conclude_alike(found, asked, detail, most)]


def summary(found: FilesComparison) -> str:
    """The sentences of all conclusions."""
    return " ".join(one.sentence for one in conclusions(found))


def conclude_pair(pair: PairRecord, detail: Detail = Detail.BRIEF) -> Conclusion:
    """Answer whether two files are one robot, and their differences, the one that moves accelerations most first."""
    names = names_apart([pair.first, pair.second])
    files = " and ".join(names.values())
    if pair.problem:
        return Conclusion(f"{files} cannot be compared: {pair.problem}.", _standing_still(pair, detail))
    felt, tied = ([_named_apart(one, pair, names) for one in own] for own in (pair.differences, pair.constraints))
    groups = _groups(felt), _groups(tied)
    shown = [*groups[0], *groups[1]] if detail == Detail.BRIEF else [_Group([one]) for one in (*felt, *tied)]
    kept, others = telling(shown, lambda group: group.first.alone, detail)
    rows: list[str | Table] = [*_standing_still(pair, detail), *_matched(pair, detail)]
    if kept:
        few, left = at_most(kept, detail, MOST_DIFFERENCES)
        rows += [difference_table(few, list(names.values()), detail), *filter(None, (left, others))]
    return Conclusion(f"{files} {_verdict(pair, *groups)}.", rows)


def difference_table(groups: Sequence[_Group], names: Sequence[str], detail: Detail) -> Table:
    """A row for each group, with the value of its largest difference in either file, and what that alone does."""
    value = _in_brief if detail == Detail.BRIEF else str
    columns: list[Column | str] = ["difference", *names, Column("of qdd", "plain")]
    rows = [
        [
            group.what,
            Cell(value(group.first.first), [group.first.first_place]),
            Cell(value(group.first.second), [group.first.second_place]),
            felt_text(group.first.alone) if group.first.is_judged else "not judged",
        ]
        for group in groups
    ]
    return Table(columns, rows, "Differences, the one that alone moves the accelerations most first.")


@dataclass(frozen=True)
class _Group:
    """Differences of one kind, the one that moves accelerations most first."""

    members: Sequence[FileDifference]

    @property
    def first(self) -> FileDifference:
        return self.members[0]

    @property
    def what(self) -> str:
        """ "damping of joint elbow", "damping of 7 joints" where all have one value, "mass of link tip and 8 more"."""
        kind, _, owner = self.first.what.rpartition(" of ")
        if len(self.members) == 1:
            return self.first.what
        values = {(one.first, one.second) for one in self.members}
        nouns = {one.what.rpartition(" of ")[2].partition(" ")[0] for one in self.members}
        if len(values) == len(nouns) == 1:
            return f"{kind} of {len(self.members)} {owner.partition(' ')[0]}s"
        return f"{self.first.what} and {len(self.members) - 1} more"


def _groups(differences: Sequence[FileDifference]) -> list[_Group]:
    """Those of one kind together; what is of no part of the robot stands alone."""
    by_kind = grouped((one.what.rpartition(" of ")[0] or one.what, one) for one in differences)
    return [_Group(sorted(own, key=lambda one: -(one.alone or 0.0))) for own in by_kind.values()]


def _named_apart(one: FileDifference, pair: PairRecord, names: dict[str, str]) -> FileDifference:
    """A difference with its places by the names that tell the files apart; those in included files stay."""

    def place(text: str, path: str) -> str:
        file, _, line = text.rpartition(":")
        return f"{names[path]}:{line}" if file == Path(path).name else text

    return replace(one, first_place=place(one.first_place, pair.first), second_place=place(one.second_place, pair.second))


def _verdict(pair: PairRecord, felt: Sequence[_Group], tied: Sequence[_Group]) -> str:
    lacking = [joint for joint in pair.locked if not joint.asked]
    if not pair.alike:
        whole = f" (in all {share_text(pair.relative_error)})" if len(felt) > 1 and pair.relative_error else ""
        return f"differ: {_told(felt[0])}{whole}" if felt else f"differ by {share_of_qdd(share_text(pair.relative_error))}"
    unit = f"data roundoffs{' of float32' if pair.in_float32 else ''}"
    apart = "" if pair.backward_error is None else f" ({error_text(pair.backward_error)} {unit} apart, {AGREEMENT:g} are allowed)"
    but = f" but for {counted(len(lacking), 'joint')} that the files do not share" if lacking else ""
    left_out = f", {counted(len(pair.locked) - len(lacking), 'joint')} left out" if len(pair.locked) > len(lacking) else ""
    if tied:
        return f"move alike{but}{left_out}{apart}, and differ in what no equation of motion holds: {_told(tied[0])}"
    unfelt = f"; they differ in numbers that no acceleration feels, most in {_told(felt[0], felt=False)}" if felt else ""
    held = "limits, dry friction and equalities" if pair.not_held else "limits, dry friction, equalities, contacts and actuators"
    others = f"; not compared: {', '.join(pair.not_held)}" if pair.not_held else ""
    return f"are the same robot{but}{left_out}{apart}, {held} included{unfelt}{others}"


def _told(group: _Group, felt: bool = True) -> str:
    """A group in words, with the lines of both files and the number that matters."""
    one = group.first
    sides = ((one.first, one.first_place), (one.second, one.second_place))
    values = [f"{_in_brief(value)} ({place})" if place else value for value, place in sides]
    return f"{group.what}, {' against '.join(values)}" + (f", changes qdd by {share_text(one.alone)}" if felt and one.is_judged else "")


def _in_brief(value: str) -> str:
    """The first of several numbers."""
    first, _, others = value.partition(", ")
    return f"{first} ..." if others else first


def _standing_still(pair: PairRecord, detail: Detail) -> list[str]:
    """The joints that are locked, a sentence for each reason."""
    sentences = []
    for why, joints in grouped((joint.why, joint) for joint in pair.locked).items():
        named = [f"{joint.name} ({', '.join(filter(None, (joint.first_place, joint.second_place)))})" for joint in joints]
        shown, left = at_most(named, detail, MOST_NAMES)
        names = ", ".join([*shown, *([left] if left else [])])
        sentences.append(f"{names} {'stands' if len(joints) == 1 else 'stand'} still in what is compared: {why}")
    return sentences


def _matched(pair: PairRecord, detail: Detail) -> list[str]:
    """The joints that are matched by their places."""
    shown, left = at_most(pair.remarks, detail, MOST_NAMES)
    return ["; ".join([*shown, *([left] if left else [])])] if shown else []
