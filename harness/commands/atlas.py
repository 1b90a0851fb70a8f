"""``harness atlas``."""

from __future__ import annotations

from dataclasses import asdict

import click

from harness.commands._bracket import Bracket, computing
from harness.commands._options import subjects_option
from harness.commands._page import write_page


@click.command("atlas")
@click.argument("cases", nargs=-1, metavar="[CASE]...")
@subjects_option
@click.option("--motion", is_flag=True, help="Measure too when engines part in chaos, and the largest stable steps.")
@computing(time_limit=600.0, scheduler=True, directory=True, seed=False)
def command(bracket: Bracket, cases: tuple[str, ...], subjects: tuple[str, ...], motion: bool) -> None:
    """Check every subject along families of hard cases.

    Measures all CASEs unless some are named, and adds them to the report.

    Example: harness atlas far_base --subject mujoco/mjcf
    """
    from harness.commands._atlas_tables import print_atlas
    from harness.hard.atlas_study import AtlasSettings, AtlasStudy
    from harness.hard.cases import STATES
    from harness.results.atlas import Atlas

    study = AtlasStudy(AtlasSettings(library=bracket.library, cases=cases, subjects=subjects, motion=motion))
    run, measured = bracket.begin(STATES, "atlas", Atlas), study.result()
    bracket.complete(study, lambda: {"further": {"atlas": asdict(measured)}})
    print_atlas(run, measured)
    write_page(bracket.directory, bracket.history, bracket.library.name)
    bracket.finish(study.problems, study.crashed, not (measured.unexpected or measured.problems))
