"""What the commands on robots' files share: the run, its sections on the terminal, and the JSON file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from harness.commands._bracket import Bracket
from harness.commands._terminal import print_section, say

if TYPE_CHECKING:
    from harness.comparison.study import RobotComparison
    from harness.report.comparison import Section
    from harness.results.comparison import Comparison


def compare_robots(bracket: Bracket, study: RobotComparison, shown: Callable[[Comparison], Iterable[Section]]) -> Comparison:
    """Run a study of robots' files that has begun: progress, JSON, and ``shown`` on standard output."""
    found: Comparison = bracket.complete(study, lambda: study.result().to_json())
    for number, section in enumerate(shown(found)):
        say(*([""] if number else []), section.title)
        print_section(section.parts)
    return found
