"""Mutants that are planted in a small repository: one that no test can see, ones that are surely killed, and all that lies between."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import mutant_runs
import mutants
import mutation
import pytest

SETTINGS = """
[tool.pytest.ini_options]
pythonpath = ["tests"]
addopts = ["--import-mode=importlib"]

[tool.coverage.run]
source_pkgs = ["harness"]
patch = ["subprocess"]
"""
TOY = '''"""A module."""

LIMIT = 3
TABLE = ("one",)[0]


def elsewhere(x):
    return -x
'''
COUNTING = '''"""A module with a loop."""


def counted(n):
    while n:
        n -= 1
'''
RETURNING = '''"""Another module."""


def doubled(x):
    return x + x


def same(n):
    return n


def nowhere(x):
    return x
'''
TESTS = """
import subprocess
import sys
import time

from harness.counting import counted
from harness.returning import doubled, same
from harness.toy import LIMIT

def test_dear():
    started = time.process_time()
    while time.process_time() < started + 0.05:
        pass
    assert doubled(2) == 4

def test_doubled():
    assert doubled(3) == 6

def test_counted():
    counted(same(2))

def test_limit():
    assert LIMIT == 3

def test_elsewhere():
    program = "from harness.toy import elsewhere; assert elsewhere(1) == -1"
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0

def test_red():
    assert doubled(1) == 3
"""


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    written = {
        "pyproject.toml": SETTINGS,
        "harness/toy.py": TOY,
        "harness/counting.py": COUNTING,
        "harness/returning.py": RETURNING,
        "tests/test_toy.py": TESTS,
    }
    for name, text in {"harness/__init__.py": "", "harness/pytest_plugin.py": "", **written}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(mutant_runs, "STARTING", 2)
    return tmp_path


MODULES = ("toy", "counting", "returning")


def run(repository: Path, *words: str, modules: Sequence[str] = MODULES) -> tuple[int, dict[tuple[str, str], dict[str, Any]]]:
    """The exit status, and the last verdict on each mutant by its line and what that becomes."""
    paths, results = [str(repository / "harness" / f"{name}.py") for name in modules], repository / "results"
    places = ["--repository", str(repository), "--results", str(results), "--equivalent", str(repository / "equivalent.toml")]
    status = mutation.main([*paths, "--tests", "tests/test_toy.py", "--count", "99", "--seed", "4", *places, *words])
    return status, {(one["was"], one["became"]): one for one in map(json.loads, (results / "mutants.jsonl").read_text().splitlines())}


def explained(repository: Path, was: str, became: str) -> None:
    """Have a mutant stand in the list of those that no test can tell from the product."""
    entry = {"module": "harness/returning.py", "was": was, "became": became, "reason": "planted"}
    lines = (f"{name} = {json.dumps(value)}\n" for name, value in entry.items())
    (repository / "equivalent.toml").write_text("".join(["[[mutant]]\n", *lines]))


@pytest.mark.ci
def test_planted_mutants_have_the_fate_that_they_must_have(
    repository: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    status, found = run(repository)
    # No test looks at what ``same`` returns or how ``counted`` counts, and nothing calls ``nowhere``.
    step, same, nowhere = "n -= 1", ("return n", "return None"), ("return x", "return None")
    alive = {same, (step, "n -= (2)"), nowhere}
    assert {place for place, one in found.items() if one["verdict"] == "survives"} == alive
    assert {found[place]["verdict"] for place in found.keys() - alive} == {"killed"}
    # The cheaper of the two tests that see it, and not the one that fails always.
    surely = found["return x + x", "return (x - x)"]
    assert surely["test"] == "tests/test_toy.py::test_doubled" and surely["said"].startswith("assert")
    endless = found[step, "n += 1"]
    assert endless["how"] == "processor limit" and endless["test"] == "tests/test_toy.py::test_counted"
    [table] = (one for one in found.values() if one["was"].startswith("TABLE"))
    assert table["how"] == "tests cannot be collected"
    assert found["LIMIT = 3", "LIMIT = (4)"]["test"] == "tests/test_toy.py::test_limit"
    assert found["return -x", "return (+x)"]["test"] == "tests/test_toy.py::test_elsewhere"
    assert found[same]["tried"] == 5
    printed = capsys.readouterr().out
    assert "harness/returning.py:9: survives (5 tests tried)  return n -> return None\n" in printed
    assert "7 of 10 mutants killed, 70.0 %; without 0 that" in printed and status == 1

    # A run that is cut off goes on; what a cut left of a line is made again.
    log = repository / "results" / "mutants.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:-2]) + lines[-2][:20])
    asked = []
    ask = mutant_runs.Copy.run
    monkeypatch.setattr(mutant_runs.Copy, "run", lambda *given: asked.append(list(given[1])) or ask(*given))
    assert run(repository)[1] == found and 2 <= len(asked) <= 4

    # With another test each is asked anew, first the test that killed it.
    asked.clear()
    (repository / "tests" / "test_toy.py").write_text(TESTS + "\ndef test_same():\n    assert same(2) == 2\n")
    further = partial(run, repository, "--tests", "tests/test_toy.py -k same", "--least", "80", modules=["returning"])
    status, again = further()
    assert ["tests/test_toy.py::test_doubled"] in asked
    assert [again[place]["verdict"] for place in (same, nowhere)] == ["killed", "survives"]
    in_all = "3 of 4 mutants killed, 75.0 %; without {} that no test can tell from the product, {:.1f} %; seed 4, of 4 mutants\n"
    assert in_all.format(0, 75) in capsys.readouterr().out and status == 1

    # A survivor that is explained does not count, and nothing is asked again for it.
    asked.clear()
    explained(repository, *nowhere)
    status, _ = further()
    printed = capsys.readouterr().out
    assert "survives (6 tests tried)  return x -> return None; equivalent: planted\n" in printed
    assert in_all.format(1, 100) in printed and (status, asked) == (0, [])
    explained(repository, "return x + x", "return (x - x)")
    assert further()[0] == 1
    assert "test_doubled kills it: delete the entry\n" in capsys.readouterr().out


@pytest.mark.ci
def test_what_is_no_answer_of_a_test_kills_nothing(repository: Path) -> None:
    with mutant_runs.Copy(repository) as copy, copy.with_text(repository / "harness" / "toy.py", TOY):
        old, doubled = "tests/test_toy.py::test_of_old", "tests/test_toy.py::test_doubled"
        missing = copy.run({old: 0.1}, 1.0)
        assert not missing.killed and missing.how.startswith("pytest ended with status 4")
        beside = copy.run({old: 0.1, doubled: 0.1}, 1.0)
        assert not beside.killed and (beside.how, beside.asked) == ("", {doubled})
        (copy.root / "tests" / "test_lacking.py").write_text("import nowhere_at_all\n\ndef test_it():\n    pass\n")
        lacking = copy.run({"tests/test_lacking.py::test_it": 0.1}, 1.0)
        assert not lacking.killed and lacking.how.startswith("pytest ended with status")
        (copy.root / "tests" / "conftest.py").write_text(
            "from harness.toy import TABLE\n\ndef pytest_collection_modifyitems():\n    [_] = TABLE.splitlines()\n"
        )
        with copy.with_text(repository / "harness" / "toy.py", TOY.replace('"one"', '"o\\nne"')):
            assert copy.run({doubled: 0.1}, 1.0).how == "tests cannot be collected"
        # The budget is for the tests, of which the cheapest is asked always.
        assert copy.run({"tests/test_toy.py::test_doubled": 5.0, "tests/test_toy.py::test_dear": 50.0}, 1.0).asked == {
            "tests/test_toy.py::test_doubled"
        }


def test_a_mutant_is_another_tree_and_leaves_the_rest_of_the_text(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text('"""é."""\nx = (1 + 2) * 3 ** 4  # kept\nword = f"{x + 1:3}"\n\n\ndef f(a=5):\n    return not (\n        a\n    )\n')
    made = [mutants.made(place) for place in mutants.places(module)]
    assert {one.words for one in made if one.line == 2} == {
        "(1 + 2) * 3 ** 4  ->  (1 + 2) / 3 ** 4", "1 + 2  ->  1 - 2", "3 ** 4  ->  3 * 4",
        "1  ->  2", "2  ->  3", "3  ->  4", "4  ->  5",
    }  # fmt: skip
    assert not any(one.line == 3 for one in made)
    [powered] = [one for one in made if one.words == "3 ** 4  ->  3 * 4"]
    assert powered.text == module.read_text().replace("3 ** 4", "(3 * 4)")
    assert {(one.words, one.at_import) for one in made if one.line > 5} == {
        ("5  ->  6", True), ("return not a  ->  return None", False), ("not a  ->  not not a", False),
    }  # fmt: skip
    assert [one.words for one in mutants.sample([module], 3, 7)[0]] == [one.words for one in mutants.sample([module], 3, 7)[0]]
