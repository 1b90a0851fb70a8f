"""The shape of the package: how large it is, how deep classes stand, how much a function asks for, and how far a state travels."""

from __future__ import annotations

import ast
import functools
import re
import subprocess
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from rooms import PACKAGE, REPOSITORY, python

MOST_SHARED_NAMES = 2
# The one class that is a language: its methods are the operators.
LANGUAGE = "Term"
JOINT_KINDS = {"hinge", "slide", "planar", "ball", "free"}
# A docstring says what a thing is, its noun first.
NO_NOUNS = {"How", "Of", "What", "When", "Where", "Whether", "Which", "Whose"}

Module = tuple[str, ast.Module]
Functions = (ast.FunctionDef, ast.AsyncFunctionDef)
DOCUMENTED = (ast.Module, ast.ClassDef, *Functions)


def modules(package: Path) -> list[Module]:
    """Dotted names and syntax trees of every file of the package."""
    found = []
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found.append((name, ast.parse(file.read_text(encoding="utf-8"))))
    return found


@functools.cache
def walked(tree: ast.Module) -> list[ast.AST]:
    """All nodes of a tree: each bar looks at those of the whole package."""
    return list(ast.walk(tree))


def nodes(found: Iterable[Module], *kinds: type[ast.AST]) -> Iterator[tuple[str, ast.AST]]:
    return ((name, node) for name, tree in found for node in walked(tree) if isinstance(node, kinds))


def room(module: str) -> str:
    return ".".join(module.split(".")[:2])


def imported(module: str, tree: ast.Module) -> dict[str, str]:
    """Dotted name in the package of each name that a module imports from it."""
    found = {}
    for node in walked(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] == "harness":
            found |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.asname or alias.name: alias.name for alias in node.names if alias.name.partition(".")[0] == "harness"}
    return found


# What each bar counts


def statements(found: list[Module]) -> list[str]:
    """The module of each statement; a docstring is none."""
    return [
        name
        for name, node in nodes(found, ast.stmt)
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str))
    ]


def deep_classes(found: list[Module]) -> list[str]:
    """Classes with more than two classes of the package above one another, themselves not counted."""
    classes = {f"{name}.{node.name}": node for name, node in nodes(found, ast.ClassDef) if isinstance(node, ast.ClassDef)}
    names = {name: imported(name, tree) for name, tree in found}

    def parents(full: str) -> Iterator[str]:
        module = full.rpartition(".")[0]
        for base in classes[full].bases:
            text = ast.unparse(base.value if isinstance(base, ast.Subscript) else base)
            head, _, rest = text.partition(".")
            target = names.get(module, {}).get(head, f"{module}.{head}")
            yield f"{target}.{rest}" if rest else target

    def depth(full: str) -> int:
        return 1 + max((depth(parent) for parent in parents(full) if parent in classes), default=0)

    return [full for full in classes if depth(full) > 3]


def large_classes(found: list[Module]) -> list[str]:
    """Classes with more than 15 methods of their own."""
    return [
        f"{name}.{node.name}"
        for name, node in nodes(found, ast.ClassDef)
        if isinstance(node, ast.ClassDef) and node.name != LANGUAGE and sum(isinstance(part, Functions) for part in node.body) > 15
    ]


def long_signatures(found: list[Module]) -> list[str]:
    """Functions with more than six parameters beside the object itself, but overloads."""
    answer = []
    for name, node in nodes(found, *Functions):
        assert isinstance(node, Functions)
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        own = [argument for argument in arguments if argument.arg not in {"self", "cls"}]
        if len(own) > 6 and not any("overload" in ast.unparse(decorator) for decorator in node.decorator_list):
            answer.append(f"{name}.{node.name}")
    return answer


def foreign_private_modules(found: list[Module]) -> list[str]:
    """Private modules that a module outside of their folder imports, with who does."""
    answer = []
    for name, tree in found:
        for target in {*imported(name, tree).values()}:
            parts = target.split(".")
            for place, part in enumerate(parts):
                owner = ".".join(parts[:place])
                if part.startswith("_") and not part.startswith("__") and not f"{name}.".startswith(f"{owner}."):
                    answer.append(f"{name} -> {target}")
    return answer


def questions_of_kind(found: list[Module]) -> list[str]:
    """Places that ask whether a library is one of robots, or whether a quantity is accelerations."""
    answer = []
    for name, node in nodes(found, ast.Attribute, ast.Name, ast.Compare):
        if isinstance(node, ast.Compare):
            sides = [ast.unparse(side).rpartition(".")[2] for side in (node.left, *node.comparators)]
            if "ACCELERATIONS" in sides and any(isinstance(operator, ast.Eq | ast.NotEq) for operator in node.ops):
                answer.append(f"{name}:{node.lineno} {ast.unparse(node)}")
        elif (node.attr if isinstance(node, ast.Attribute) else node.id) == "is_of_robots":  # type: ignore[attr-defined]
            answer.append(f"{name}:{node.lineno} is_of_robots")  # type: ignore[attr-defined]
    return answer


def names_of_two_classes(found: list[Module]) -> list[str]:
    """Names that several classes have."""
    places = defaultdict(list)
    for name, node in nodes(found, ast.ClassDef):
        assert isinstance(node, ast.ClassDef)
        places[node.name].append(name)
    return [f"{shared}: {', '.join(where)}" for shared, where in sorted(places.items()) if len(where) > 1]


def files_with_joint_kinds(found: list[Module]) -> list[str]:
    """Files that hold a kind of joint as a word; in systems the same words are names of joints."""
    spoken = {name for name, node in nodes(found, ast.Constant) if isinstance(node, ast.Constant) and node.value in JOINT_KINDS}
    return sorted(name for name in spoken if not re.search(r"\bsystems\b", name))


def climbing_registrations(found: list[Module]) -> list[str]:
    """Functions that are registered with a function of another room."""
    answer = []
    for name, tree in found:
        names = imported(name, tree)
        for node in walked(tree):
            if isinstance(node, ast.Attribute) and node.attr == "register":
                head, _, rest = ast.unparse(node.value).partition(".")
                target = f"{names[head]}.{rest}" if head in names else ""
                if target and room(target) != room(name):
                    answer.append(f"{name}:{node.lineno} {ast.unparse(node)}")
    return answer


def docstrings_without_a_subject(found: list[Module]) -> list[str]:
    """Docstrings whose first word is no noun of the thing."""
    documented = ((name, node, ast.get_docstring(node)) for name, tree in found for node in walked(tree) if isinstance(node, DOCUMENTED))
    return [f"{name}:{getattr(node, 'lineno', 1)} {text}" for name, node, text in documented if text and text.split()[0] in NO_NOUNS]


@dataclass(frozen=True)
class Bar:
    """At most so many of what ``count`` finds, and a file of the package with ``planted`` further ones."""

    count: Callable[[list[Module]], list[str]]
    most: int
    text: str
    planted: int = 1


BARS = [
    Bar(statements, 28_500, "x = 1\n", 1),
    Bar(deep_classes, 0, "class A: ...\nclass B(A): ...\nclass C(B): ...\nclass D(C): ...\n"),
    Bar(large_classes, 0, "class A:\n" + "".join(f"    def f{number}(self): ...\n" for number in range(16))),
    Bar(long_signatures, 0, "def f(a, b, c, d, *, e, f, g): ...\n"),
    Bar(foreign_private_modules, 0, "from harness.report._private import name\n"),
    Bar(questions_of_kind, 3, "def f(library, quantity):\n    return library.is_of_robots or quantity != ACCELERATIONS\n", 2),
    Bar(names_of_two_classes, MOST_SHARED_NAMES, "class Planted: ...\nclass A:\n    class Planted: ...\n"),
    Bar(files_with_joint_kinds, 4, 'KIND = "planar"\n'),
    Bar(docstrings_without_a_subject, 0, 'def f():\n    """What it does."""\n'),
    Bar(climbing_registrations, 0, "from harness.report import site\n\n@site.pages.register\ndef f(study): ...\n"),
]


@pytest.fixture(scope="module")
def package() -> list[Module]:
    return modules(PACKAGE)


# Statements are on their way there.
HELD = [bar for bar in BARS if bar.count != statements]


@pytest.mark.parametrize("bar", HELD, ids=lambda bar: bar.count.__name__)
def test_the_package_stays_below(bar: Bar, package: list[Module]) -> None:
    found = bar.count(package)
    assert len(found) <= bar.most, found if len(found) < 100 else Counter(map(room, found))


@pytest.mark.parametrize("bar", BARS, ids=lambda bar: bar.count.__name__)
def test_what_is_planted_is_counted(bar: Bar, package: list[Module]) -> None:
    planted = ("harness.workers.planted", ast.parse(bar.text))
    assert len(bar.count([*package, planted])) == len(bar.count(package)) + bar.planted


def test_inheritance_across_modules_is_followed(tmp_path: Path) -> None:
    workers = tmp_path / "harness" / "workers"
    workers.mkdir(parents=True)
    (workers / "first.py").write_text("class A: ...\nclass B(A): ...\n")
    (workers / "second.py").write_text("from harness.workers import first\nclass A(first.B): ...\nclass C(A): ...\n")
    assert deep_classes(modules(tmp_path / "harness")) == ["harness.workers.second.C"]


# The top level

FOLDERS = {"benchmarks", "docs", "harness", "mjcf", "reports", "tests", "urdf"}
FILES = {"CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "README.md", "SECURITY.md"}
SETTINGS = {"action.yml", "constraints.txt", "mkdocs.yml", "pyproject.toml"}


def test_the_top_level_has_these_folders_and_the_usual_files() -> None:
    listing = subprocess.check_output(["git", "ls-files"], cwd=REPOSITORY, text=True).splitlines()
    found = {name.partition("/")[0] for name in listing}
    assert {name for name in found if not name.startswith(".")} == FOLDERS | FILES | SETTINGS
    assert [name for name in listing if name.startswith("reports/")] == ["reports/README.md"]


# The loop of the cross-check

LOOP = "harness.crosscheck.run", "_compared"
MOST_LINES_OF_THE_LOOP = 150


def loop_lines(found: list[Module]) -> int:
    """Lines of the one function that takes a system from its files to its records."""
    [loop] = [node for name, node in nodes(found, *Functions) if (name, node.name) == LOOP]  # type: ignore[attr-defined]
    assert isinstance(loop, Functions)
    assert any(isinstance(node, ast.Yield) for node in ast.walk(loop)), "it asks nothing"
    return (loop.end_lineno or 0) - loop.lineno + 1


@pytest.mark.ci
def test_the_loop_of_the_cross_check_is_one_function_of_at_most_150_lines(package: list[Module], copied: Path) -> None:
    lines = loop_lines(package)
    assert lines <= MOST_LINES_OF_THE_LOOP
    file = copied / "harness" / "crosscheck" / "run.py"
    file.write_text(file.read_text().replace(f"def {LOOP[1]}(", f"def {LOOP[1]}(\n" + "\n" * 200, 1))
    assert loop_lines(modules(copied / "harness")) > MOST_LINES_OF_THE_LOOP


# How much one check takes

WORKERS_HERE = """
import sys
from collections import deque
import harness.workers


class Here(harness.workers.Workers):
    def __enter__(self):
        return self

    def __exit__(self, *exception):
        pass

    def __len__(self):
        return 1

    def run(self, tasks, further=tuple):
        waiting = deque(tasks)
        while waiting:
            task = waiting.popleft()
            yield harness.workers.Outcome(task, value=task.function(*task.arguments, lambda text: None))
            waiting.extend(further())


harness.workers.Workers = Here
"""
MODULES = (
    WORKERS_HERE
    + """
from harness.cli import main

try:
    main(["check", "double_pendulum", "--states", "16"], standalone_mode=False)
except SystemExit as end:
    assert not end.code, end.code
print("\\n".join(["modules:", *(name for name in sys.modules if name.partition(".")[0] == "harness")]))
"""
)


def modules_of_a_check(folder: Path) -> list[str]:
    """Modules of the harness in ``folder`` that ``harness check double_pendulum`` imports, in its workers or beside them."""
    done = python(MODULES, folder)
    assert done.returncode == 0, done.stderr
    return done.stdout.partition("modules:\n")[2].split()


MOST_MODULES = 150


@pytest.mark.ci
def test_a_check_of_one_mechanism_imports_at_most_150_modules() -> None:
    # The first one fills the cache.
    modules_of_a_check(REPOSITORY)
    found = modules_of_a_check(REPOSITORY)
    assert len(found) <= MOST_MODULES, sorted(found)


@pytest.mark.ci
def test_a_further_module_is_counted(copied: Path) -> None:
    (copied / "harness" / "further.py").touch()
    file = copied / "harness" / "commands" / "check.py"
    before = modules_of_a_check(copied)
    file.write_text(file.read_text() + "\nimport harness.further\n")
    assert set(modules_of_a_check(copied)) - set(before) == {"harness.further"}


JOURNEY = """
import sys
from pathlib import Path
import harness
from harness.truth.sampling import generic_sample
from harness.crosscheck.stages import compare_all
from harness.crosscheck.assignment import Assignment
from harness.engines import Subject
from harness.lagrange.derivation import load_mechanism
from harness.library import Library

library, package = Library.built_in(), str(Path(harness.__file__).parent)
assignment = Assignment.of(library, "double_pendulum", Subject("mujoco", "mjcf"))
states = generic_sample(load_mechanism(library, "double_pendulum"), 1, seed=0)
files, importing = {}, 0


def enter(frame, event, argument):
    global importing
    if event in {"call", "return"} and frame.f_code.co_name == "<module>":
        importing += 1 if event == "call" else -1
    elif event == "call" and not importing and frame.f_code.co_filename.startswith(package):
        files.setdefault(frame.f_code.co_filename)


sys.setprofile(enter)
[answers] = compare_all([assignment], states, lambda text: None)[-1].values()
sys.setprofile(None)
assert answers.failure == "", answers.failure
print("\\n".join(["files:", *(str(Path(file).relative_to(package)) for file in files)]))
"""


def files_of_a_state(folder: Path) -> list[str]:
    """Files of the harness in ``folder`` whose functions the first state of a process enters until its verdict.

    Imports are left out, and what the process of the engine does.
    """
    # The first process fills the cache.
    for done in (python(JOURNEY, folder), python(JOURNEY, folder)):
        assert done.returncode == 0, done.stderr
    return done.stdout.partition("files:\n")[2].split()


ANOTHER_FILE = """

_compare_all = compare_all


def compare_all(*arguments):
    from harness.further import further

    further()
    return _compare_all(*arguments)
"""


MOST_FILES_OF_A_STATE = 27


@pytest.mark.ci
def test_the_first_state_of_a_process_goes_through_at_most_27_files() -> None:
    found = files_of_a_state(REPOSITORY)
    assert len(found) <= MOST_FILES_OF_A_STATE, found


@pytest.mark.ci
def test_a_further_file_is_counted(copied: Path) -> None:
    before = files_of_a_state(copied)
    (copied / "harness" / "further.py").write_text("def further():\n    pass\n")
    stages = copied / "harness" / "crosscheck" / "stages.py"
    stages.write_text(stages.read_text() + ANOTHER_FILE)
    assert set(files_of_a_state(copied)) - set(before) == {"further.py"}
