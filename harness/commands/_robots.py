"""What the commands on robots' files share: the run, its sections on the terminal, the page and the JSON file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from harness.commands._bracket import Bracket
from harness.commands._terminal import print_section, say

if TYPE_CHECKING:
    from harness.comparison.study import RobotComparison
    from harness.report.comparison import Section
    from harness.results.comparison import Comparison


def compare_robots(
    bracket: Bracket,
    study: RobotComparison,
    name: str,
    shown: Callable[[Comparison], Iterable[Section]],
    html: Callable[[Comparison], str],
    html_path: str | None,
) -> Comparison:
    """Run a study of robots' files: progress, JSON, ``shown`` on standard output, and the page that ``html`` makes."""
    bracket.begin(study.settings.states, name)
    found: Comparison = bracket.complete(study, lambda: study.result().to_json())
    for number, section in enumerate(shown(found)):
        say(*([""] if number else []), section.title)
        print_section(section.parts)
    if html_path is not None:
        from harness.storage import write_atomically

        write_atomically(html_path, html(found))
        say("", f"page: {html_path}")
    return found
