"""Mutants of the product, run against the tests that cover the changed line: which mistakes would no test see?

    python tests/mutation.py tests/truth harness/truth/compare.py harness/truth/blocks.py --count 60 --seed 0

The tests are run once with coverage. Each mutant is one change of one module in a copy of the package: a comparison, an operator, a
constant, a word of logic, a returned value, or a call that is left out. Its line chooses the tests, whose functions alone are run, until
one fails. A mutant that takes ten times the processor seconds of all tests together has failed too. Exit status 1 where fewer than
``--least`` percent are killed.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from coverage import CoverageData
from rooms import REPOSITORY

COMPARISONS = {ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
COMPARISONS |= {ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.MatMult: ast.Add}
LOGIC = {ast.And: ast.Or, ast.Or: ast.And}
# Processor seconds of one mutant's tests, as a multiple of what all tests took.
SECONDS = 10


@dataclass(frozen=True)
class Mutant:
    """One change of a module: where, in words, and the whole text with it."""

    path: Path
    line: int
    words: str
    text: str


def _changes(node: ast.AST) -> Iterator[Callable[[], None]]:
    """What may be changed in a node, each a function that does it."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        yield lambda: node.ops.__setitem__(0, COMPARISONS[type(node.ops[0])]())
    elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in OPERATORS:
        yield lambda: setattr(node, "op", OPERATORS[type(node.op)]())
    elif isinstance(node, ast.BoolOp):
        yield lambda: setattr(node, "op", LOGIC[type(node.op)]())
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield lambda: setattr(node, "value", not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield lambda: setattr(node, "value", node.value + 1)
    elif isinstance(node, ast.Return | ast.Expr) and not isinstance(node.value, ast.Constant | None):
        yield lambda: setattr(node, "value", ast.Constant(None))


def mutants(path: Path) -> list[Mutant]:
    """Every mutant of a module; annotations and docstrings are left alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    places = [number for number, node in enumerate(ast.walk(tree)) if any(True for _ in _changes(node))]
    found = []
    for place in places:
        changed = copy.deepcopy(tree)
        node = list(ast.walk(changed))[place]
        before = ast.unparse(node)
        for change in _changes(node):
            change()
            found.append(Mutant(path, node.lineno, f"{before}  ->  {ast.unparse(node)}", ast.unparse(changed)))  # type: ignore[attr-defined]
    return found


def _pytest(root: Path, *arguments: str, seconds: float = 0, coverage: bool = False) -> int:
    """The exit status of pytest in a copy of the repository; a mutant may take so many processor seconds, if any are said."""
    run = ["-m", "coverage", "run", "--data-file", str(root / "coverage"), "-m", "pytest"] if coverage else ["-m", "pytest"]
    limit = partial(resource.setrlimit, resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 1)) if seconds else None
    words = [sys.executable, *run, "-n", "0", "-q", "-x", "-p", "no:cacheprovider", "--hypothesis-profile=ci", *arguments]
    environment = os.environ | {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        words, cwd=root, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=limit
    ).returncode


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tests", help="tests, as pytest takes them")
    parser.add_argument("modules", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--least", type=float, default=90.0, metavar="PERCENT")
    asked = parser.parse_args()
    every = [mutant for path in asked.modules for mutant in mutants(path)]
    chosen = random.Random(asked.seed).sample(every, min(asked.count, len(every)))
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in ("harness", "tests"):
            shutil.copytree(REPOSITORY / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
        for path in REPOSITORY.iterdir():
            if path.name not in ("harness", "tests", ".git"):
                (root / path.name).symlink_to(path)
        if _pytest(root, asked.tests, "-m", "not nightly", coverage=True):
            raise SystemExit(f"{asked.tests} fails without any mutant")
        subprocess.run([sys.executable, "-m", "coverage", "combine", "-q", "--data-file", str(root / "coverage")], cwd=root, check=True)
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = SECONDS * (children.ru_utime + children.ru_stime)
        data = CoverageData(str(root / "coverage"))
        data.read()
        killed = 0
        for mutant in chosen:
            place = root / mutant.path.resolve().relative_to(REPOSITORY)
            contexts = data.contexts_by_lineno(str(place)).get(mutant.line, [])
            names = sorted({name.rpartition(".")[2] for name in contexts if name})
            original = place.read_text(encoding="utf-8")
            place.write_text(mutant.text, encoding="utf-8")
            # What runs while the tests are collected has no context: all of them decide then.
            picked = ["-k", " or ".join(names)] if names else []
            dies = bool(contexts) and _pytest(root, asked.tests, "-m", "not nightly", *picked, seconds=seconds) != 0
            place.write_text(original, encoding="utf-8")
            killed += dies
            if not dies:
                print(f"{mutant.path}:{mutant.line}: {'survives' if contexts else 'no test runs'}  {mutant.words}", flush=True)
    print(f"{killed} of {len(chosen)} mutants killed, {100 * killed / max(len(chosen), 1):.0f} %; of {len(every)}, seed {asked.seed}")
    return int(killed < asked.least / 100 * len(chosen))


if __name__ == "__main__":
    sys.exit(main())
