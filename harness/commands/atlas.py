"""``harness atlas``."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path

import click

from harness.commands._options import (
    AS_EXPECTED,
    CRASHED,
    NOT_AS_EXPECTED,
    directory_option,
    json_option,
    library_option,
    long_time_limit_option,
    make_folder,
    told,
    workers_option,
)
from harness.commands._page import write_page


@click.command("atlas")
@click.argument("cases", nargs=-1, metavar="[CASE]...")
@click.option("--subject", "subjects", multiple=True, metavar="ENGINE/FORMAT", help="Only this subject; repeatable.")
@click.option("--motion", is_flag=True, help="Measure too when engines part in chaos, and the largest stable steps.")
@directory_option
@library_option
@json_option
@workers_option
@long_time_limit_option
@told
def command(
    cases: tuple[str, ...],
    subjects: tuple[str, ...],
    motion: bool,
    directory: Path,
    library_path: str | None,
    json_path: str | None,
    workers: int | None,
    time_limit: float,
) -> None:
    """Ask every subject along the hard CASEs, or along all of them, and add it to the report."""
    from harness.check.description import describe_run
    from harness.commands._atlas_tables import print_atlas
    from harness.commands._terminal import progress
    from harness.hard.atlas_run import AtlasRun, AtlasSettings
    from harness.hard.cases import STATES
    from harness.library import Library
    from harness.results.atlas import Atlas
    from harness.results.history import History
    from harness.results.records import write_json
    from harness.workers import Workers

    library = Library.at(library_path)
    atlas_run = AtlasRun(AtlasSettings(library=library, cases=cases, subjects=subjects, motion=motion))
    make_folder(directory)
    run = describe_run(library, STATES, 0, "atlas", ["harness", *sys.argv[1:]])
    measured = Atlas()
    with History(directory / "history.sqlite") as history:
        identifier = history.begin(run, Atlas)
        pool = Workers(workers, time_limit=time_limit)
        with pool, progress(atlas_run.expected_parts, "atlas") as advance:
            for part, found in atlas_run.parts(pool):
                history.append(identifier, found)
                measured.extend(found)
                if json_path:
                    write_json(json_path, run, [], further={"atlas": asdict(measured)})
                advance(part)
        print_atlas(run, measured)
        write_page(directory, history, library.name)
    if atlas_run.crashed:
        sys.exit(CRASHED)
    sys.exit(NOT_AS_EXPECTED if measured.unexpected or measured.problems else AS_EXPECTED)
