"""``harness atlas``."""

from __future__ import annotations

import click

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import quantities_option, subjects_option
from harness.commands.frame.pages import write_page
from harness.commands.frame.terminal import print_sentences, print_titled, say
from harness.errors import require

SECTION = STUDIES


@click.command("atlas")
@click.argument("cases", nargs=-1, metavar="[CASE]...")
@subjects_option
@quantities_option("accelerations")
@click.option("--motion", is_flag=True, help="Measure too when engines part in chaos, and the largest stable steps.")
@click.option("--contact", is_flag=True, help="Measure too how far motions with contacts are from rigid ones.")
@computing(time_limit=600.0, scheduler=True, directory=True, seed=False, detail=True)
def command(
    bracket: Bracket, cases: tuple[str, ...], subjects: tuple[str, ...], quantities: tuple[str, ...], motion: bool, contact: bool
) -> None:
    """Make mechanisms harder until engines break.

    Each CASE turns one knob, such as a stiffness or the number of links. All of `harness list cases` are measured unless some are named,
    and the results go into the report.

    \b
    Examples:
      harness atlas
      harness atlas far_base --subject mujoco/mjcf
      harness atlas --quantity mass_matrix --quantity energy
      harness atlas stiff_spring --motion --out atlas
      harness atlas stiff_spring --contact
    """
    from harness.hard.atlas import CONTACT, MOTION, AtlasStudy
    from harness.hard.cases import STATES
    from harness.report import hard_cases as tables
    from harness.report.hard_cases import HardSummary
    from harness.results.atlas import Atlas

    require("an atlas has charts", "bokeh", *(["heyoka"] if motion else []))
    beside = [MOTION] * motion + [CONTACT] * contact
    study = AtlasStudy(bracket.library, cases, subjects, beside, quantities=quantities)
    run, measured = bracket.begin(STATES, "atlas", Atlas), study.result()
    bracket.complete(study, lambda: {"atlas": measured})
    summary = HardSummary(run, measured)
    say(summary.sentence)
    print_sentences(summary)
    shown = summary.shown(bracket.detail)
    print_titled("hard cases", tables.rows_of(shown).without("time"))
    print_titled("motions that part", tables.partings(summary).without("largest distance"))
    print_titled("worst distances from rigid contact along each mechanism", tables.distances(summary, bracket.detail))
    print_titled("growth of distances from rigid contact, values from gentle to hard", tables.laws(summary))
    print_titled("largest stable step times the frequency of an undamped spring", tables.stable_steps(summary))
    if any(family.reasons for family in shown.families):
        say("")
    for family in shown.families:
        for asked, why in family.reasons:
            places = ", ".join([family.name, *asked])
            say(f"{places}: {why.verdict} is expected: {why.reason}; {why.remedy} ({why.link})")
    if left_out := len(measured.rows) - len(shown.atlas.rows):
        say("", f"--all shows {left_out} pairs of family and subject that agree")
    write_page(bracket)
    bracket.finish(study.problems, study.crashed, summary.is_good)
