"""``pytest --harness-robots FOLDER``: a test for each robot's file and each engine that reads its format.

A test passes where the plain engine's answer is explained, or has the outcome that ``expected_robots.toml`` names.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from harness.comparison.collection import ExpectedOutcomes
    from harness.results.comparison import FilesComparison

# States per file where --harness-states says nothing.
_STATES = 32


def register(config: pytest.Config) -> None:
    """Collect the robots of the folder that the option names.

    Raises:
        pytest.UsageError: it holds none, or its expectations cannot be used.
    """
    from harness.comparison.collection import find_files, load_expectations
    from harness.errors import InvalidInput

    folder = config.invocation_params.dir / config.getoption("--harness-robots")
    try:
        robots = _Robots(config, find_files([str(folder)]), load_expectations(folder))
    except InvalidInput as error:
        raise pytest.UsageError(str(error)) from error
    config.pluginmanager.register(robots, "harness-robots")
    if config.args_source is not pytest.Config.ArgsSource.ARGS:
        config.args[:] = []
    config.args.append(str(folder))


class _Robots:
    """Compares each file once, however many of its tests are selected."""

    def __init__(self, config: pytest.Config, paths: list[Path], expectations: ExpectedOutcomes) -> None:
        self.config, self.expectations = config, expectations
        self._paths = {path.resolve() for path in paths}
        self._found: dict[Path, FilesComparison] = {}

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> RobotFile | None:
        return RobotFile.from_parent(parent, path=file_path, robots=self) if file_path.resolve() in self._paths else None

    def comparison(self, path: Path) -> FilesComparison:
        """What is found on a file."""
        from harness.comparison.study import ComparisonSettings, RobotComparison
        from harness.study import complete
        from harness.workers import Workers

        option = self.config.getoption
        if path not in self._found:
            study = RobotComparison(ComparisonSettings([path], option("--harness-states") or _STATES, option("--harness-seed")))
            with Workers(option("--harness-workers") or 1, time_limit=option("--harness-time-limit")) as pool:
                self._found[path] = complete(study, pool)
        return self._found[path]


class RobotFile(pytest.File):
    """A robot's file, with a test for each engine that reads its format."""

    def __init__(self, *, robots: _Robots, **options: Any) -> None:
        super().__init__(**options)
        self.robots = robots

    def collect(self) -> Iterator[RobotItem]:
        from harness.comparison.collection import format_of
        from harness.comparison.robot_library import robot_subjects

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
        from harness.report.comparison import subject_lines

        found = self.robots.comparison(self.path)
        (file,) = found.files
        if file.problem:
            pytest.fail(f"{self.path}: {file.problem}", pytrace=False)
        record = next((one for one in found.subjects if one.subject == self.name and not one.aided), None)
        if record is None:
            pytest.skip(file.remark)
        expected = self.robots.expectations.of(self.path, self.name)
        self.user_properties += [("outcome", record.outcome), ("backward_error", record.backward_error)]
        if expected is not None and record.outcome != expected.outcome:
            said = f"{self.name}: {record.outcome}, expected {expected.outcome} because {expected.reason} ({self.robots.expectations.path})"
            pytest.fail("\n".join([said, *subject_lines(record)]), pytrace=False)
        if expected is None and not record.explained:
            pytest.fail("\n".join(subject_lines(record)), pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, f"{self.path.name}[{self.name}]"
