"""What a run says of itself where an extra is not installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest
from catalogue import BUILT_IN
from support import harness, make_library

from harness.crosscheck import settings
from harness.crosscheck.settings import describe_run

# By name: what README's first command installs has none of it.
EXTRA = "distributed"


@pytest.fixture
def without_extras(monkeypatch: pytest.MonkeyPatch) -> None:
    version_of = settings.version_of

    def version_without_extras(distribution: str) -> str:
        if distribution == EXTRA:
            raise PackageNotFoundError(distribution)
        return version_of(distribution)

    monkeypatch.setattr(settings, "version_of", version_without_extras)


def test_a_run_is_described_without_the_extras(without_extras: None) -> None:
    versions = describe_run(BUILT_IN, 1, 0, "check", ["harness"], "1").versions
    assert EXTRA not in versions and {"harness", "numpy", "mujoco", "pin"} <= set(versions)


def test_a_check_runs_without_the_extras(without_extras: None, tmp_path: Path) -> None:
    library = make_library(tmp_path / "library", ["bar_pendulum"])
    done = harness("check", "--library", str(library), "--states", "8", "--quantity", "accelerations")
    assert done.returncode == 0, done.stdout
