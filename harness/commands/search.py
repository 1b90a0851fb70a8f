"""``harness search``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import click

from harness.commands import STUDIES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import contacts_option, quantity_option, subjects_option, takes
from harness.commands.frame.terminal import say
from harness.errors import require

SECTION = STUDIES


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Search that is asked for."""

    name: Annotated[str, click.argument("name", metavar="NAME|FILE")]
    subjects: Annotated[tuple[str, ...], subjects_option]
    quantity: Annotated[str, quantity_option]
    budget: Annotated[
        int | None, click.option("--budget", type=click.IntRange(min=1), show_default="8000", help="States to ask a subject for.")
    ]
    keep: Annotated[
        bool,
        click.option("--keep/--no-keep", default=True, show_default=True, help="Store what is found with the system, for every later run."),
    ]
    contacts: Annotated[bool, contacts_option]


@click.command("search")
@takes(SearchOptions)
@computing(time_limit=600.0, scheduler=True, floating_base=True, aided=True)
def command(bracket: Bracket, asked: SearchOptions) -> None:
    """Search for the states at which an engine is most wrong.

    The worst states of each subject are stored with the mechanism, and every later check compares them again. A robot's FILE is searched
    with its actuators, dry friction, limits and equalities on; its states are stored in hard_states/ beside it. With --contacts the search
    starts from configurations in which bodies touch, which the engine's own steps have reached.

    \b
    Examples:
      harness search puma_560
      harness search chain_10 --subject mujoco/mjcf --budget 2000 --no-keep
      harness search arm_7r --quantity mass_matrix
      harness search robot.urdf --no-keep
      harness search robot.xml --contacts --budget 800
    """
    from harness.comparison.robot_library import on_and_off
    from harness.hard.search import DEFAULT_BUDGET, SearchSettings, StateSearch
    from harness.results.hard_states import as_lines
    from harness.truth.quantities import find_quantities

    require("a search follows evolution strategies", "cma")
    bracket.choose_library([asked.name], acts=True, touches=asked.contacts)
    settings = SearchSettings(
        library=bracket.library,
        name=asked.name,
        subjects=asked.subjects,
        quantity=asked.quantity,
        budget=asked.budget or DEFAULT_BUDGET,
        seed=bracket.seed,
        keep=asked.keep,
        replay_options=bracket.replay_options,
    )
    bracket.begin(settings.budget, "search")
    study = StateSearch(settings)
    result = bracket.complete(study)
    bracket.write_json(search=result.to_json())
    engines = [subject.partition("/")[0] for subject in result.states]
    acting = [f"{one}." for one in on_and_off(bracket.library, [find_quantities()[asked.quantity]], engines)]
    say(" ".join([f"{bracket.library.label(asked.name)}: {result.sentence}.", *acting]), "", *as_lines(result))
    bracket.finish(study.problems, result.crashed, result.status == 0)
