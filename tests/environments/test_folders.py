"""Environments as folders: found, sorted by version, never taken for complete when they are not, and removed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from harness.environments.folders import (
    Environment,
    environment_of,
    environments_directory,
    find_environments,
    interpreter_in,
    split_name,
    this_python,
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


def test_what_is_incomplete_or_damaged_or_of_another_python_is_none() -> None:
    whole = made("1.0")
    made("1.1", python="3.9")
    half = made("1.2")
    (half.folder / "environment.json").unlink()
    damaged = made("1.3")
    (damaged.folder / "environment.json").write_text("{")
    without_interpreter = made("1.4")
    without_interpreter.interpreter.unlink()
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
