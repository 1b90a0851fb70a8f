"""The command that a file of tests is about, as ``invoke``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from harness.cli import main


@pytest.fixture
def invoke(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Runs the command that the file of the test is named for, with the given arguments, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    command = request.path.stem.removeprefix("test_")
    return lambda *arguments: CliRunner().invoke(main, [command, *arguments])
