"""``harness diagnose``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from harness.commands._options import (
    AS_EXPECTED,
    CRASHED,
    NOT_AS_EXPECTED,
    PROFILES,
    json_option,
    library_option,
    seed_option,
    tell,
    told,
    workers_option,
)

if TYPE_CHECKING:
    from harness.records import Record
    from harness.run import CrossCheck, Settings
    from harness.subject_diagnosis import SubjectDiagnosis
    from harness.workers import Workers

# Seconds that an engine may take over one batch, and that loading and telling may take beside the diagnosis itself.
_BATCH_SECONDS = 60.0


@click.command("diagnose")
@click.argument("name")
@click.option("--mjcf", type=click.Path(), help="Stands in for the system's MJCF model.")
@click.option("--urdf", type=click.Path(), help="Stands in for the system's URDF model.")
@click.option("--subject", "subjects", multiple=True, metavar="ENGINE/FORMAT", help="Only this subject; repeatable.")
@click.option("--states", type=click.IntRange(min=1), default=PROFILES["quick"], show_default=True, help="States to compare at.")
@seed_option
@library_option
@json_option
@workers_option
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0, min_open=True),
    default=10.0,
    show_default=True,
    help="Seconds a diagnosis may take, for the model and for the textbook each.",
)
@told
def command(
    name: str,
    mjcf: str | None,
    urdf: str | None,
    subjects: tuple[str, ...],
    states: int,
    seed: int,
    library_path: str | None,
    json_path: str | None,
    workers: int | None,
    time_limit: float,
) -> None:
    """Say which engine, term and attribute make NAME disagree, with the line in the file and the value that would explain it."""
    from harness.agreement_pattern import infer_from_records
    from harness.description import describe_run
    from harness.library import Library
    from harness.records import write_json
    from harness.run import CrossCheck, Settings
    from harness.terminal import print_table
    from harness.workers import Workers

    library = Library.at(library_path)
    settings = Settings(
        library=library,
        names=(name,),
        subjects=subjects,
        states=states,
        seed=seed,
        stand_ins={form: Path(path) for form, path in (("mjcf", mjcf), ("urdf", urdf)) if path},
        examples=None,
    )
    run = describe_run(library, states, seed, "diagnose", ["harness", *sys.argv[1:]])
    pool = Workers(workers, time_limit=_BATCH_SECONDS + 2 * time_limit)
    cross_check = CrossCheck(settings, pool)
    with pool:
        records = sorted(cross_check.records(), key=lambda record: record.subject)
        wrong = [record for record in records if not record.as_expected]
        found, problems = _diagnose(pool, settings, wrong, time_limit)
    inference = infer_from_records(records)[name] if records else None
    if json_path:
        about = {"inference": None if inference is None else inference.sentence, "subjects": [one.as_json() for one in found]}
        write_json(json_path, run, records, further={"diagnosis": about})
    print_table(records)
    if inference is not None:
        click.echo(f"\n{inference.sentence}")
    _print(wrong, found)
    _end(cross_check, wrong, found, problems)


def _print(wrong: list[Record], found: list[SubjectDiagnosis]) -> None:
    """What the check said of each subject that is wrong, and its diagnosis, or that of another that reads the same file."""
    diagnoses = {one.subject: one for one in found}
    read_by = {subject.partition("/")[2]: subject for subject in diagnoses}
    for record in wrong:
        click.echo(f"\n{record.subject}")
        if record.message:
            click.echo(f"  {record.message}")
        other = read_by.get(record.subject.partition("/")[2])
        if record.subject in diagnoses:
            for line in diagnoses[record.subject].lines:
                click.echo(f"  {line}")
        elif other is not None:
            click.echo(f"  reads the same file as {other}, see there")


def _diagnose(
    pool: Workers, settings: Settings, wrong: list[Record], seconds: float
) -> tuple[list[SubjectDiagnosis], dict[str, Exception | str]]:
    """Diagnoses of the subjects that are wrong, one for each file, and why there is none by subject."""
    from harness.derivation import load_mechanism
    from harness.engines import EQUATIONS, Subject, load_engine
    from harness.errors import InvalidInput
    from harness.models import read_model
    from harness.subject_diagnosis import diagnose_subject
    from harness.tasks import Assignment
    from harness.verdict import AGREEMENT
    from harness.workers import Task

    library, (name,) = settings.library, settings.names
    chosen: dict[str, tuple[Subject, Record]] = {}
    for record in wrong:
        engine, _, model_format = record.subject.partition("/")
        subject = Subject(engine, model_format or EQUATIONS)
        # The engine whose own format it is says most about a file.
        is_native = load_engine(library, engine).formats[0] == subject.format
        if subject.format not in chosen or is_native:
            chosen[subject.format] = subject, record
    if not chosen:
        return [], {}
    mechanism = load_mechanism(library, name)
    work: list[Task] = []
    problems: dict[str, Any] = {}
    for form, (subject, record) in chosen.items():
        try:
            path = settings.stand_ins.get(form) or library.model_path(name, form) if form != EQUATIONS else None
            assignment = Assignment(library, subject, mechanism, None if path is None else read_model(path, form))
        except InvalidInput as error:
            problems[str(subject)] = error
            continue
        tolerance = max(AGREEMENT, record.expected_backward_error if record.expected != "agrees" else 0.0)
        worst = [] if record.worst_state is None else [record.worst_state]
        work.append(Task(str(subject), diagnose_subject, (assignment, settings.seed, seconds, tolerance, worst)))
    found = []
    for outcome in pool.run(work):
        if outcome.crash is not None:
            problems[outcome.task.key] = str(outcome.crash)
        elif outcome.exception is not None:
            problems[outcome.task.key] = outcome.exception
        else:
            found.append(outcome.value)
    return sorted(found, key=lambda one: one.subject), problems


def _end(cross_check: CrossCheck, wrong: list[Record], found: list[SubjectDiagnosis], problems: dict[str, Exception | str]) -> None:
    """Say why there is no diagnosis where there is none, and exit."""
    from harness.errors import InvalidInput

    crashed = cross_check.crashed
    invalid: list[Exception] = []
    for subject, problem in problems.items():
        if isinstance(problem, InvalidInput):
            invalid.append(problem)
        else:
            crashed |= isinstance(problem, str)
            click.echo(f"harness: {subject}: no diagnosis: {problem}", err=True)
    # What refuses a model that was diagnosed all the same is told by the diagnosis.
    if not found:
        invalid += [problem for problem in cross_check.problems if str(problem) not in map(str, invalid)]
    tell(invalid)
    if crashed:
        sys.exit(CRASHED)
    sys.exit(NOT_AS_EXPECTED if wrong else AS_EXPECTED)
