"""What README and CONTRIBUTING promise: two commands, a Python API, and a walk-through that ends green."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from support import Done, harness

REPOSITORY = Path(__file__).resolve().parents[1]
README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
# A line that names the file in backquotes, then the fenced block with its content.
NAMED_BLOCK = re.compile(r"^`(?P<path>mine/\S+)`:\n\n```\w+\n(?P<content>.*?)^```$", re.MULTILINE | re.DOTALL)
SHELL_BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\((?!https?://|#)([^)#]+)")


@pytest.fixture(scope="module")
def walk_through(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every file that CONTRIBUTING spells out."""
    folder = tmp_path_factory.mktemp("walk-through")
    for command in SHELL_BLOCK.findall(CONTRIBUTING):
        if command.startswith("harness new"):
            done = harness(*command.split()[1:], cwd=folder)
            assert done.returncode == 0, done.stderr
    made = ["crba.py", "inverted_bar.py", "inverted_bar.urdf", "inverted_bar.xml"]
    assert sorted(path.name for path in folder.rglob("*.*")) == made
    for block in NAMED_BLOCK.finditer(CONTRIBUTING):
        path = folder / block["path"]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block["content"], encoding="utf-8")
    return folder


def check(folder: Path, *arguments: str) -> Done:
    return harness("check", "--library", "mine", *arguments, cwd=folder)


def test_readme_has_two_commands_of_one_line_and_marks_the_one_that_tests() -> None:
    commands = SHELL_BLOCK.findall(README)
    assert [len(command.splitlines()) for command in commands] == [1, 1]
    report, tests = commands
    assert report.rstrip().endswith("harness report")
    assert tests.rstrip().endswith("pytest")
    assert README.count(f"<!-- test command -->\n```sh\n{tests}```\n") == 1
    assert README.count("<!-- test command -->") == 1


def test_readme_comes_to_the_commands_soon() -> None:
    assert len(README.partition("## Run it")[0].split()) <= 200


def test_readme_s_python_runs(capsys: pytest.CaptureFixture[str]) -> None:
    [block] = re.findall(r"^<!-- python api -->\n```python\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
    exec(compile(block, "README.md", "exec"), {"__name__": "readme"})
    assert "agrees" in capsys.readouterr().out


def test_every_module_on_the_way_of_a_state_is_there() -> None:
    [block] = re.findall(r"^<!-- way of a state -->\n```text\n(.*?)^```$", CONTRIBUTING, re.MULTILINE | re.DOTALL)
    modules = re.findall(r"\b[\w/]+\.py\b", block)
    assert len(modules) > 5
    assert [module for module in modules if not (REPOSITORY / "harness" / module).is_file()] == []


@pytest.mark.parametrize("text", [README, CONTRIBUTING], ids=["README", "CONTRIBUTING"])
def test_links_lead_to_files(text: str) -> None:
    links = LINK.findall(text)
    assert [link for link in links if not (REPOSITORY / link).is_file()] == []


def test_walk_through_ends_green_for_mechanism_and_engine(walk_through: Path) -> None:
    result = check(walk_through)
    assert result.returncode == 0, result.stdout + result.stderr
    for subject in ("crba/urdf", "lagrange", "mujoco/mjcf", "pinocchio/urdf"):
        assert re.search(rf"^inverted_bar +{subject} .* agrees ", result.stdout, re.MULTILINE), result.stdout


def test_walk_through_turns_red_where_it_says_so(walk_through: Path) -> None:
    [edit] = [command for command in SHELL_BLOCK.findall(CONTRIBUTING) if command.startswith("sed ")]
    subprocess.run(edit.splitlines()[0], shell=True, cwd=walk_through, check=True)
    result = check(walk_through, "inverted_bar", "--urdf", "edited.urdf", "--subject", "pinocchio/urdf")
    assert result.returncode == 1, result.stdout + result.stderr
    assert "inverted_bar pinocchio/urdf: disagrees, expected agrees" in result.stdout
    assert "edited.urdf:25: <springStiffness>2.50001</springStiffness> explains it with 2.5" in result.stdout
