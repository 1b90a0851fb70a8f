"""``pytest --harness-robots FOLDER``: a test for each robot's file and each engine that reads its format.

A test passes where the plain engine's answer is explained, or has the outcome that ``expected_robots.toml`` names. It fails where the
engine refuses the file, or its answer cannot be judged.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from harness import workers
from harness.comparison.collection import find_files, format_of, load_expectations
from harness.comparison.robot_library import robot_subjects
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.pytest_plugin.regression import collect_also, usage_errors
from harness.report.comparison import subject_lines
from harness.results.comparison import FilesComparison
from harness.study import complete

# States per file where --harness-states says nothing.
_STATES = 32


def register(config: pytest.Config) -> None:
    """Collect the robots of the folder that the option names.

    Raises:
        pytest.UsageError: it holds none, or its expectations cannot be used.
    """
    folder = config.invocation_params.dir / config.getoption("--harness-robots")
    with usage_errors():
        robots = _Robots(config, folder)
    config.pluginmanager.register(robots, "harness-robots")
    collect_also(config, folder)


class _Robots:
    """Compares each file once, however many of its tests are selected."""

    def __init__(self, config: pytest.Config, folder: Path) -> None:
        self.config = config
        self._paths = {path.resolve() for path in find_files([str(folder)])}
        load_expectations(folder)
        self._found: dict[Path, FilesComparison] = {}

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> RobotFile | None:
        return RobotFile.from_parent(parent, path=file_path, robots=self) if file_path.resolve() in self._paths else None

    def comparison(self, path: Path) -> FilesComparison:
        """The comparison of a file."""
        option = self.config.getoption
        if path not in self._found:
            study = RobotComparison(ComparisonSettings([path], option("--harness-states") or _STATES, option("--harness-seed")))
            limits = option("--harness-time-limit"), option("--harness-memory-limit")
            with workers.Workers(option("--harness-workers") or 1, None, *limits) as pool:
                self._found[path] = complete(study, pool)
        return self._found[path]


class RobotFile(pytest.File):
    """A robot's file, with a test for each engine that reads its format."""

    def __init__(self, *, robots: _Robots, **options: Any) -> None:
        super().__init__(**options)
        self.robots = robots

    def collect(self) -> Iterator[RobotItem]:
        model_format = format_of(self.path)
        for subject in robot_subjects():
            if subject.format == model_format:
                yield RobotItem.from_parent(self, name=str(subject), robots=self.robots)


class RobotItem(pytest.Item):
    """One plain engine on one file."""

    def __init__(self, *, robots: _Robots, **options: Any) -> None:
        super().__init__(**options)
        self.robots = robots

    def runtest(self) -> None:
        found = self.robots.comparison(self.path)
        (file,) = found.files
        if file.problem:
            pytest.fail(f"{self.path}: {file.problem}", pytrace=False)
        record = next((one for one in found.subjects if one.subject == self.name and not one.aided), None)
        if record is None:
            pytest.skip(file.remark)
        self.user_properties += [("outcome", record.outcome), ("backward_error", record.backward_error)]
        if not record.as_expected:
            pytest.fail("\n".join(subject_lines(record)), pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, f"{self.path.name}[{self.name}]"
