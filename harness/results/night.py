"""A night: what it was asked, which of its units are complete, and what they came to, as plain data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

from harness.results.records import Record
from harness.results.run import StudyResult, changed_versions
from harness.verdict import Verdict

PASSED, FAILED, BROKEN, LEFT_OUT = "passed", "failed", "error", "skipped"
# Stage, group and name of a case.
Key = tuple[str, str, str]
# Of the files that differ, in a sentence.
_MOST_FILES = 5


@dataclass(frozen=True, kw_only=True)
class NightSettings:
    """Settings of a night; two nights with the same settings and versions find the same, but for times.

    Attributes:
        stages: names of the stages, in their order. names: mechanisms; all for none. states: of the cross-check, per system.
        engines: asked beside those that are installed, as "mujoco@3.13.0". cases: of the atlas; all for none.
        survey: folders and packages of robots. models: how many the campaign plants faults in. motion: whether motion is measured.
        profile: of the benchmark. versions: name to text. inputs: file or room to a digest of what it holds.
    """

    stages: list[str]
    names: list[str] = field(default_factory=list)
    states: int
    seed: int
    engines: list[str] = field(default_factory=list)
    cases: list[str] = field(default_factory=list)
    survey: list[str] = field(default_factory=list)
    models: int = 0
    motion: bool = False
    profile: str = "quick"
    versions: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)

    def differences(self, now: NightSettings) -> list[str]:
        """A phrase for each thing that is otherwise in ``now``: the setting, what it was, and what it is."""
        found = []
        for name in (part.name for part in fields(self) if part.name not in ("versions", "inputs")):
            before, after = getattr(self, name), getattr(now, name)
            if before != after:
                found.append(f"{name} was {_words(before)} and is {_words(after)}")
        found += [f"{name} was {before} and is {after}" for name, before, after in changed_versions(self.versions, now.versions)]
        changed = [name for name, _, _ in changed_versions(self.inputs, now.inputs)]
        if changed:
            further = f" and {len(changed) - _MOST_FILES} more" if len(changed) > _MOST_FILES else ""
            found.append(f"the content of {', '.join(changed[:_MOST_FILES])}{further} has changed")
        return found


def _words(value: object) -> str:
    return (", ".join(map(str, value)) or "none") if isinstance(value, list) else str(value)


@dataclass(frozen=True, kw_only=True)
class BegunStage:
    """A stage whose results are kept as the study of this number."""

    stage: str
    study: int


@dataclass(frozen=True, kw_only=True)
class DoneUnit:
    """A unit of a stage that is complete; what it found was stored in the same transaction.

    Attributes:
        problems: what the user has to mend. faults: what failed in the harness. crashed: whether a process died or ran out of time.
    """

    stage: str
    unit: str
    problems: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    crashed: bool = False


@dataclass(kw_only=True)
class Night(StudyResult):
    """The course of a night; what its stages found is kept in studies of their own.

    Attributes:
        settings: one. begun: of each stage that has begun. done: of each unit that is complete. ended: one sentence, where it has ended.
    """

    STUDY: ClassVar[str] = "night"

    settings: list[NightSettings] = field(default_factory=list)
    begun: list[BegunStage] = field(default_factory=list)
    done: list[DoneUnit] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)

    def study_of(self, stage: str) -> int | None:
        """The number of the study of a stage; None for one that has not begun."""
        return next((one.study for one in self.begun if one.stage == stage), None)

    def units_of(self, stage: str) -> set[str]:
        """The units of a stage that are complete."""
        return {one.unit for one in self.done if one.stage == stage}

    @property
    def crashed(self) -> bool:
        """True where a process died or ran out of time in any unit."""
        return any(one.crashed for one in self.done)

    @property
    def problems(self) -> list[str]:
        """Problems that the user has to mend, each once."""
        return list(dict.fromkeys(problem for one in self.done for problem in one.problems))

    @property
    def faults(self) -> list[str]:
        """Failures of the harness, each once."""
        return list(dict.fromkeys(fault for one in self.done for fault in one.faults))


@dataclass(frozen=True, kw_only=True)
class Case:
    """One thing that a night found good or not, as CI counts them.

    Attributes:
        stage: its name. group: a system, hard case, robot or model. name: a subject, a method, or what was looked at.
        outcome: "passed", "failed" for what is not as expected, "error" where there is no answer, "skipped" for what cannot be asked.
        message: why, on one line; details: all lines, as the report has them. replay: command that shows it again.
        seconds: that it took, as far as it is known.
    """

    stage: str
    group: str
    name: str
    outcome: str = PASSED
    message: str = ""
    details: str = ""
    replay: str = ""
    seconds: float = 0.0

    @classmethod
    def of(cls, key: Key, wrong: Sequence[str] = (), *, outcome: str = FAILED, replay: str = "", seconds: float = 0.0) -> Case:
        """A case that is good unless there is anything ``wrong``, lines of text; ``outcome`` and ``replay`` are of one that is not."""
        case = cls(stage=key[0], group=key[1], name=key[2], seconds=seconds)
        return replace(case, outcome=outcome, message=wrong[0], details="\n".join(wrong), replay=replay) if wrong else case

    @property
    def key(self) -> Key:
        """Stage, group and name, which find the case in another night."""
        return self.stage, self.group, self.name

    @property
    def is_good(self) -> bool:
        """True unless it failed or has no answer."""
        return self.outcome in (PASSED, LEFT_OUT)

    @property
    def title(self) -> str:
        return f"{self.stage}: {self.group} {self.name}"


def case_of(record: Record, stage: str) -> Case:
    """A record of a cross-check as a case."""
    key, seconds = (stage, record.system, record.series), record.states * (record.seconds_per_state or 0.0)
    if not record.as_expected:
        outcome = BROKEN if record.verdict == Verdict.ERROR else FAILED
        return Case.of(key, record.explanation.split("\n"), outcome=outcome, replay=record.replay, seconds=seconds)
    case = Case.of(key, seconds=seconds)
    if record.verdict != Verdict.UNSUPPORTED:
        return case
    return replace(case, outcome=LEFT_OUT, message=record.expected_reason or record.message)


@dataclass(frozen=True, kw_only=True)
class NewSince:
    """Differences of a night from the one before.

    Attributes:
        worse: cases that are not good now and were, or were not there. mended: those that are good again.
        came, went: titles of good cases that are new, and of cases that are gone.
    """

    worse: list[Case]
    mended: list[Case]
    came: list[str]
    went: list[str]


def new_since(before: Iterable[Case], now: Sequence[Case]) -> NewSince:
    """The cases of ``now`` that are otherwise than ``before``."""
    known, found = {case.key: case for case in before}, {case.key: case for case in now}
    return NewSince(
        worse=[case for case in now if not case.is_good and (case.key not in known or known[case.key].is_good)],
        mended=[case for case in now if case.is_good and case.key in known and not known[case.key].is_good],
        came=[case.title for case in now if case.is_good and case.key not in known],
        went=[case.title for key, case in known.items() if key not in found],
    )
