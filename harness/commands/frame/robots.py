"""Shared parts of the commands on robots' files: the run, its sections on the terminal, and the JSON file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from harness.commands.frame.bracket import Bracket
from harness.commands.frame.pages import leave_page
from harness.commands.frame.terminal import print_sections

if TYPE_CHECKING:
    from harness.comparison.study import RobotComparison
    from harness.report.comparison import Section
    from harness.results.comparison import FilesComparison


def find_differing_lines(bracket: Bracket, path: str, suspects: Iterable[Path], states: int) -> None:
    """Hold files against the robot at ``path``, print which of their lines differ, and end the command; no engine is asked."""
    from harness.comparison.study import STATES, ComparisonSettings, RobotComparison
    from harness.report.comparison import pair_sections

    settings = ComparisonSettings((Path(path), *suspects), min(states, STATES), bracket.seed, bracket.floating_base, stances=())
    study = RobotComparison(settings, "diagnosis")
    found = compare_robots(bracket, study, pair_sections)
    bracket.finish(study.problems, study.crashed, found.as_expected)


def show_robot(bracket: Bracket, path: str, html_path: str | None) -> None:
    """Print what the file at ``path`` is and what no body of it can have, write the same as a page, and end the command."""
    from harness.comparison.study import ComparisonSettings, RobotComparison
    from harness.report.comparison import file_sections, render

    study = RobotComparison(ComparisonSettings((Path(path),), 1, floating_base=bracket.floating_base, stances=()), "reading")
    bracket.begin(1, "show")
    found = compare_robots(bracket, study, file_sections)
    leave_page(html_path, lambda: render(bracket.run, Path(path).name, file_sections(found)))
    bracket.finish(study.problems, study.crashed, True)


def compare_robots(bracket: Bracket, study: RobotComparison, shown: Callable[[FilesComparison], Iterable[Section]]) -> FilesComparison:
    """Run a study of robots' files that has begun: progress, JSON, and ``shown`` on standard output."""
    found: FilesComparison = bracket.complete(study, lambda: vars(study.result()))
    print_sections(shown(found))
    return found
