"""The oldest versions that are supported, installed and asked about the catalogue; the newest are beside the harness."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from catalogue import BUILT_IN
from packaging.version import Version
from support import cache_with_mechanisms, harness, harness_in_a_process

from harness.engines import describe_engines, engine_files
from harness.environments import find_environments
from harness.workers import Workers

FILES = describe_engines(BUILT_IN, Workers)
# Each oldest version with the formats that it is the oldest for.
OLDEST = sorted(
    {(name, version, model_format) for name, file in FILES.items() for model_format, version in file.oldest.items() if "@" not in name}
)
# By day a tree of each kind of joint, springs, dampers, a reflected inertia, a loop, a joint that mimics, and a reading that has changed.
BY_DAY = ("arm_2r*", "atwood", "coupled_oscillators", "four_bar", "furuta_pendulum*", "heavy_top", "spring_pendulum")


def marked(case: tuple[str, str, str]) -> pytest.MarkDecorator:
    """CI asks the oldest version of each engine in the first of its formats, the night all."""
    alike = [one for one in OLDEST if one[0] == case[0]]
    return pytest.mark.ci if case == min(alike, key=lambda one: Version(one[1])) else pytest.mark.nightly


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARNESS_CACHE", str(cache_with_mechanisms(tmp_path_factory.mktemp("environments") / "cache")))
        yield
    describe_engines(BUILT_IN, Workers)


def asked(tmp_path: Path, engine: str, version: str, model_format: str, *names: str) -> None:
    if version not in [one.version for one in find_environments(engine)]:
        done = harness("engines", "add", f"{engine}=={version}")
        assert done.returncode == 0, done.stderr
    subject = f"{engine}@{version}/{model_format}"
    done = harness_in_a_process("check", *names, "--subject", subject, "--states", "40", "--json", "out.json", cwd=tmp_path)
    records = json.loads((tmp_path / "out.json").read_text())["records"]
    assert [f"{one['system']}: {one['verdict']}: {one['message']}" for one in records if one["verdict"] != one["expected"]] == []
    assert done.returncode == 0, done.stdout + done.stderr
    assert sum(one["verdict"] == "agrees" for one in records) > len(records) / 2


@pytest.mark.parametrize(("engine", "version", "model_format"), [pytest.param(*one, marks=[marked(one)]) for one in OLDEST])
def test_the_oldest_versions_are_right_where_they_are_expected_to_be(tmp_path: Path, engine: str, version: str, model_format: str) -> None:
    asked(tmp_path, engine, version, model_format, *BY_DAY)


@pytest.mark.nightly
@pytest.mark.parametrize(("engine", "version", "model_format"), OLDEST)
def test_the_oldest_versions_are_right_on_the_whole_catalogue(tmp_path: Path, engine: str, version: str, model_format: str) -> None:
    asked(tmp_path, engine, version, model_format)


def test_the_supported_range_is_printed() -> None:
    assert {(name, version, model_format) for name, version, model_format in OLDEST} >= {
        ("mujoco", "3.3.0", "mjcf"), ("mujoco", "3.3.0", "urdf"), ("pinocchio", "2.7.0", "urdf"), ("pinocchio", "3.3.1", "mjcf"),
    }  # fmt: skip
    listed = harness("engines").stdout
    for name, version, model_format in OLDEST:
        assert f"{model_format} from {version}" in next(line for line in listed.splitlines() if line.startswith(name))
    assert engine_files(BUILT_IN)["mujoco"].too_old("3.2.7")
