"""The harness in other people's hands: the action, the hook of pre-commit, workflows, and what a release says of itself."""

from __future__ import annotations

import email
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from rooms import REPOSITORY

from harness.errors import EXTRAS
from harness.version import SYSTEMS, __version__

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ACTION = yaml.safe_load((REPOSITORY / "action.yml").read_text(encoding="utf-8"))
[HOOK] = yaml.safe_load((REPOSITORY / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
WORKFLOWS = {file.stem: yaml.safe_load(file.read_text(encoding="utf-8")) for file in (REPOSITORY / ".github" / "workflows").glob("*.yml")}
ROBOTS = REPOSITORY / "harness" / "robots"
# What GitHub runs a step of shell with.
BASH = ["bash", "--noprofile", "--norc", "-eo", "pipefail"]
STAND_IN = '#!/bin/sh\nexec {python} -m harness "$@"\n'
GH = '#!/bin/sh\necho "$@" >> "$CALLS"\n[ "$4" != --edit-last ]\n'
BLOB = re.compile(r"\$\{\{\s*(.+?)\s*\}\}")


# The texts, against the schemas of those who read them

SCHEMAS = {
    "action.yml": "vendor.github-actions",
    "CITATION.cff": "vendor.citation-file-format",
    ".github/workflows/*.yml": "vendor.github-workflows",
    ".github/ISSUE_TEMPLATE/[!c]*.yml": "vendor.github-issue-forms",
    ".github/ISSUE_TEMPLATE/crash.yml": "vendor.github-issue-forms",
    ".github/ISSUE_TEMPLATE/config.yml": "vendor.github-issue-config",
}


def complaints(schema: str, files: list[Path]) -> str:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stdout + done.stderr


@pytest.mark.ci
@pytest.mark.parametrize(("pattern", "schema"), SCHEMAS.items(), ids=list(SCHEMAS))
def test_a_text_for_a_service_is_as_its_schema_says(pattern: str, schema: str) -> None:
    files = sorted(REPOSITORY.glob(pattern))
    assert files
    assert complaints(schema, files) == ""


@pytest.mark.ci
def test_a_key_that_the_service_does_not_know_is_found(tmp_path: Path) -> None:
    text = (REPOSITORY / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    (tmp_path / "ci.yml").write_text(text.replace("    runs-on:", "    run-on:", 1))
    assert "run-on" in complaints("vendor.github-workflows", [tmp_path / "ci.yml"])


STEPS = {
    f"{name}: {step.get('name', number)}": step
    for name, jobs in {**{name: flow["jobs"] for name, flow in WORKFLOWS.items()}, "action": {"": ACTION["runs"]}}.items()
    for job in jobs.values()
    for number, step in enumerate(job["steps"])
    if "run" in step
}


@pytest.mark.parametrize("name", STEPS)
def test_a_step_is_a_script_without_what_others_write(name: str) -> None:
    script = STEPS[name]["run"]
    done = subprocess.run(["bash", "-n"], input=script, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "${{" not in script


# The action, step by step on a repository of two commits


class Runner:
    """The part of GitHub that runs a composite action: expressions, variables, and the files of a step."""

    def __init__(self, folder: Path, workspace: Path, event: Mapping[str, Any], **inputs: str) -> None:
        self.folder, self.workspace = folder, workspace
        self.temporary, self.summary = folder / "temporary", folder / "summary.md"
        self.outputs: dict[str, dict[str, str]] = {"python": {"python-path": sys.executable}}
        chosen = {name: str(about.get("default", "")) for name, about in ACTION["inputs"].items()} | inputs
        self._known = {f"inputs.{name}": value for name, value in chosen.items()} | {
            f"github.{name}": value for name, value in event.items()
        }
        self._known |= {"github.action_path": str(REPOSITORY), "github.token": "a token"}
        programs = self.temporary / "harness" / "bin"
        programs.mkdir(parents=True)
        for name, text in (("harness", STAND_IN.format(python=shlex.quote(sys.executable))), ("gh", GH)):
            (programs / name).write_text(text)
            (programs / name).chmod(0o755)
        # As on a machine of GitHub, nothing of this environment but the way to this package.
        self._environment = {
            "PATH": f"{programs}:/usr/local/bin:/usr/bin:/bin", "HOME": str(folder), "PYTHONPATH": str(REPOSITORY),
            "HARNESS_CACHE": os.environ["HARNESS_CACHE"], "CALLS": str(folder / "calls"), "GITHUB_ACTIONS": "true",
            "GITHUB_WORKSPACE": str(workspace), "GITHUB_STEP_SUMMARY": str(self.summary), "RUNNER_TEMP": str(self.temporary),
        }  # fmt: skip

    def value(self, expression: str) -> str:
        """Value of a name, as ``inputs.files``; unknown ones are empty, as they are there."""
        if output := re.fullmatch(r"steps\.(\w+)\.outputs\.([\w-]+)", expression):
            return self.outputs.get(output[1], {}).get(output[2], "")
        return self._known.get(expression, "")

    def is_true(self, condition: str) -> bool:
        parts = [re.fullmatch(r"([\w.-]+) (==|!=) '([^']*)'", part.strip()) for part in condition.split("&&")]
        assert all(parts), condition
        return all((self.value(part[1]) == part[3]) == (part[2] == "==") for part in parts if part)

    def run(self, *left_out: str) -> int:
        """The exit status of the first step that fails, 0 for none; ``left_out`` are names of steps."""
        for step in ACTION["runs"]["steps"]:
            if "run" not in step or step["name"] in left_out or not self.is_true(step.get("if", "github.nothing == ''")):
                continue
            assert step["shell"] == "bash"
            output = self.folder / "output"
            output.write_text("")
            given = {name: BLOB.sub(lambda found: self.value(found[1]), value) for name, value in step.get("env", {}).items()}
            done = subprocess.run(
                [*BASH, "-c", step["run"]], cwd=self.workspace, env=self._environment | given | {"GITHUB_OUTPUT": str(output)},
                capture_output=True, text=True, timeout=300, check=False,
            )  # fmt: skip
            self.outputs[step.get("id", "")] = dict(line.split("=", 1) for line in output.read_text().splitlines())
            self.said = done.stdout + done.stderr
            if done.returncode:
                return done.returncode
        return 0


def git(folder: Path, *arguments: str) -> str:
    who = {"GIT_AUTHOR_NAME": "A", "GIT_AUTHOR_EMAIL": "a@b.example", "GIT_COMMITTER_NAME": "A", "GIT_COMMITTER_EMAIL": "a@b.example"}
    command = ["git", "-c", "init.defaultBranch=main", *arguments]
    return subprocess.run(command, cwd=folder, env=os.environ | who, capture_output=True, text=True, check=True).stdout.strip()


@pytest.fixture
def pull_request(tmp_path: Path) -> tuple[Path, dict[str, str]]:
    """A workspace with a pull request that makes a forearm heavier, and its event."""
    workspace = tmp_path / "workspace"
    (workspace / "robots").mkdir(parents=True)
    for name in ("arm.urdf", "quadruped.urdf"):
        shutil.copy(ROBOTS / name, workspace / "robots")
    git(workspace, "init", "-q")
    git(workspace, "add", ".")
    git(workspace, "commit", "-qm", "base")
    base = git(workspace, "rev-parse", "HEAD")
    arm = workspace / "robots" / "arm.urdf"
    arm.write_text(arm.read_text().replace('<mass value="4"/>', '<mass value="5"/>', 1))
    git(workspace, "commit", "-qam", "a heavier forearm")
    return workspace, {"event_name": "pull_request", "event.pull_request.base.sha": base, "event.pull_request.number": "12"}


INSTALL = "Install the harness"


@pytest.mark.ci
def test_the_action_says_what_a_pull_request_changes(tmp_path: Path, pull_request: tuple[Path, dict[str, str]]) -> None:
    runner = Runner(tmp_path, *pull_request, files="robots", states="8", comment="true")
    assert runner.run(INSTALL) == 0, runner.said
    summary = runner.summary.read_text()
    assert summary.startswith("**1 of 2 robots differs from ")
    changed = [line for line in summary.splitlines() if "forearm" in line]
    assert len(changed) == 1 and "robots/arm.urdf:26" in changed[0] and "changes qdd by " in changed[0]
    assert re.search(
        r"^  - engines: mujoco/urdf agrees; pinocchio/urdf explained: joint damping \d+ %; each outcome", summary, re.MULTILINE
    )
    assert "| quadruped.urdf |" in summary
    assert runner.outputs["survey"]["status"] == "0"
    # The last comment is edited, and made where there is none.
    calls = (tmp_path / "calls").read_text().splitlines()
    assert [call.split()[:4] for call in calls] == [["pr", "comment", "12", "--edit-last"], ["pr", "comment", "12", "--body-file"]]
    assert (runner.temporary / "comment.md").read_text() == summary
    assert git(pull_request[0], "status", "--short") == ""


@pytest.mark.ci
def test_the_action_on_a_push_says_what_engines_make_of_robots(tmp_path: Path, pull_request: tuple[Path, dict[str, str]]) -> None:
    runner = Runner(
        tmp_path, pull_request[0], {"event_name": "push"}, files="robots/arm.urdf", states="8", engines="pinocchio", comment="true"
    )
    assert runner.run(INSTALL, "Install other engines and versions") == 0, runner.said
    summary = runner.summary.read_text()
    assert summary.startswith("**1 robot: ") and "| robot | dof | pinocchio |" in summary
    assert not (tmp_path / "calls").exists()


@pytest.mark.ci
@pytest.mark.parametrize(("text", "fail", "ends"), [("huge", "true", 1), ("huge", "false", 0), ("none", "false", 2)])
def test_the_action_fails_as_it_is_asked_to(
    tmp_path: Path, pull_request: tuple[Path, dict[str, str]], text: str, fail: str, ends: int
) -> None:
    """An inertia that no body has, which MuJoCo refuses; and a folder without a robot, whatever was asked."""
    arm = pull_request[0] / "robots" / "arm.urdf"
    arm.write_text(arm.read_text().replace('ixx="0.05"', 'ixx="-0.05"', 1))
    runner = Runner(tmp_path, *pull_request, files="robots" if text == "huge" else ".github", states="8", fail=fail)
    assert runner.run(INSTALL) == ends, runner.said
    summary = runner.summary.read_text()
    assert ("refused" in summary) if text == "huge" else summary.startswith("The survey of robots ended with exit status 2")


def test_engines_that_come_with_the_harness_get_no_environment(tmp_path: Path, pull_request: tuple[Path, dict[str, str]]) -> None:
    runner = Runner(tmp_path, *pull_request, engines="mujoco pinocchio mujoco==3.13.0 drake")
    (runner.temporary / "harness" / "bin" / "harness").write_text('#!/bin/sh\necho "$@" >> "$CALLS"\n')
    runner.run(INSTALL)
    calls = (tmp_path / "calls").read_text().splitlines()
    assert calls[:2] == ["engines add mujoco==3.13.0", "engines add drake"]
    assert "--subject mujoco --subject pinocchio --subject mujoco@3.13.0 --subject drake" in calls[2]


def test_every_input_of_the_action_is_used_and_described() -> None:
    used = set(re.findall(r"inputs\.([\w-]+)", str(ACTION["runs"])))
    assert used == set(ACTION["inputs"])
    assert all(about["description"] and "default" in about for about in ACTION["inputs"].values())


@pytest.mark.nightly
def test_the_action_installs_itself(tmp_path: Path, pull_request: tuple[Path, dict[str, str]]) -> None:
    runner = Runner(tmp_path, *pull_request, files="robots", states="8")
    shutil.rmtree(runner.temporary / "harness")
    assert runner.run() == 0, runner.said
    assert "forearm" in runner.summary.read_text()


# The hook


def hook(*files: Path) -> subprocess.CompletedProcess[str]:
    program, *options = shlex.split(HOOK["entry"])
    assert program in PROJECT["scripts"]
    command = [sys.executable, "-m", program, *options, *map(str, files)]
    return subprocess.run(command, cwd=files[0].parent, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.ci
def test_the_hook_passes_what_it_should_and_no_more(tmp_path: Path) -> None:
    for name in ("arm.urdf", "quadruped.urdf"):
        shutil.copy(ROBOTS / name, tmp_path)
    files = [path for path in tmp_path.iterdir() if re.search(HOOK["files"], str(path))]
    assert len(files) == 2
    done = hook(*files)
    assert done.returncode == 0, done.stdout + done.stderr
    (tmp_path / "arm.urdf").write_text((tmp_path / "arm.urdf").read_text().replace('<mass value="4"/>', '<mass value="four"/>', 1))
    done = hook(*files)
    assert done.returncode == 2
    assert re.search(r"arm\.urdf:26: .*four", done.stderr)


# What is supported, and tried

CI = WORKFLOWS["ci"]["jobs"]
PYTHONS = [one.removeprefix("Programming Language :: Python :: ") for one in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", one)]


def test_every_python_that_the_wheel_names_is_tried() -> None:
    assert CI["linux"]["strategy"]["matrix"]["python"] == PYTHONS
    assert [f"3.{minor}" for minor in range(8, 15) if SpecifierSet(PROJECT["requires-python"]).contains(f"3.{minor}")] == PYTHONS
    assert [step["with"]["python-version"] for step in CI["lowest"]["steps"] if "with" in step] == PYTHONS[:1]
    assert [step["with"]["python-version"] for step in CI["newest"]["steps"] if "with" in step] == PYTHONS[-1:]


def test_every_system_that_the_wheel_names_is_tried_and_no_other_is_let_in() -> None:
    classifiers = {one for one in PROJECT["classifiers"] if one.startswith("Operating System ::")}
    assert classifiers == {
        {"Linux": "Operating System :: POSIX :: Linux", "macOS": "Operating System :: MacOS"}[one] for one in SYSTEMS.values()
    }
    machines = {job["runs-on"].removesuffix("-latest") for job in CI.values()}
    assert machines == {{"linux": "ubuntu", "darwin": "macos"}[one] for one in SYSTEMS}


def test_the_oldest_versions_are_the_lower_bounds() -> None:
    found = runpy.run_path(str(REPOSITORY / ".ci" / "lowest.py"))["lowest"](PROJECT)
    named = {Requirement(one).name for one in PROJECT["dependencies"]}
    assert named | set(EXTRAS) - {"pxr"} | {"usd-core"} <= set(found)
    with pytest.raises(ValueError, match="has no lower bound"):
        runpy.run_path(str(REPOSITORY / ".ci" / "lowest.py"))["lowest"](PROJECT | {"dependencies": ["numpy"]})


@pytest.mark.nightly
def test_the_oldest_versions_can_be_installed_together(tmp_path: Path) -> None:
    lowest = subprocess.check_output([sys.executable, REPOSITORY / ".ci" / "lowest.py"], text=True)
    (tmp_path / "lowest.txt").write_text(lowest)
    (tmp_path / "all.txt").write_text("\n".join(line.partition("==")[0] for line in lowest.splitlines()))
    wanted = ["--python-version", PYTHONS[0], "--only-binary=:all:", "--target", str(tmp_path / "target")]
    command = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", *wanted, "-c", "lowest.txt", "-r", "all.txt"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=1200, check=False)
    assert done.returncode == 0 and "Would install" in done.stdout, done.stderr[-3000:]


def test_paths_of_the_core_are_there() -> None:
    core = WORKFLOWS["ci"]["env"]["CORE"].split()
    assert core and [path for path in core if not (REPOSITORY / path).exists()] == []


# What a release says of itself


@pytest.fixture(scope="module")
def metadata(tmp_path_factory: pytest.TempPathFactory) -> email.message.Message:
    """Metadata of a wheel that GitHub builds."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    address = {"GITHUB_SERVER_URL": "https://github.com", "GITHUB_REPOSITORY": "people/robots"}
    subprocess.run(build, cwd=REPOSITORY, env=os.environ | address, capture_output=True, check=True)
    [wheel] = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        [name] = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        return email.message_from_bytes(archive.read(name))


@pytest.mark.ci
def test_the_metadata_of_the_wheel_are_complete(metadata: email.message.Message) -> None:
    one = {"Name": PROJECT["name"], "Version": __version__, "Summary": PROJECT["description"], "License-Expression": "MIT"}
    one |= {"License-File": "LICENSE", "Requires-Python": ">=3.11", "Description-Content-Type": "text/markdown"}
    assert {name: metadata[name] for name in one} == one
    assert metadata["Author"] or metadata["Author-email"]
    assert metadata["Keywords"]
    assert metadata.get_all("Classifier") == PROJECT["classifiers"]
    assert set(metadata.get_all("Provides-Extra", [])) == {name.replace("_", "-") for name in PROJECT["optional-dependencies"]}
    assert len(metadata.get_all("Requires-Dist", [])) >= len(PROJECT["dependencies"])
    assert str(metadata.get_payload()).startswith("# rigid-body-harness")
    addresses = dict(text.split(", ") for text in metadata.get_all("Project-URL", []))
    assert set(addresses) == {"Repository", "Issues", "Changelog", "Documentation"}
    assert all(address.startswith("https://github.com/people/robots") for address in addresses.values())


def test_the_version_has_a_dated_section_and_a_citation() -> None:
    dated = re.search(r"^## \[(.+?)\] - (\d{4}-\d{2}-\d{2})$", (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"))
    assert dated is not None
    assert (dated[1], dated[2]) == (__version__, citation["date-released"])
    assert citation["version"] == __version__ and citation["license"] == PROJECT["license"]


@pytest.mark.parametrize(("tag", "ends"), [(f"v{__version__}", 0), ("v9.9.9", 1)])
def test_a_tag_without_its_version_is_no_release(tag: str, ends: int) -> None:
    [script] = [step["run"] for step in WORKFLOWS["release"]["jobs"]["build"]["steps"] if str(step.get("name")).startswith("Hold the tag")]
    done = subprocess.run([*BASH, "-c", script], cwd=REPOSITORY, env=os.environ | {"TAG": tag}, capture_output=True, text=True, check=False)
    assert (done.returncode, bool(done.stderr)) == (ends, bool(ends)), done.stderr


def test_only_what_publishes_may_publish() -> None:
    release = WORKFLOWS["release"]
    assert release["permissions"] == WORKFLOWS["ci"]["permissions"] == {"contents": "read"}
    assert "permissions" not in release["jobs"]["build"]
    assert release["jobs"]["publish"]["permissions"] == {"contents": "write", "id-token": "write", "attestations": "write"}
    # The index is that of the publishing action, which no text here names.
    assert "password" not in str(release) and "repository-url" not in str(release)
