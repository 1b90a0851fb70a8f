"""``harness show --html``: a mechanism as one offline page."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from harness.report.html import equations
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
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"equations": equations, "whereabouts": whereabouts}
    package = files("harness")
    pictures: list[Markup] = []
    view = None
    if exhibit.placements is not None:
        resting, moved = exhibit.placements
        gravity = exhibit.mechanism.gravity
        view = choose_view(exhibit.placements)
        pictures = [Markup(draw(resting, [moved], view, gravity)), Markup(draw(moved, [resting], view, gravity, ghost=resting))]
    return environment.from_string(package.joinpath("show", "show.html").read_text("utf-8")).render(
        mechanism=exhibit.mechanism,
        library=library,
        exhibit=exhibit,
        problems=problems,
        style=Markup("\n".join(package.joinpath(*path).read_text("utf-8") for path in (("report", "style.css"), ("show", "show.css")))),
        pictures=pictures,
        view=view,
        joints=joint_table(exhibit),
        audit=audit_table(exhibit),
        held=comparison_of_holdings(exhibit),
        parameters=parameter_table(exhibit.mechanism),
        coordinates=coordinate_table(exhibit.mechanism),
    )
