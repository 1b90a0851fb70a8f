"""The comparison of one or several robots' files, as a study for worker processes.

A file is read and its truth certified in one task; each engine is asked in tasks of its own, plain and aided; each answer is judged in
a task beside the truth.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from harness.comparison.collection import expected_outcomes
from harness.comparison.judgement import judge, subject_of
from harness.comparison.matching import refuse_unknown
from harness.comparison.robot_library import ask_engine, engine_of, robot_at, robot_subjects
from harness.comparison.sameness import hold_against
from harness.comparison.switched_on import judge_switched_on
from harness.engines.request import EngineAnswers
from harness.errors import InvalidInput, InvalidModel, InvalidRequest
from harness.explain.meant import STATES, Meant, meant, question_of
from harness.explain.switches import has_switches
from harness.library import Stance
from harness.results.comparison import FileRecord, FilesComparison, PairRecord, SubjectRecord
from harness.results.switched_on import SwitchedOnRecord
from harness.study import Inquiry, Study, ask, call
from harness.verdict import Verdict


@dataclass(frozen=True)
class ComparisonSettings:
    """The comparison that is asked for.

    Attributes:
        paths: the files. states: per file. floating_base: whether a free joint is put under the roots of URDFs.
        renamed: {joint of the first file: its name in another}. without: joints that stand still where files are held against each
            other. pairs: files that are held against each other, the second against the first; by default each further one against the
            first of ``paths``.
        stances: of the engines; none where no engine is asked.
        subjects: names of those that are asked; for none every one that is installed anywhere.
    """

    paths: Sequence[Path]
    states: int = STATES
    seed: int = 0
    floating_base: bool = False
    renamed: Mapping[str, str] = field(default_factory=dict)
    without: Sequence[str] = ()
    pairs: Sequence[tuple[Path, Path]] | None = None
    stances: Sequence[Stance] = tuple(Stance)
    subjects: Sequence[str] = ()


class RobotComparison(Study):
    """Every file with every engine that reads its format, plain and aided.

    Raises:
        InvalidRequest: from the constructor, for a subject that is none.
        InvalidInput: from it too, for expected outcomes that cannot be used.
    """

    found: FilesComparison

    def __init__(self, settings: ComparisonSettings, title: str = "comparison") -> None:
        super().__init__(FilesComparison())
        self.settings, self.title = settings, title
        self._subjects = robot_subjects(settings.subjects) if settings.stances else []
        self._expected = expected_outcomes(settings.paths) if settings.stances else {}
        self._meant: dict[Path, Meant] = {}
        self.steps = len(settings.paths) * (1 + len(settings.stances) * len({one.engine for one in self._subjects}))

    def result(self) -> FilesComparison:
        order = {str(path): place for place, path in enumerate(self.settings.paths)}
        self.found.files.sort(key=lambda file: order[file.path])
        self.found.subjects.sort(key=lambda one: (order[one.path], one.engine, one.aided))
        self.found.switched_on.sort(key=lambda one: (order[one.path], one.engine))
        return self.found

    @property
    def faults(self) -> list[Exception]:
        """The problems that are not of a file alone, which a survey reports in its row."""
        return [problem for problem in self.problems if not isinstance(problem, InvalidModel)]

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        settings = self.settings
        if settings.renamed or settings.without:
            yield [self._known()]
        yield [self._compared(path) for path in settings.paths]
        pairs = [(settings.paths[0], other) for other in settings.paths[1:]] if settings.pairs is None else settings.pairs
        yield [self._held(first, second) for first, second in pairs if first in self._meant and second in self._meant]

    def _known(self) -> Inquiry[None]:
        """Raises InvalidRequest for joints that the user names and that no file has, before anything else is asked."""
        settings = self.settings
        outcome = yield from ask(call, _refuse_unknown, settings.paths, settings.floating_base, settings.renamed, settings.without)
        if isinstance(outcome.exception, InvalidRequest):
            raise outcome.exception

    def _compared(self, path: Path) -> Inquiry[None]:
        """One file: what it is, and each engine asked by itself, so that one that aborts or hangs costs its own record."""
        settings = self.settings
        outcome = yield from ask(call, _prepare, path, settings.floating_base, settings.states, settings.seed, affinity=path)
        if outcome.value is None:
            failure = self.failure(outcome)
            problem = _words(outcome.exception) if isinstance(outcome.exception, InvalidInput) else failure
            yield self.kept(path.name, FilesComparison(files=[FileRecord(path=str(path), problem=problem)]))
            return
        found = self._meant[path] = outcome.value
        for engine in (one.engine for one in self._subjects if found.robot.format == one.format and found.joints):
            for stance in (one for one in settings.stances if one == Stance.PLAIN or found.certified is not None):
                self._begin(self._asked(found, engine, stance))
        yield self.kept(path.name, FilesComparison(files=[_file_record(found, dict.fromkeys(one.engine for one in self._subjects))]))

    def _asked(self, found: Meant, engine: str, stance: Stance) -> Inquiry[None]:
        """One engine in one stance on a file, judged beside the file's truth."""
        path, caller = found.robot.path, engine_of(engine)
        about = subject_of(found, caller, stance)
        outcome = yield from ask(call, ask_engine, engine, question_of(found.rounded(caller.unit_roundoff), stance))
        answers: EngineAnswers = outcome.value
        if failure := self.failure(outcome):
            record = SubjectRecord(**about, verdict=Verdict.ERROR, explained=False, message=failure)
        else:
            outcome = yield from ask(call, judge, found, answers, engine, stance, affinity=path)
            failed = self.failure(outcome)
            record = SubjectRecord(**about, verdict=Verdict.UNDECIDED, explained=False, message=failed) if failed else outcome.value
        if (entry := self._expected.get((path, record.subject))) is not None:
            record = replace(record, expected=entry.outcome, expected_reason=entry.reason)
        yield self.kept(f"{path.name} {record.subject}", FilesComparison(subjects=[record]))
        if not failure and has_switches(found.robot) and found.certified is not None and stance == Stance.PLAIN and not answers.refusal:
            outcome = yield from ask(call, judge_switched_on, found, engine, affinity=path)
            held = outcome.value
            if failure := self.failure(outcome):
                model_format = found.robot.format
                held = SwitchedOnRecord(path=str(path), engine=engine, format=model_format, parts=[], explained=False, message=failure)
            yield self.kept(f"{path.name} {held.subject} with all on", FilesComparison(switched_on=[held]))

    def _held(self, first: Path, second: Path) -> Inquiry[None]:
        """The second file against the first."""
        settings, robot = self.settings, self._meant[second].robot
        outcome = yield from ask(call, hold_against, self._meant[first], robot, settings.renamed, settings.without, affinity=first)
        failure = self.failure(outcome)
        record = PairRecord(first=str(first), second=str(second), same=False, problem=failure) if failure else outcome.value
        yield self.kept(f"{first.name} {second.name}", FilesComparison(pairs=[record]))


def _words(problem: InvalidInput) -> str:
    return f"line {problem.line}: {problem.problem}" if problem.line is not None else problem.problem


def _file_record(found: Meant, engines: Iterable[str]) -> FileRecord:
    robot, asked = found.robot, [one for one in map(engine_of, engines) if found.robot.format in one.formats]
    left_out = [
        replace(part, beside_tau=tuple(told for one in asked if (told := one.beside_tau.get(part.what)))) for part in robot.left_out
    ]
    return FileRecord(
        path=str(robot.path),
        format=robot.format,
        bodies=robot.bodies,
        joints=len(robot.tree.joints),
        followers=len(robot.tree.joints) - len(robot.joints),
        degrees_of_freedom=robot.degrees_of_freedom,
        total_mass=robot.total_mass,
        gravity=tuple(float(component) for component in robot.tree.gravity),
        states=len(found.states),
        undecided=0 if found.certified is None else int((~found.certified.certified).sum()),
        remark=found.undetermined,
        meshes=robot.meshes,
        left_out=left_out,
        impossible=list(robot.impossible),
        trunk=robot.trunk_on_the_world,
        unread=not asked,
    )


def _refuse_unknown(paths: Sequence[Path], floating_base: bool, renamed: Mapping[str, str], without: Sequence[str]) -> None:
    """As ``refuse_unknown``; of a file that cannot be read the comparison itself tells."""
    with contextlib.suppress(InvalidInput):
        refuse_unknown([robot_at(path, floating_base) for path in paths], renamed, without)


def _prepare(path: Path, floating_base: bool, count: int, seed: int) -> Meant:
    return meant(robot_at(path, floating_base), count, seed)
