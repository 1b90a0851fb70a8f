"""``harness engines``: what there is and where, and environments made and removed by name."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import toy_engine
from support import harness

from harness.environments import find_environments


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with toy_engine.planted(tmp_path_factory.mktemp("toy"), {"1.0": toy_engine.RIGHT}) as root:
        yield root


def test_the_list_says_versions_places_and_what_is_known(library: Path) -> None:
    done = harness("engines", "--library", str(library), "--json", "out.json", cwd=library)
    assert done.returncode == 0, done.stderr
    listed = {one["engine"]: one for one in json.loads((library / "out.json").read_text())["engines"]}
    assert listed["toy"]["where"] == "its newest environment" and listed["toy@1.0"]["bytes"] > 100
    assert listed["mujoco"]["where"] == "beside the harness" and listed["mujoco"]["formats"]["mjcf"] == "3.3.0"
    assert listed["pinocchio"]["formats"] == {"urdf": "2.7.0", "mjcf": "3.3.1"}
    assert str(find_environments("toy")[0].folder) in done.stdout


def test_what_is_there_is_not_made_again_and_what_is_removed_is_gone(library: Path) -> None:
    toy_engine.plant("1.1")
    done = harness("engines", "add", "toy-engine==1.1", "--library", str(library), cwd=library)
    assert done.returncode == 0 and done.stdout.startswith("toy@1.1: is there")
    done = harness("engines", "remove", "toy@1.1", "--library", str(library), cwd=library)
    assert done.returncode == 0 and done.stdout.startswith("toy@1.1: removed")
    assert [one.version for one in find_environments("toy")] == ["1.0"]


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (("add",), "add takes names of engines, as mujoco==3.13.0"),
        (("list", "mujoco"), "harness engines add mujoco"),
        (("add", "mujoko"), "no engine is called 'mujoko'; did you mean 'mujoco'"),
        (("add", "mujoco>3"), "expected one as mujoco==3.13.0"),
        (("add", "mujoco==2.3.0"), "mujoco 2.3.0 is older than 3.3.0"),
        *((("add", f"mujoco=={version}"), f"{version!r} is no version; expected one as 3.13.0") for version in ("latest", "..", "!", "-e")),
        (("add", "lagrange"), "no engine is called 'lagrange'"),
        (("remove", "mujoco==3.3.0"), "no environment holds mujoco 3.3.0"),
    ],
)
def test_bad_usage_says_what_to_do(library: Path, arguments: tuple[str, ...], fragment: str) -> None:
    done = harness("engines", *arguments, cwd=library)
    assert done.returncode == 2
    assert fragment in done.stderr
