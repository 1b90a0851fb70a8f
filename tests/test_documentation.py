"""What README, CONTRIBUTING and docs/ promise: their commands run, they print what the pages show, and what is generated is current."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documents import DOCS, PAGES, Block, Page, blocks, shell, shown
from rooms import REPOSITORY
from support import harness

from benchmarks.page import PAGE
from benchmarks.suites.commands import COMMANDS, name_of

sys.path.insert(0, str(DOCS / "hooks"))

README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
ARCHITECTURE = (DOCS / "inside" / "architecture.md").read_text(encoding="utf-8")
LINK = re.compile(r"\]\((?!https?://|#)([^)#]+)")


def commands(text: str) -> list[Block]:
    return [block for block in blocks(text) if block.language == "sh"]


def page_name(path: Path) -> str:
    return path.relative_to(REPOSITORY).as_posix()


# README and CONTRIBUTING


def test_readme_and_contributing_are_short() -> None:
    assert len(README.splitlines()) <= 120
    assert len(CONTRIBUTING.splitlines()) <= 150
    assert re.search(r"^## (.*)$", CONTRIBUTING, re.MULTILINE)[1] == "Develop"  # type: ignore[index]


def test_readme_has_two_commands_of_one_line_and_marks_the_one_that_tests() -> None:
    compare, tests = (block.content for block in commands(README))
    assert [len(command.splitlines()) for command in (compare, tests)] == [1, 1]
    assert compare.rstrip().endswith("harness compare harness/robots/arm.urdf")
    assert tests.rstrip().endswith("pytest")
    assert README.count(f"<!-- test command -->\n```sh\n{tests}```\n") == 1
    assert README.count("<!-- test command -->") == 1
    assert not re.search(r"\buv\b", README)


def test_readme_comes_to_the_commands_soon() -> None:
    assert len(README.partition("## Run it")[0].split()) <= 250


@pytest.mark.ci
def test_readme_shows_what_its_command_prints() -> None:
    [block] = [block for block in blocks(README) if block.marks and block.marks[0].startswith("output of: ")]
    done = harness(*block.marks[0].removeprefix("output of: harness ").split(), cwd=REPOSITORY)
    assert shown(block.content, done.stdout), done.stdout
    assert len(block.content.splitlines()) <= 12


@pytest.mark.ci
def test_the_picture_of_readme_is_current() -> None:
    from readme_picture import PICTURE, picture

    def parts(svg: str) -> tuple[list[str], list[float]]:
        number = r"-?\d+(?:\.\d+)?"
        return re.split(number, svg), [float(one) for one in re.findall(number, svg)]

    (words, numbers), (now, computed) = parts(PICTURE.read_text(encoding="utf-8")), parts(picture())
    assert words == now, "make it anew: python docs/hooks/readme_picture.py"
    assert numbers == pytest.approx(computed, abs=0.11)


@pytest.mark.ci
@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_python_of_a_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks without a name, one after the other; a program for an engine's tracker has a test of its own."""
    monkeypatch.chdir(tmp_path)
    own = [block.content for block in blocks(page.read_text(encoding="utf-8")) if block.language == "python" and not block.path]
    names: dict[str, object] = {"__name__": "page"}
    for content in own if not page_name(page).endswith("study.md") else []:
        exec(compile(content, page_name(page), "exec"), names)


@pytest.mark.parametrize("page", [*PAGES, REPOSITORY / "CONTRIBUTING.md"], ids=page_name)
def test_links_lead_to_files(page: Path) -> None:
    """Also for whoever reads the pages in the repository; pages that are made at build are known by their generators."""
    generated = ("reference/commands.md", "reference/messages.md", "reference/json.md", "pictures/")
    links = [link for link in LINK.findall(page.read_text(encoding="utf-8")) if not any(name in link for name in generated)]
    assert [link for link in links if not (page.parent / link).is_file()] == []


def test_every_module_on_the_way_of_a_state_is_there() -> None:
    [block] = re.findall(r"^<!-- way of a state -->\n```text\n(.*?)^```$", ARCHITECTURE, re.MULTILINE | re.DOTALL)
    modules = re.findall(r"\b[\w/]+\.py\b", block)
    assert len(modules) > 5
    assert [module for module in modules if not (REPOSITORY / "harness" / module).is_file()] == []


def test_a_docstring_that_names_a_section_of_numerics_names_one() -> None:
    headings = set(re.findall(r"^## (.*)$", (DOCS / "inside" / "numerics.md").read_text(encoding="utf-8"), re.MULTILINE))
    named = {
        (path.name, section)
        for path in (REPOSITORY / "harness").rglob("*.py")
        for section in re.findall(r"docs/inside/numerics\.md,\s+\"([^\"]+)\"", path.read_text(encoding="utf-8"))
    }
    assert {section for _, section in named} <= headings, sorted(named)


def test_the_costs_are_of_the_commands_that_are_measured() -> None:
    measured = re.findall(r"^\| `harness (.*?)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert measured == [name_of(command).removeprefix("commands/") for command in COMMANDS], "measure anew: python -m benchmarks commands"


# Commands


RUN = [page for page in PAGES if page.name != "README.md" and commands(page.read_text(encoding="utf-8"))]


@pytest.mark.ci
@pytest.mark.parametrize("page", RUN, ids=page_name)
def test_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    Page(page.read_text(encoding="utf-8"), tmp_path).run()


def clone(folder: Path) -> None:
    """Copy the files of the repository, as a clone has them."""
    for name in subprocess.check_output(["git", "ls-files"], cwd=REPOSITORY, text=True).splitlines():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(REPOSITORY / name, folder / name)


@pytest.mark.nightly
def test_the_first_command_of_readme_runs_in_a_clone(tmp_path: Path) -> None:
    clone(tmp_path)
    done = shell(commands(README)[0].content, tmp_path)
    # pip may say something first.
    first = next((line for line in done.stdout.splitlines() if line.startswith("arm.urdf: ")), "")
    assert done.returncode == 0 and first.startswith("arm.urdf: MuJoCo agrees with the file"), done.stdout + done.stderr


@pytest.mark.nightly
@pytest.mark.parametrize("page", [page for page in RUN if "<!-- nightly -->" in page.read_text(encoding="utf-8")], ids=page_name)
def test_long_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    if page.name in {"benchmarks.md", "install.md"}:
        clone(tmp_path)
    Page(page.read_text(encoding="utf-8"), tmp_path, nightly=True).run()


def test_a_page_that_is_wrong_is_found(tmp_path: Path) -> None:
    page = '<!-- exit status 3 -->\n```sh\necho "3 of 4 agree"\nexit 3\n```\n\n<!-- output -->\n```text\n1 of 2 {}\n```\n'
    Page(page.format("agree"), tmp_path).run()
    with pytest.raises(AssertionError, match="expected"):
        Page(page.format("disagree"), tmp_path).run()
    with pytest.raises(AssertionError, match="ended with 3"):
        Page(page.replace("status 3", "status 0").format("agree"), tmp_path).run()


@pytest.mark.ci
def test_the_tutorial_runs_and_has_no_outputs_in_git(tmp_path: Path) -> None:
    # Every process that collects the tests would import them.
    import nbclient
    import nbformat

    notebook = nbformat.read(DOCS / "start" / "tutorial.ipynb", as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell for cell in cells if cell.outputs or cell.execution_count] == []
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert "image/svg+xml" in json.dumps(cells[-1].outputs)
