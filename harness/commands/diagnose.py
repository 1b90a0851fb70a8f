"""``harness diagnose``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import click

from harness.commands import MECHANISM
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.cross_check import causes_of
from harness.commands.frame.options import quantity_option, stand_in_options, states_option, subjects_option, takes
from harness.commands.frame.pages import tell
from harness.commands.frame.terminal import print_diagnoses, print_differs, print_superfluous, print_table, say, say_wrapped
from harness.errors import InvalidInput, InvalidRequest
from harness.results.detail import Detail
from harness.results.diagnosis_conclusion import conclude_diagnosis
from harness.results.readings import reading_lines
from harness.results.records import quantity_words
from harness.results.table import counted, grouped
from harness.verdict import Verdict

SECTION = MECHANISM


@dataclass(frozen=True, kw_only=True)
class DiagnoseOptions:
    """Diagnosis that is asked for."""

    name: Annotated[str, click.argument("name", metavar="NAME|FILE")]
    stand_ins: Annotated[Mapping[str, Path], stand_in_options]
    subjects: Annotated[tuple[str, ...], subjects_option]
    quantity: Annotated[str, quantity_option]
    states: Annotated[int, states_option()]
    evaluations: Annotated[
        int | None,
        click.option("--evaluations", type=click.IntRange(min=1), help="Changed models that a diagnosis may try; 1500 by default."),
    ]


@click.command("diagnose")
@takes(DiagnoseOptions)
@computing(time_limit=60.0, floating_base=True, aided=True, detail=True)
def command(bracket: Bracket, asked: DiagnoseOptions) -> None:
    """Explain why a check of NAME is red.

    The output begins with the engine or model at fault, and with what to write at which line. The wrong terms
    and everything that explains the answers follow; --verbose adds what nearly does.
    For a robot's FILE, it names what the engines' readers make of the file. With --mjcf, --urdf or --usd, FILE
    is the truth and the other file is suspected: the lines that differ are named, the one that changes the
    accelerations most first. For quantities other than accelerations, it names the wrong blocks, since when
    they are wrong, and the number of the file that explains it.

    \b
    Examples:
      harness diagnose double_pendulum --mjcf edited.xml
      harness diagnose arm_2r --library mine --subject pinocchio/urdf
      harness diagnose arm_2r --quantity mass_matrix --urdf edited.urdf
      harness diagnose robot.urdf --mjcf robot.xml
      harness diagnose robot.xml --usd robot.usda
    """
    from harness.crosscheck.assignment import refuse_robots
    from harness.crosscheck.run import CrossCheck
    from harness.crosscheck.settings import Settings
    from harness.diagnosis.causes import find_differences
    from harness.explain.pattern import infer_from_records
    from harness.truth.quantities import require_quantity

    require_quantity(asked.quantity)
    bracket.choose_library([asked.name], acts=True)
    if quantity_words(asked.quantity):
        refuse_robots(bracket.library, asked.name, asked.quantity)
        if asked.evaluations is not None:
            raise InvalidRequest("--evaluations counts changed models of a diagnosis of accelerations; leave it out")
    has_models = bool(bracket.library.validated_models(asked.name))
    if asked.evaluations is not None and not has_models:
        raise InvalidRequest("--evaluations counts changed models, of which the diagnosis of a robot's file makes none; leave it out")
    if asked.stand_ins and not has_models:
        # The file is the truth itself, and another file no model of it but a robot of its own.
        if asked.subjects:
            raise InvalidRequest("--subject chooses engines, and none is asked where files are held against each other; leave it out")
        _find_differing_lines(bracket, Path(asked.name), asked.stand_ins.values(), asked.states)
    settings = Settings(
        library=bracket.library,
        names=(asked.name,),
        subjects=asked.subjects,
        states=asked.states,
        seed=bracket.seed,
        stand_ins=asked.stand_ins,
        examples=None,
    )
    bracket.begin(asked.states, "diagnose")
    study = CrossCheck(settings, [asked.quantity])
    found = bracket.complete(study)
    found.records.sort(key=lambda record: record.subject)
    causes = causes_of(bracket, study, asked.quantity, **({} if asked.evaluations is None else {"evaluations": asked.evaluations}))
    held = find_differences(settings, asked.name, bracket.pool) if causes else []
    inference = infer_from_records(found.records)[asked.name].sentence
    sentence = conclude_diagnosis(asked.name, found.records, causes, inference, [*map(str, held)])
    bracket.write_json(found.records, summary=sentence, superfluous=found.superfluous, causes=causes, held=held)
    say_wrapped(sentence, "")
    wrong = [record for record in found.records if bracket.detail > Detail.BRIEF or record.verdict != Verdict.AGREES]
    if wrong:
        print_table(wrong, bracket.run, bracket.detail)
    if agreeing := len(found.records) - len(wrong):
        say(f"{counted(agreeing, 'subject')} {'agrees' if agreeing == 1 else 'agree'} (--all)")
    print_superfluous(found.superfluous)
    failed = grouped((record.message, record.subject) for record in found.records if record.verdict == Verdict.ERROR)
    for message, subjects in failed.items():
        say_wrapped("", f"{', '.join(subjects)}: {message}")
    for record in found.records:
        if record.readings:
            lines = reading_lines(record.readings, bracket.detail)
            say_wrapped("", f"{record.subject}: {record.verdict}", *(f"  {line}" for line in lines))
    if causes:
        print_diagnoses(causes, held, bracket.detail)
    else:
        print_differs(found.differs)
    # The diagnosis has said what the audit refuses of a file that was diagnosed all the same.
    diagnosed = {cause.found["model"]["file"] for cause in causes if cause.found and cause.found["model"]}
    problems = [problem for problem in study.problems if not (isinstance(problem, InvalidInput) and str(problem.path) in diagnosed)]
    bracket.finish(problems, study.crashed, found.as_expected, study.faults)


def _find_differing_lines(bracket: Bracket, path: Path, suspects: Iterable[Path], states: int) -> None:
    """Hold files against the robot at ``path``, print which of their lines differ, and end the command; no engine is asked."""
    from harness.comparison.study import ComparisonSettings, RobotComparison
    from harness.explain.meant import STATES
    from harness.report.comparison import told
    from harness.results.pair_conclusion import summary

    bracket.begin(states, "diagnose")
    settings = ComparisonSettings((path, *suspects), min(states, STATES), bracket.seed, bracket.floating_base, stances=())
    study = RobotComparison(settings, "diagnosis")
    found = tell(bracket, study, told, summary)
    bracket.finish(study.problems, study.crashed, found.is_one_robot)
