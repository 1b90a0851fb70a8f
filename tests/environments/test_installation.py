"""The installer: whose index settings it follows, what it leaves behind, and what it says."""

from __future__ import annotations

from pathlib import Path

import pytest
from toy_engine import write_wheel

from harness.environments import installation
from harness.environments.folders import environments_directory, find_environments
from harness.environments.installation import available_versions, install, versions_between
from harness.errors import InvalidRequest


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of wheels that is all there is."""
    folder = tmp_path / "wheels"
    folder.mkdir()
    for version in ("1.0", "1.2", "1.10", "2.0rc1", "2.0"):
        write_wheel(folder, version)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    return folder


@pytest.mark.costly
def test_versions_come_from_the_indexes_of_the_user_and_are_sorted(index: Path) -> None:
    assert available_versions("toy-engine") == ["1.0", "1.2", "1.10", "2.0"]
    assert versions_between("toy-engine", "1.2", "2.0") == ["1.2", "1.10", "2.0"]
    with pytest.raises(InvalidRequest, match=r"no package index offers toy-engine 1\.3; they offer 1\.0, 1\.2"):
        versions_between("toy-engine", "1.3", "2.0")
    with pytest.raises(InvalidRequest, match="expected the older version first"):
        versions_between("toy-engine", "2.0", "1.0")
    with pytest.raises(InvalidRequest, match="no-such-engine"):
        available_versions("no-such-engine")


def test_what_cannot_be_installed_leaves_nothing_and_says_why(index: Path) -> None:
    with pytest.raises(InvalidRequest, match=r"toy-engine==9\.9"):
        install("toy", "toy-engine", "toy_engine", "9.9")
    assert list(environments_directory().iterdir()) == []
    assert find_environments() == []


@pytest.mark.costly
def test_what_cannot_be_imported_is_no_environment(index: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "REQUIREMENTS", ())
    with pytest.raises(InvalidRequest, match="ModuleNotFoundError: No module named 'numpy'"):
        install("toy", "toy-engine", "toy_engine", "1.2")
    assert find_environments() == []


@pytest.mark.costly
def test_an_environment_replaces_one_of_its_version(index: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "REQUIREMENTS", ())
    first = install("toy", "toy-engine", "json", "1.2")
    assert find_environments() == [first]
    (first.folder / "stale").touch()
    assert install("toy", "toy-engine", "json", "1.2") == first
    assert not (first.folder / "stale").exists()
    assert install("toy", "toy_engine", "json").version == "2.0"
    assert [one.version for one in find_environments("toy")] == ["1.2", "2.0"]
    assert first.installed["toy-engine"] == "1.2"


def test_what_is_not_imported_is_not_compiled(index: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "REQUIREMENTS", ())
    # What a clean clone's tests set for their own installation.
    monkeypatch.delenv("PIP_NO_COMPILE", raising=False)
    folder = install("toy", "toy-engine", "json", "1.2").folder
    assert [path.suffix for path in folder.rglob("toy_engine*") if path.is_file()] == [".py"]


def test_uv_gets_the_indexes_of_pip(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in installation.os.environ if name.startswith(("UV_", "PIP_"))]:
        monkeypatch.delenv(name)
    listing = (
        ":env:.index-url='https://mirror.example/simple'\n"
        "global.extra-index-url='https://one.example/a https://two.example/b'\n"
        "global.index-url='https://other.example/simple'\n"
        "global.timeout='60'\ninstall.no-index='false'\n"
    )
    monkeypatch.setattr(installation, "_output", lambda command: listing)
    assert installation._sources() == [
        "--index-url", "https://mirror.example/simple", "--extra-index-url", "https://one.example/a", "--extra-index-url",
        "https://two.example/b",
    ]  # fmt: skip
    monkeypatch.setattr(installation, "_output", lambda command: "global.no-index='1'\nglobal.find-links='wheels'\n")
    assert installation._sources() == ["--no-index", "--find-links", "wheels"]
    monkeypatch.setenv("UV_INDEX_URL", "https://of-uv.example")
    assert installation._sources() == []
