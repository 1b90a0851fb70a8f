"""Declaration of a stage of a night, and what a night asks of it."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from harness.library import Library
from harness.results.change_points import NightValue
from harness.results.night import FAILED, Case, NightSettings
from harness.results.run import StudyResult
from harness.results.trend import Cell
from harness.study import Study
from harness.workers import Workers


@dataclass(frozen=True)
class NightChoice:
    """Choice of what a night does.

    Attributes:
        library: where systems, models and engines are. settings: what was asked. subjects: of the mechanisms, all for none.
        replay_options: command-line options that say where the library is.
    """

    library: Library
    settings: NightSettings
    subjects: Sequence[str] = ()
    replay_options: Sequence[str] = ()

    @property
    def mechanisms(self) -> list[str] | None:
        """The systems that were named, without variants of their models; None where nothing was named, which means all."""
        names = self.settings.names
        return [name for name in names if not self.library.is_variant(name)] if names else None


@dataclass(frozen=True, kw_only=True)
class UnitFound:
    """All that a unit came to: its part of the result, what its user has to mend, what failed in the harness, and whether one died."""

    result: StudyResult
    problems: Sequence[Exception] = ()
    faults: Sequence[str] = ()
    crashed: bool = False


# Studies one after the other, each made when the one before is complete; ends with what the unit came to.
Steps = Generator[Study, None, UnitFound]


def one_study(
    make: Callable[[NightChoice, str], Any],
    result: Callable[[Any], StudyResult] = lambda study: study.result(),
    problems: Callable[[Any], Sequence[Exception]] = attrgetter("problems"),
) -> Callable[[NightChoice, str], Steps]:
    """The steps of a stage whose units are one study each, of which a unit's result and problems are made."""

    def steps(choice: NightChoice, unit: str) -> Steps:
        study = make(choice, unit)
        yield study
        return UnitFound(result=result(study), problems=problems(study), crashed=study.crashed)

    return steps


def cases_about(stage: str, group: str, sentences: Iterable[str], outcome: str = FAILED) -> Iterator[Case]:
    """A case that is not good for each sentence, named by what stands before its colon."""
    return (Case.of((stage, group, one.partition(":")[0]), [one], outcome=outcome) for one in dict.fromkeys(sentences))


@dataclass(frozen=True, kw_only=True)
class TrendNumbers:
    """The numbers of a stage that have a trend: the part of the result that holds them, as for ``History.read``, and how to read them."""

    part: str
    readings: Callable[[Any], Mapping[Cell, NightValue]]


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One part of a night.

    Attributes:
        name: on the command line and in the history.
        kind: of the results, which the history keeps as a study of their own.
        time_limit: seconds that a task may take.
        units: what there is to do; none where nothing was asked of the stage.
        steps: the studies of one unit.
        cases: the results as CI counts them.
        profile, states: of the run in the history, by which runs are told that can be compared.
        is_timed: whether its times are compared: one unit after the other, on this machine even where there is a cluster.
        closing: what follows from all units together, once they are complete; the last thing that is stored.
        problems: of the library as a whole, which belong to no unit.
        numbers: that have a trend from night to night.
    """

    name: str
    kind: type[StudyResult]
    time_limit: float
    units: Callable[[NightChoice], Sequence[str]]
    steps: Callable[[NightChoice, str], Steps]
    cases: Callable[[Any], Iterable[Case]]
    profile: Callable[[NightChoice], str] = lambda choice: "nightly"
    states: Callable[[NightChoice], int] = lambda choice: choice.settings.states
    is_timed: bool = False
    closing: Callable[[NightChoice, Any, Workers], StudyResult] | None = None
    problems: Callable[[NightChoice], Iterable[Exception]] = lambda choice: ()
    numbers: TrendNumbers | None = None
