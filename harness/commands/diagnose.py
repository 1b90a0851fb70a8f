"""``harness diagnose``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from harness.commands._cross_check import causes_of
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
    default=60.0,
    show_default=True,
    help="Seconds after which an engine or a diagnosis is ended as hanging.",
)
@click.option("--evaluations", type=click.IntRange(min=1), help="Changed models that a diagnosis may try; 1500 by default.")
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
    evaluations: int | None,
) -> None:
    """Say which engine, term and attribute make NAME disagree, with the line in the file and the value that would explain it."""
    from harness.check.description import describe_run
    from harness.check.run import CrossCheck
    from harness.check.settings import Settings
    from harness.commands._terminal import print_diagnoses, print_superfluous, print_table
    from harness.diagnose.causes import find_differences
    from harness.diagnose.pattern import infer_from_records
    from harness.library import Library
    from harness.results.records import write_json
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
    pool = Workers(workers, time_limit=time_limit)
    cross_check = CrossCheck(settings, pool)
    with pool:
        records = sorted(cross_check.records(), key=lambda record: record.subject)
        causes = causes_of(cross_check, records, pool, **({} if evaluations is None else {"evaluations": evaluations}))
        held = find_differences(settings, name, pool) if causes else []
    if json_path:
        further = {"causes": [cause.as_json() for cause in causes], "held": [difference.as_json() for difference in held]}
        write_json(json_path, run, records, superfluous=cross_check.superfluous, further=further)
    print_table(records)
    print_superfluous(cross_check.superfluous)
    if causes:
        print_diagnoses(causes, held)
    else:
        click.echo(f"\n{infer_from_records(records)[name].sentence}")
    # What the audit refuses of a file that was diagnosed all the same, the diagnosis tells.
    diagnosed = {cause.found["model"]["file"] for cause in causes if cause.found and cause.found["model"]}
    tell([problem for problem in cross_check.problems if str(problem.path) not in diagnosed])
    if cross_check.crashes:
        sys.exit(CRASHED)
    as_expected = all(record.as_expected for record in records) and not cross_check.superfluous
    sys.exit(AS_EXPECTED if as_expected else NOT_AS_EXPECTED)
