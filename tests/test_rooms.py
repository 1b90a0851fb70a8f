"""The rooms of the package: what lies where, what imports what, what they say of themselves, and what the cache depends on."""

from __future__ import annotations

import ast
import functools
import graphlib
import importlib
import io
import re
import sys
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

import grimp
import pytest
from rooms import PACKAGE, REPOSITORY, python
from support import make_library

import harness
from harness.library import ENTRY_POINTS
from harness.storage import sources_digest

ROOMS = sorted(path.name for path in PACKAGE.iterdir() if path.is_dir() and any(path.glob("*.py")))
# The systems are a library's folder, which is searched and never imported.
PACKAGES = [room for room in ROOMS if room != "systems"]
MOST_ENTRIES_BESIDE_ROOMS = 14
CONTRACTS = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
# What lies on each floor, from the top.
[FLOORS] = [[set(layer.split(" | ")) for layer in contract["layers"]] for contract in CONTRACTS if contract["type"] == "layers"]


def floor(name: str) -> int:
    """The number of the floor of a room or module directly in the package, from the top."""
    return next(number for number, names in enumerate(FLOORS) if name in names)


@pytest.fixture(scope="module")
def imports() -> dict[str, set[str]]:
    """What each module of the package imports of the package, imports for type checkers left out."""
    graph = grimp.build_graph("harness", exclude_type_checking_imports=True, cache_dir=None)
    return {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}


# What imports what


def lint_imports(folder: Path) -> tuple[set[str], str]:
    """Names of the contracts that the package in ``folder`` breaks, and all that the linter prints."""
    done = python("from importlinter.cli import lint_imports_command; lint_imports_command()", folder, "--no-cache")
    broken = set(re.findall(r"^(.+) BROKEN$", done.stdout, re.MULTILINE))
    assert re.search(r"^Contracts: \d+ kept, \d+ broken", done.stdout, re.MULTILINE), done.stdout + done.stderr
    assert done.returncode == bool(broken)
    return broken, done.stdout


def test_every_contract_is_kept() -> None:
    broken, printed = lint_imports(REPOSITORY)
    assert broken == set(), printed


@pytest.mark.ci
@pytest.mark.parametrize(
    ("contract", "module", "imported", "named"),
    [
        ("A room imports only rooms below it", "results.records", "crosscheck.run", "harness.results.records -> harness.crosscheck.run"),
        ("A room imports only rooms below it", "files.facts", "lagrange.system", "harness.files.facts -> harness.lagrange.system"),
        (
            "An engine imports nothing of the equations",
            "engines.adapters.pybullet",
            "programs.states",
            "harness.engines.adapters.pybullet -> harness.programs.states",
        ),
        (
            "The report imports nothing that computes",
            "report.charts",
            "truth.compare",
            "harness.report.charts -> harness.truth.compare",
        ),
        ("No cycle of imports", "truth.compare", "truth.reference", ".compare -> .reference"),
    ],
)
def test_a_planted_import_is_refused_by_name(copied: Path, contract: str, module: str, imported: str, named: str) -> None:
    file = copied / "harness" / f"{module.replace('.', '/')}.py"
    file.write_text(f"{file.read_text()}\nimport harness.{imported}\n")
    broken, printed = lint_imports(copied)
    assert contract in broken
    assert named in printed


def test_no_file_imports_itself_by_way_of_others(imports: dict[str, set[str]]) -> None:
    graphlib.TopologicalSorter(imports).prepare()  # raises CycleError


def system_files() -> list[Path]:
    return [*(PACKAGE / "systems").glob("*.py"), *(PACKAGE / "hard" / "cases" / "systems").glob("*.py")]


def foreign_imports(source: str, helpers: set[str]) -> list[str]:
    """What a system file imports beside ``harness`` itself, SymPy, the standard library and the helpers in its folder."""
    found: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found.append("." * node.level + (node.module or ""))
    known = {"sympy", *helpers, *sys.stdlib_module_names}
    return [name for name in found if name != "harness" and name.partition(".")[0] not in known]


@pytest.mark.parametrize("file", system_files(), ids=lambda file: file.stem)
def test_a_system_file_imports_harness_and_sympy_only(file: Path) -> None:
    assert foreign_imports(file.read_text(), {helper.stem for helper in file.parent.glob("_*.py")}) == []


@pytest.mark.parametrize(
    "line", ["import numpy as np", "from harness.engines import mujoco", "from .chain import system", "import acrobot"]
)
def test_any_other_import_of_a_system_file_is_found(line: str) -> None:
    assert foreign_imports(line, {"_serial_arm"}) != []


# What lies where, and what a room says of itself


def test_few_files_lie_beside_the_rooms() -> None:
    beside = [path.name for path in PACKAGE.iterdir() if path.name not in {*ROOMS, "__pycache__"}]
    assert len(beside) <= MOST_ENTRIES_BESIDE_ROOMS, sorted(beside)


def test_tests_mirror_the_rooms() -> None:
    tested = {file.parent.name for file in (REPOSITORY / "tests").glob("*/test_*.py")}
    # Hostile files, environments and kills meet the whole harness, not one room.
    assert sorted(tested - {"hostile"}) == ROOMS


def paragraph(room: str, opening: str) -> str:
    """The one paragraph of a room's docstring that holds ``opening``, from there to its end."""
    text = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text())) or ""
    found = [" ".join(part.split()).partition(opening) for part in text.split("\n\n") if opening in " ".join(part.split())]
    assert len(found) == 1, f"the docstring of {room} holds {len(found)} paragraphs with {opening!r}, expected one"
    return found[0][1] + found[0][2]


def quoted(text: str) -> list[str]:
    return re.findall(r"``(\w+)``", text)


@pytest.mark.parametrize("room", PACKAGES)
def test_a_room_says_what_it_may_use(room: str, imports: dict[str, set[str]]) -> None:
    named = quoted(paragraph(room, "May use "))
    assert named
    assert min(map(floor, named)) > floor(room)
    used = {
        found.split(".")[1] for module, all_found in imports.items() if f"{module}.".startswith(f"harness.{room}.") for found in all_found
    }
    assert [name for name in used - {room} if floor(name) < min(map(floor, named))] == []


@pytest.mark.parametrize("room", PACKAGES)
def test_a_room_says_where_to_start(room: str) -> None:
    named = quoted(paragraph(room, "Start with "))
    modules = {path.stem for path in (PACKAGE / room).iterdir()}
    defined = {
        name for path in (PACKAGE / room).rglob("*.py") for name in re.findall(r"^(?:class|def) (\w+)", path.read_text(), re.MULTILINE)
    }
    assert named
    assert [name for name in named if name not in modules | defined | set(ROOMS)] == []


def test_the_documentation_draws_every_layer_in_its_place() -> None:
    text = (REPOSITORY / "docs" / "inside" / "architecture.md").read_text(encoding="utf-8")
    picture = text.partition("<!-- layers -->\n```text\n")[2].partition("```")[0]
    drawn = [set(re.findall(r"\w+", line.partition("  ")[0])) for line in picture.splitlines()]
    assert drawn == FLOORS


def test_a_digest_of_a_room_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="no room of the package is called 'nowhere'"):
        sources_digest("results", "nowhere")


# What a text names is there

DOTTED = re.compile(r"(?<![\w./-])harness(?:\.[A-Za-z_]\w*)+")
PATH = re.compile(r"(?<![\w./-])(?:harness|tests|mjcf|urdf|reports)/[\w./-]*\w")


def prose(file: Path) -> str:
    """A text without its blocks of Python, which other tests run; of Python its docstrings and comments."""
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".py":
        return re.sub(r"^```python\n.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    comments = [token.string for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type == tokenize.COMMENT]
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    docstrings = [ast.get_docstring(node, clean=False) or "" for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    return "\n".join([*comments, *docstrings])


def texts() -> Iterator[Path]:
    yield from (*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md"))
    yield REPOSITORY / ".ci" / "run"
    for folder in ("harness", "tests"):
        yield from (REPOSITORY / folder).rglob("*.py")


@functools.cache
def is_there(dotted: str) -> bool:
    """Whether ``dotted`` is a module of the package or what can be reached from one by name."""
    _, *names = dotted.split(".")
    found: object = harness
    for depth, name in enumerate(names, start=1):
        try:
            found = importlib.import_module(".".join(["harness", *names[:depth]]))
        except ModuleNotFoundError:
            if not hasattr(found, name):
                return False
            found = getattr(found, name)
    return True


def stale(text: str) -> list[str]:
    """Modules and paths of this repository that a text names and that are not there; a placeholder is in capitals."""
    modules = [name for name in DOTTED.findall(text) if name != ENTRY_POINTS and not is_there(name)]
    paths = [path for path in PATH.findall(text) if not re.search(r"[A-Z]{3}", path) and not (REPOSITORY / path).exists()]
    return modules + paths


@pytest.mark.ci
def test_texts_name_only_what_is_there() -> None:
    # Prose and code are told apart only where the whole holds a stale name.
    suspect = [file for file in texts() if stale(file.read_text(encoding="utf-8"))]
    found = {str(file.relative_to(REPOSITORY)): names for file in suspect if (names := stale(prose(file)))}
    assert found == {}


def test_a_stale_name_is_found() -> None:
    text = f"harness.lagrange.{'charts'} of harness.lagrange.euler_angles, harness/{'hypotheses'}/axis.py beside harness/systems/NAME.py"
    assert stale(text) == ["harness.lagrange.charts", "harness/hypotheses/axis.py"]


# What the cache depends on

FILL = """
import sys
from harness.crosscheck.superfluous import superfluous
from harness.crosscheck.assignment import Assignment
from harness.engines import Subject
from harness.library import Library

superfluous(Assignment.of(Library.at(sys.argv[1]), "bar_pendulum", Subject("mujoco", "mjcf")))
"""


def change_one_constant(room: Path) -> None:
    for file in sorted(room.rglob("*.py")):
        text, count = re.subn(r"^(_?[A-Z_]+ = [1-9]\d*)$", r"\g<1>0", file.read_text(), count=1, flags=re.MULTILINE)
        if count:
            file.write_text(text)
            return
    raise AssertionError(f"{room} holds no constant that is a whole number")


@pytest.mark.ci
def test_what_is_kept_depends_on_whole_rooms(copied: Path) -> None:
    library, cache = make_library(copied / "library", ["bar_pendulum"]), copied / "cache"

    def entries_after_a_run() -> tuple[int, int]:
        done = python(FILL, copied, str(library), HARNESS_CACHE=str(cache))
        assert done.returncode == 0, done.stderr
        return len(list((cache / "mechanisms").iterdir())), len(list((cache / "superfluous").iterdir()))

    assert entries_after_a_run() == (1, 1)
    assert entries_after_a_run() == (1, 1)
    change_one_constant(copied / "harness" / "files")
    assert entries_after_a_run() == (1, 2)
    change_one_constant(copied / "harness" / "programs")
    assert entries_after_a_run() == (2, 3)
