"""``harness show --html``: a mechanism as one offline page."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

from markupsafe import Markup

from harness.report.html import environment
from harness.show.exhibit import (
    Exhibit,
    audit_table,
    comparison_of_holdings,
    coordinate_table,
    joint_table,
    parameter_table,
    whereabouts,
)
from harness.show.picture import draw
from harness.show.placement import choose_view


def render(exhibit: Exhibit, library: str, problems: Sequence[Exception]) -> str:
    """The whole page."""
    pictures: list[Markup] = []
    view = None
    if exhibit.placements is not None:
        resting, moved = exhibit.placements
        gravity = exhibit.mechanism.gravity
        view = choose_view(exhibit.placements)
        pictures = [Markup(draw(resting, [moved], view, gravity)), Markup(draw(moved, [resting], view, gravity, ghost=resting))]
    made = environment().overlay()
    made.filters = {**made.filters, "whereabouts": whereabouts}
    return made.from_string(files(__package__).joinpath("show.html").read_text("utf-8")).render(
        mechanism=exhibit.mechanism,
        library=library,
        exhibit=exhibit,
        problems=problems,
        charts=[],
        pictures=pictures,
        view=view,
        joints=joint_table(exhibit),
        audit=audit_table(exhibit),
        held=comparison_of_holdings(exhibit),
        parameters=parameter_table(exhibit.mechanism),
        coordinates=coordinate_table(exhibit.mechanism),
    )
