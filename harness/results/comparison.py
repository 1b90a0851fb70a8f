"""Findings of a comparison of robots' files, as plain data."""

from __future__ import annotations

import functools
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, ClassVar

from harness.files.findings import FREE_BASE, Impossible, LeftOut
from harness.results.readings import FELT, Effect, are_misread
from harness.results.run import StudyResult
from harness.results.switched_on import SwitchedOnRecord
from harness.results.table import Cell, Column, program_name
from harness.verdict import Verdict


def fixed_base(trunk: str, model_format: str) -> str:
    """Advice where a trunk is fixed to the world, a sentence; "" where none is."""
    return f"fixed base: {trunk} hangs on the world without a joint; {FREE_BASE[model_format]} for a free one" if trunk else ""


@dataclass(frozen=True, kw_only=True)
class FileRecord:
    """A robot's file as its format gives it meaning.

    Attributes:
        problem: why it has no meaning; "" where it has one. gravity: [m/s^2].
        undecided: number of states without certified truth. remark: why there are no states; "" where there are some.
        meshes: lines of geoms whose inertia is that of a mesh as MuJoCo compiled it.
        unread: whether no engine of the run reads its format.
        trunk: the body that hangs on the world without a joint though its limbs speak of one that floats; "" for none.
    """

    path: str
    format: str = ""
    problem: str = ""
    bodies: int = 0
    joints: int = 0
    followers: int = 0
    degrees_of_freedom: int = 0
    total_mass: float = 0.0
    gravity: tuple[float, ...] = ()
    states: int = 0
    undecided: int = 0
    remark: str = ""
    meshes: tuple[int, ...] = ()
    left_out: list[LeftOut] = field(default_factory=list)
    impossible: list[Impossible] = field(default_factory=list)
    trunk: str = ""
    unread: bool = False

    @property
    def base(self) -> str:
        """``fixed_base`` of the file."""
        return fixed_base(self.trunk, self.format)


@dataclass(frozen=True, kw_only=True)
class SubjectRecord:
    """An engine on a file, plain or aided.

    Attributes:
        call: the user's code. verdict: against the truth of the file; backward_error [data roundoffs] and relative_error are the worst.
        explained: whether the answer agrees with what the file means or, plain, with what ``readings`` make of it.
        left: worst backward error after the readings; None where nothing is compared.
        rest: what is known of what the readings leave, a sentence each. message: the engine's refusal, or why there is no answer.
        notes: what was taken out of the file before the engine read it.
        lost_digits: at how many states, and why, the answer is beyond ``AGREEMENT`` though the engine and its readings hold the right
            numbers; "" where it is not.
        another_robot: why what the engine's reader makes of the file has no accelerations of it; "" where it has some.
        title: the engine's name as its authors write it.
        expected, expected_reason: the outcome that ``expected_robots.toml`` names, and why; "" where it has no entry.
    """

    path: str
    engine: str
    format: str
    aided: bool
    call: str
    verdict: str
    explained: bool
    backward_error: Annotated[float | None, Column("backward error", "error")] = None
    relative_error: Annotated[float | None, Column("relative error", "relative")] = None
    left: Annotated[float | None, Column("after readings", "error")] = None
    readings: list[Effect] = field(default_factory=list)
    rest: list[str] = field(default_factory=list)
    message: str = ""
    notes: tuple[str, ...] = ()
    lost_digits: str = ""
    another_robot: str = ""
    expected: str = ""
    expected_reason: str = ""
    title: str = ""

    @property
    def program(self) -> str:
        """The engine as its authors write it, with its version where it is asked for in one."""
        return program_name(self.engine, self.title)

    @property
    def subject(self) -> Annotated[str, Column("subject")]:
        return f"{self.engine}/{self.format}"

    @property
    def kind(self) -> Annotated[str, Column("called")]:
        return "aided" if self.aided else "plain"

    @property
    def dominating(self) -> Annotated[str, Column("largest reading")]:
        """The reading that moves qdd most; "" for none."""
        known = [reading for reading in self.readings if reading.alone]
        return max(known, key=lambda reading: reading.alone or 0.0).name if known else ""

    @property
    def error(self) -> float | None:
        """The worst backward error that is left where everything is accounted for, readings among it; None where nothing is compared."""
        return self.backward_error if self.left is None else self.left

    @property
    def cancels(self) -> bool:
        """True where readings that move qdd alone move nothing together: the answer agrees with the file."""
        return self.verdict == Verdict.AGREES and self.explained and any((reading.alone or 0.0) > FELT for reading in self.readings)

    @property
    def outcome(self) -> str:
        """The verdict in a word or two: "agrees", "lost digits", "explained", "misreads", "explained, digits lost", "refused",
        "unexplained".

        "another robot" is one of an engine whose reader drops all that moves, or adds joints that the file does not have.
        """
        if self.verdict == Verdict.UNSUPPORTED:
            return "refused"
        if self.another_robot:
            return "another robot"
        if self.verdict in (Verdict.AGREES, Verdict.UNDECIDED, Verdict.ERROR):
            return self.verdict
        if not self.explained:
            return "unexplained"
        if are_misread(self.readings):
            return Verdict.MISREADS.value
        if not self.lost_digits:
            return "explained"
        return "explained, digits lost" if self.readings else "lost digits"

    @property
    def is_compared(self) -> bool:
        """True where there are accelerations that can be judged."""
        return self.verdict not in (Verdict.UNSUPPORTED, Verdict.UNDECIDED, Verdict.ERROR) and not self.another_robot

    @property
    def is_answered(self) -> bool:
        """True for an answer that agrees or is explained; a refusal, and what nobody can judge, is none."""
        return self.explained and self.verdict not in (Verdict.UNSUPPORTED, Verdict.UNDECIDED) and not self.another_robot

    @property
    def as_expected(self) -> bool:
        """True for the outcome that is expected; where none is, and of an aided engine, for an answer too."""
        return self.outcome == self.expected or (self.is_answered and (self.aided or not self.expected))

    @property
    def marked(self) -> str:
        """The outcome, and what is expected where something is."""
        if not self.expected:
            return self.outcome
        if self.as_expected:
            return f"{self.outcome} (as expected: {self.expected_reason})" if self.outcome == self.expected else self.outcome
        return f"{self.outcome}, expected {self.expected} because {self.expected_reason}"

    @property
    def tone(self) -> str:
        """The looks of the outcome; what readings explain has its own, for the answer is not that of the file."""
        if not self.explained or self.another_robot:
            return "disagrees surprise"
        if self.lost_digits and self.outcome != Verdict.MISREADS:
            return f"{Verdict.UNSTABLE} expected"
        return f"{self.outcome} expected" if self.verdict == Verdict.DISAGREES else f"{self.verdict} expected"

    @property
    def marked_outcome(self) -> Annotated[Cell, Column("verdict")]:
        """The outcome with its looks."""
        return Cell(self.outcome, tone=self.tone)


@dataclass(frozen=True, kw_only=True)
class FileDifference:
    """One quantity that two files give otherwise.

    Attributes:
        what: as "mass of link forearm". first, second: its value in either file with its place. alone: what it alone does to qdd of
            the first file, relative in the energy norm; None where that is not certain.
        is_judged: False for what no equation of motion holds, and no law that is evaluated.
    """

    what: str
    first: str
    second: str
    first_place: str
    second_place: str
    alone: float | None
    is_judged: bool = True


@dataclass(frozen=True, kw_only=True)
class LockedJoint:
    """A joint of two files that stands still while the rest of both is compared, where the file writes its body down.

    Attributes:
        name: in the first file, or in the second where that alone has it. why: as "only panda.urdf moves it".
        asked: whether the user left it out, so that it is no difference. first_place, second_place: as of ``FileDifference``.
    """

    name: str
    why: str
    asked: bool
    first_place: str
    second_place: str


@dataclass(frozen=True, kw_only=True)
class PairRecord:
    """Two files held against each other.

    Attributes:
        same: whether they are one robot to ``AGREEMENT`` data roundoffs, their constraints among it. in_float32: whether those are data
            roundoffs of float32, which one of the formats holds its numbers in. backward_error, relative_error: of
            the second's truth against that of the first. problem: why they cannot be compared.
        alike: the same of what moves in both, while the joints ``locked`` stand still.
        equivalent: True where numbers differ and no acceleration feels it. remarks: on how joints were matched.
        constraints: differences in limits, dry friction, equalities, contacts and actuators. not_held: what of these could not be held
            against the other file.
    """

    first: str
    second: str
    same: bool
    in_float32: bool = False
    backward_error: float | None = None
    relative_error: float | None = None
    problem: str = ""
    alike: bool = False
    locked: list[LockedJoint] = field(default_factory=list)
    equivalent: bool = False
    differences: list[FileDifference] = field(default_factory=list)
    constraints: list[FileDifference] = field(default_factory=list)
    not_held: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


@dataclass(kw_only=True)
class FilesComparison(StudyResult):
    """Records of the files of a comparison or survey."""

    STUDY: ClassVar[str] = "comparison"

    files: list[FileRecord] = field(default_factory=list)
    subjects: list[SubjectRecord] = field(default_factory=list)
    pairs: list[PairRecord] = field(default_factory=list)
    switched_on: list[SwitchedOnRecord] = field(default_factory=list)

    @property
    def as_expected(self) -> bool:
        """True where an engine was asked about every file, every answer is as expected, and all files are one robot."""
        answers = all(subject.as_expected for subject in self.subjects) and all(one.explained for one in self.switched_on)
        # A format that no engine reads is held against the file of another.
        unasked = [file for file in self.unasked if not (file.unread and self.subjects)]
        return not unasked and answers and self.is_one_robot

    @property
    def is_one_robot(self) -> bool:
        """True where every file has a meaning, and all are one robot."""
        return not any(file.problem for file in self.files) and all(pair.same for pair in self.pairs)

    @property
    def unasked(self) -> list[FileRecord]:
        """The files about which no engine was asked."""
        asked = {subject.path for subject in self.subjects}
        return [file for file in self.files if file.path not in asked]

    def of(self, path: str) -> list[SubjectRecord]:
        """The subjects of a file."""
        return [subject for subject in self.subjects if subject.path == path]

    def switched_on_of(self, path: str) -> list[SwitchedOnRecord]:
        """The answers on a file with all on that is judged."""
        return [one for one in self.switched_on if one.path == path]

    def among(self, names: Mapping[str, str]) -> FilesComparison:
        """Records of the files called ``names``, by their paths here, under these names, without pairs."""
        parts = {
            part: [replace(one, path=names[one.path]) for one in getattr(self, part) if one.path in names]
            for part in ("files", "subjects", "switched_on")
        }
        return FilesComparison(**parts)

    def in_order(self) -> FilesComparison:
        """The same by the paths of files and the names of engines, whatever was complete first."""
        return FilesComparison(
            files=sorted(self.files, key=lambda file: file.path),
            subjects=sorted(self.subjects, key=lambda one: (one.path, one.engine, one.aided)),
            pairs=self.pairs,
            switched_on=sorted(self.switched_on, key=lambda one: (one.path, one.engine)),
        )


def names_apart(paths: Iterable[str]) -> dict[str, str]:
    """The name of each file, with as many of its folders as tell it from the others, by its whole path."""
    return dict(_names_apart(tuple(dict.fromkeys(paths))))


@functools.lru_cache(maxsize=64)
def _names_apart(paths: tuple[str, ...]) -> dict[str, str]:
    """The same, kept: a run of many files asks for the name of each by those of all."""
    parts, names = {path: Path(path).parts for path in paths}, {}
    # The last parts that two spellings of one path share tell neither of them from the other.
    ends = Counter(own[-count:] for own in {*parts.values()} for count in range(1, len(own) + 1))
    for path, own in parts.items():
        enough = (count for count in range(1, len(own)) if ends[own[-count:]] == 1)
        names[path] = str(Path(*own[-next(enough, len(own)) :]))
    return names


def short_names(found: FilesComparison) -> dict[str, str]:
    """Path of each file in the folder that all share, by its whole path."""
    shared = Path(os.path.commonpath([Path(file.path).parent for file in found.files])) if found.files else Path()
    return {file.path: str(Path(file.path).relative_to(shared)) for file in found.files}


def survey_profile(places: Sequence[str], floating_base: bool = False) -> str:
    """The profile of a survey's run, by which the history tells surveys of the same places."""
    return " ".join(["survey", *places, *(["with floating bases"] if floating_base else [])])
