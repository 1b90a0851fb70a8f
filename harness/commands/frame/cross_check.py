"""A cross-check as a command runs it, with the causes of what is not as expected."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from harness.commands.frame.bracket import Bracket
from harness.commands.frame.terminal import (
    print_diagnoses_left,
    print_differs,
    print_further_quantities,
    print_sections,
    print_superfluous,
    print_table,
    print_unexpected,
    say,
)
from harness.results.check_conclusion import with_short_names
from harness.results.cross_check import Causes
from harness.results.records import ACCELERATIONS
from harness.verdict import SOUND, Verdict

if TYPE_CHECKING:
    from harness.comparison.study import RobotComparison
    from harness.crosscheck.run import CrossCheck
    from harness.crosscheck.settings import Settings
    from harness.results.cross_check import Cause, CrossCheckResult


# States at which quantities are compared that were not asked for by name.
BRIEF_STATES = 16
# Files of which the first sentence says what acts.
MOST_SAID = 3


def cross_check(
    bracket: Bracket,
    settings: Settings,
    quantities: Sequence[str] = (ACCELERATIONS,),
    brief: bool = False,
    robots: RobotComparison | None = None,
) -> CrossCheck:
    """Run to the end, and find why some records are not as expected; the causes are added to the result.

    One cross-check follows the other where there are several quantities; the last has the records of all, and what failed. ``brief``:
    all other quick quantities follow at a few states, for the subjects whose accelerations are sound and as expected. ``robots``:
    a comparison that was run beside, which stands in the JSON file too.
    """
    from harness.crosscheck.run import CrossCheck
    from harness.results.cross_check import CrossCheckResult

    study: CrossCheck | None = None
    for name in quantities:
        study = _followed(bracket, study, CrossCheck(settings, [name], audits=ACCELERATIONS not in quantities))
    assert study is not None
    if brief and (few := _brief(settings, study)) is not None:
        study = _followed(bracket, study, few)
    found: CrossCheckResult = study.result()
    # What engines hold is the same whatever they are asked for.
    found.differs[:] = [one for place, one in enumerate(found.differs) if one not in found.differs[:place]]
    found.records.sort(key=lambda record: (record.system, record.subject, record.quantity))
    found.causes += causes_of(bracket, study)
    bracket.keep(CrossCheckResult(systems=found.systems, superfluous=found.superfluous, differs=found.differs, causes=found.causes))
    further = {"summary": _sentence(study, quantities, robots), "causes": found.causes, "remarks": settings.library.remarks()}
    present: dict[str, Any] = {name: part for name, part in further.items() if part}
    present |= {"robots": vars(robots.result())} if robots else {}
    bracket.write_json(found.records, superfluous=found.superfluous, differs=found.differs, **present)
    return study


def _sentence(study: CrossCheck, quantities: Sequence[str], robots: RobotComparison | None) -> str:
    """The conclusion on mechanisms, or on files with what of them acts; and on the robots beside them."""
    answer: str = study.result().conclusion(quantities)
    library = study.settings.library
    if library.reads_files:
        from harness.comparison.robot_library import on_and_off
        from harness.truth.quantities import find_quantities

        asked, engines = [find_quantities()[name] for name in quantities], [one.engine for one in study.subjects]
        return " ".join([answer, *(f"{one}." for one in on_and_off(library, asked, engines)[:MOST_SAID])])
    if robots is None:
        return answer
    from harness.results.survey_conclusion import survey_summary

    return f"{answer} {survey_summary(robots.result())}"


def _followed(bracket: Bracket, before: CrossCheck | None, study: CrossCheck) -> CrossCheck:
    """A study that was run to its end, with the records of those before it."""
    if before is not None:
        _append(before, study)
    found = study.result()
    bracket.complete(study, lambda: {"records": found.records, "superfluous": found.superfluous, "differs": found.differs})
    return study


def _brief(settings: Settings, study: CrossCheck) -> CrossCheck | None:
    """The cross-check of all quick quantities but accelerations, after that of these, of the subjects whose accelerations are sound."""
    from harness.crosscheck.run import CrossCheck
    from harness.truth.quantities import find_quantities

    if settings.state is not None:
        return None
    sound = (*SOUND, Verdict.UNSTABLE, Verdict.UNSUPPORTED)
    records = study.result().records
    wrong = {(record.system, record.subject) for record in records if not record.as_expected or record.verdict not in sound}
    # What a robot's file says is all that there is of it, and its quantities are compared where they are asked for.
    modelled = [name for name in study.names if settings.library.validated_models(name)]
    names = [name for name in modelled if not _has_suspected_file(study, name, wrong)]
    if not names:
        return None
    few = replace(settings, names=names, states=min(settings.states, BRIEF_STATES))
    quick = [quantity.name for quantity in find_quantities().values() if quantity.is_quick]
    return CrossCheck(few, quick, audits=False, without=wrong)


def _has_suspected_file(study: CrossCheck, system: str, wrong: Collection[tuple[str, str]]) -> bool:
    """True where a model file has readers and each is wrong: the file is at fault, which may be the truth of other quantities."""
    by_format: dict[str, list[bool]] = {}
    for subject in study.subjects_of(system):
        by_format.setdefault(subject.format, []).append((system, str(subject)) in wrong)
    return any(all(readers) for readers in by_format.values())


def _append(before: CrossCheck, study: CrossCheck) -> None:
    """Add what was found before to what a study has found so far."""
    study.result().extend(before.result())
    for problem in before.problems:
        study.report(problem)
    study.faults += before.faults
    study.crashes |= before.crashes
    study.crashed |= before.crashed


def causes_of(bracket: Bracket, study: CrossCheck, quantity: str = ACCELERATIONS, **limits: int) -> list[Cause]:
    """Causes of the records of a quantity that are not as expected, by system and subject; ``limits`` as for ``Diagnoses``."""
    if all(record.as_expected for record in study.result().records if record.quantity == quantity):
        return []
    # A run in which all is well imports nothing of it.
    from harness.diagnosis.wanted import wanted_diagnosis

    diagnoses = wanted_diagnosis(study, quantity, **limits)
    if diagnoses is None:
        return []
    bracket.complete(diagnoses, kept=False)
    causes: list[Cause] = diagnoses.result()
    return causes


def finish(
    bracket: Bracket,
    study: CrossCheck,
    quantities: Sequence[str] = (ACCELERATIONS,),
    robots: RobotComparison | None = None,
    leave: Callable[[], None] = lambda: None,
) -> None:
    """Print the table of the quantities that were asked for, a line for the others, and what is not as expected; and exit.

    ``robots``: a comparison that the command ran beside, whose outcome counts too. ``leave`` writes what the command leaves behind.
    """
    found = study.result()
    records = with_short_names(found.records)
    asked, others = ([one for one in records if (one.quantity in quantities) is named] for named in (True, False))
    say(_sentence(study, quantities, robots), *Causes(with_short_names(found.causes)).told(), "")
    shown = print_table(asked, bracket.run, bracket.detail)
    print_further_quantities(others)
    say(*study.settings.library.remarks())
    print_unexpected([*shown, *(one for one in others if not one.as_expected or bracket.detail)])
    print_superfluous(found.superfluous)
    print_differs(found.differs)
    print_diagnoses_left(found, study.settings)
    problems, crashed, as_expected = list(study.problems), study.crashed, found.as_expected
    if robots is not None:
        from harness.report.survey import survey_sections

        say("")
        print_sections(survey_sections(robots.result(), bracket.detail))
        problems += robots.faults
        crashed, as_expected = crashed or robots.crashed, as_expected and robots.result().as_expected
    leave()
    bracket.finish(problems, crashed, as_expected, study.faults)
