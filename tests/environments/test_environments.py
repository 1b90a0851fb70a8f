"""Environments: found, sorted by version and removed; whose index settings their installer follows, what it leaves behind, what it says."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from toy_engine import write_wheel

from harness import environments
from harness.environments import (
    Environment,
    available_versions,
    environment_of,
    environments_directory,
    find_environments,
    install,
    interpreter_in,
    split_name,
    the_version,
    this_python,
    versions_between,
)
from harness.errors import InvalidRequest


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path / "cache"))


def made(version: str, engine: str = "mujoco", python: str = "") -> Environment:
    one = Environment(engine, engine, version, python or this_python(), {engine: version})
    interpreter = interpreter_in(one.folder)
    interpreter.parent.mkdir(parents=True)
    interpreter.write_bytes(b"12345")
    one.describe(one.folder)
    return one


def test_nothing_is_found_where_nothing_is() -> None:
    assert find_environments() == []
    with pytest.raises(InvalidRequest, match=r"no environment holds drake; make one: harness engines add drake$"):
        environment_of("drake")


def test_versions_are_sorted_as_versions_and_the_newest_stands_for_all() -> None:
    for version in ("3.13.0", "3.3.7", "4.0.0", "4.0.0rc1"):
        made(version)
    made("2.7.0", engine="pinocchio")
    assert [one.version for one in find_environments("mujoco")] == ["3.3.7", "3.13.0", "4.0.0rc1", "4.0.0"]
    assert [one.engine for one in find_environments()] == ["mujoco"] * 4 + ["pinocchio"]
    assert environment_of("mujoco").version == "4.0.0"
    assert environment_of("mujoco", "3.3.7").name == "mujoco@3.3.7"
    with pytest.raises(InvalidRequest, match=r"mujoco 3\.4\.0; there are environments of 3\.3\.7, .*: harness engines add mujoco==3\.4\.0"):
        environment_of("mujoco", "3.4.0")


def test_a_version_may_be_named_without_its_zeros() -> None:
    for version in ("3.3.7", "3.13.0"):
        made(version)
    assert environment_of("mujoco", "3.13").version == "3.13.0"
    assert (the_version("3.13", ["3.1.3", "3.13.0"]), the_version("3.3", ["3.3.7"])) == ("3.13.0", None)
    with pytest.raises(InvalidRequest, match=r"'latest' is no version; expected one as 3\.13\.0"):
        the_version("latest", ["3.13.0"])


def test_what_is_incomplete_or_damaged_or_of_another_python_is_none() -> None:
    whole = made("1.0")
    made("1.1", python="3.9")
    half = made("1.2")
    (half.folder / "environment.json").unlink()
    damaged = made("1.3")
    (damaged.folder / "environment.json").write_text("{")
    without_interpreter = made("1.4")
    without_interpreter.interpreter.unlink()
    nameless = made("1.6")
    (nameless.folder / "environment.json").write_text((whole.folder / "environment.json").read_text().replace('"1.0"', '"latest"'))
    nameless.folder.rename(environments_directory() / nameless.folder.name.replace("1.6", "latest"))
    moved = made("1.5")
    moved.folder.rename(environments_directory() / "elsewhere")
    assert find_environments() == [whole]


def test_a_size_is_that_of_the_files_and_removing_leaves_nothing() -> None:
    one, other = made("1.0"), made("2.0")
    assert one.size() == 5 + (one.folder / "environment.json").stat().st_size
    one.remove()
    assert find_environments() == [other]
    assert not one.folder.exists()


def test_names() -> None:
    assert split_name("mujoco@3.13.0") == ("mujoco", "3.13.0")
    assert split_name("mujoco") == ("mujoco", "")
    one = Environment("mujoco", "mujoco", "3.13.0", "3.11", {})
    assert one.name == "mujoco@3.13.0"
    assert replace(one, python="3.12").folder != one.folder


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


@pytest.mark.ci
def test_versions_come_from_the_indexes_of_the_user_and_are_sorted(index: Path) -> None:
    assert available_versions("toy-engine") == ["1.0", "1.2", "1.10", "2.0"]
    assert versions_between("toy-engine", "1.2", "2.0") == versions_between("toy-engine", "1.2.0", "2") == ["1.2", "1.10", "2.0"]
    with pytest.raises(InvalidRequest, match=r"no package index offers toy-engine 1\.3; they offer 1\.0, 1\.2"):
        versions_between("toy-engine", "1.3", "2.0")
    with pytest.raises(InvalidRequest, match="expected the older version first"):
        versions_between("toy-engine", "2.0", "1.0")
    with pytest.raises(InvalidRequest, match="no-such-engine"):
        available_versions("no-such-engine")


@pytest.mark.ci
def test_what_cannot_be_installed_leaves_nothing_and_says_why(index: Path) -> None:
    with pytest.raises(InvalidRequest, match=r"toy-engine==9\.9"):
        install("toy", "toy-engine", "toy_engine", "9.9")
    assert list(environments_directory().iterdir()) == []
    assert find_environments() == []


@pytest.mark.ci
def test_what_cannot_be_imported_is_no_environment(index: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environments, "REQUIREMENTS", ())
    with pytest.raises(InvalidRequest, match="ModuleNotFoundError: No module named 'numpy'"):
        install("toy", "toy-engine", "toy_engine", "1.2")
    assert find_environments() == []


@pytest.mark.ci
def test_an_environment_replaces_one_of_its_version(index: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environments, "REQUIREMENTS", ())
    first = install("toy", "toy-engine", "json", "1.2")
    assert find_environments() == [first]
    (first.folder / "stale").touch()
    assert install("toy", "toy-engine", "json", "1.2") == first
    assert not (first.folder / "stale").exists()
    assert install("toy", "toy_engine", "json").version == "2.0"
    assert [one.version for one in find_environments("toy")] == ["1.2", "2.0"]
    assert first.installed["toy-engine"] == "1.2"


@pytest.mark.ci
def test_a_second_engine_of_one_program_shares_its_files(index: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environments, "REQUIREMENTS", ())
    first = install("toy", "toy-engine", "json", "1.2")
    shutil.rmtree(index)
    second = install("toy_step", "toy-engine", "json", "1.2.0")
    assert find_environments() == [first, second] and replace(second, engine="toy") == first
    [one, other] = [next(environment.folder.rglob("toy_engine.py")) for environment in (first, second)]
    assert one.samefile(other) and one != other
    first.remove()
    assert other.is_file() and find_environments() == [second]
    # Another version, and what it needs beside, are not there.
    for version, companions in (("1.0", []), ("1.2", ["other-engine"]), ("1.2", ["toy-engine>1.2"])):
        with pytest.raises(InvalidRequest, match="cannot do it"):
            install("toy_third", "toy-engine", "json", version, companions)


@pytest.mark.ci
def test_what_is_not_imported_is_not_compiled(index: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environments, "REQUIREMENTS", ())
    # What a clean clone's tests set for their own installation.
    monkeypatch.delenv("PIP_NO_COMPILE", raising=False)
    folder = install("toy", "toy-engine", "json", "1.2").folder
    assert [path.suffix for path in folder.rglob("toy_engine*") if path.is_file()] == [".py"]


def test_uv_gets_the_indexes_of_pip(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in environments.os.environ if name.startswith(("UV_", "PIP_"))]:
        monkeypatch.delenv(name)
    listing = (
        ":env:.index-url='https://mirror.example/simple'\n"
        "global.extra-index-url='https://one.example/a https://two.example/b'\n"
        "global.index-url='https://other.example/simple'\n"
        "global.timeout='60'\ninstall.no-index='false'\n"
    )
    monkeypatch.setattr(environments, "_output", lambda command: listing)
    assert environments._sources() == [
        "--index-url", "https://mirror.example/simple", "--extra-index-url", "https://one.example/a", "--extra-index-url",
        "https://two.example/b",
    ]  # fmt: skip
    monkeypatch.setattr(environments, "_output", lambda command: "global.no-index='1'\nglobal.find-links='wheels'\n")
    assert environments._sources() == ["--no-index", "--find-links", "wheels"]
    monkeypatch.setenv("UV_INDEX_URL", "https://of-uv.example")
    assert environments._sources() == []
