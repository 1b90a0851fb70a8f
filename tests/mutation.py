"""Mutants of the product, run against the tests that cover the changed line: which mistakes would no test see?

    python tests/mutation.py harness/truth harness/programs/terms.py --tests tests/truth --tests "-m ci tests/truth" --count 60

Each ``--tests`` is what pytest is given, and a stage: what survives the tests of one is tried on those of the next. The tests of a stage
are run once with coverage; those that fail or are skipped without any mutant are not asked. A mutant is one change of one module in a copy
of the repository. A test that failed for it in an earlier run comes first, then those that cover its line, the cheapest first, then those
beside them and those that run anything of its module, as far as ``--budget`` allows.

A mutant is killed where a test fails, where tests use far more processor time than without it, where they crash, or where they or the
module cannot be imported. Where pytest cannot be asked (statuses 4 and 5) or waits without end, nothing is known, and it counts as alive.

Everything is kept in the folder ``--results``: a run that was cut off goes on where it was. A kill stands while the file of its test is as
it was, a survival while all sources are. No cache answers for a mutant: entries of some caches (points of Sobol, answers of a night) are
not named after the sources that made them, so each mutant has an empty ``HARNESS_CACHE``. Machine code is named after all that it is made
from: each mutant starts with a copy of what the first stage compiled.

Survivors that no test can tell from the product stand in ``equivalent_mutants.toml`` with their reason. Exit status 1 where fewer than
``--least`` percent of the others are killed.
"""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import mutants
from mutant_runs import Copy, Recording, digest, recorded
from rooms import REPOSITORY

EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")


def main(arguments: list[str] | None = None) -> int:
    asked = _arguments().parse_args(arguments)
    repository, results = asked.repository.resolve(), asked.results.resolve()
    modules = [path for given in asked.modules for path in _modules(given.resolve())]
    recordings = [recorded(repository, results, tests, modules) for tests in asked.tests]
    chosen, of = mutants.sample(modules, asked.count, asked.seed)
    log, sources = results / "mutants.jsonl", digest(repository, asked.tests, asked.budget)
    known = _resumed(log)
    equivalent = _equivalent(asked.equivalent)
    found = []
    with Copy(repository, recordings[0].machine_code) as copy:
        for number, mutant in enumerate(chosen, 1):
            name = digest(mutant.text)
            before = known.get(name, {})
            if before.get("sources") not in (sources, _killer(repository, before) or sources):
                place = {"module": str(mutant.path.relative_to(repository)), "line": mutant.line, "change": mutant.words}
                place |= {"was": mutant.was, "became": mutant.became}
                verdict = _verdict(copy, mutant, recordings, before.get("test"), asked.budget)
                before = {"mutant": name, **place, **verdict}
                before["sources"] = _killer(repository, before) or sources
                with log.open("a", encoding="utf-8") as stream:
                    print(json.dumps(before), file=stream, flush=True)
            found.append(before)
            print(f"{number:4} of {len(chosen)}  {_in_words(before, equivalent)}", flush=True)
    return _conclude(found, equivalent, of, asked)


def _verdict(copy: Copy, mutant: mutants.Mutant, recordings: Iterable[Recording], killer: str | None, budget: float) -> dict[str, Any]:
    """What tests make of a mutant: its verdict, with the test that failed and what it said, or how many were tried."""
    tried: set[str] = set()
    unknown = ""
    stages = [recording.tests_of(mutant.path, None if mutant.at_import else mutant.line) for recording in recordings]
    stages = [*({test: stage[test] for test in stage if test == killer} for stage in stages), *stages]
    with copy.with_text(mutant.path, mutant.text):
        for stage in stages:
            if left := {test: seconds for test, seconds in stage.items() if test not in tried}:
                run = copy.run(left, budget)
                tried |= run.asked
                if run.killed:
                    return {"verdict": "killed", "how": run.how, "test": run.test, "said": run.said}
                unknown = unknown or run.how
    if unknown:
        return {"verdict": "unknown", "how": unknown, "tried": len(tried)}
    return {"verdict": "survives" if tried else "no test runs it", "tried": len(tried)}


def _killer(repository: Path, one: dict[str, Any]) -> str | None:
    """A digest of the file of the test that killed a mutant, whose verdict stands as long as that file does; None without one."""
    file = repository / str(one.get("test")).partition("::")[0]
    return digest(file.read_text(encoding="utf-8")) if file.exists() else None


def _conclude(found: list[dict[str, Any]], equivalent: dict[tuple[str, str, str], str], of: int, asked: argparse.Namespace) -> int:
    """Print the survivors and the sum; the exit status."""
    killed = [one for one in found if one["verdict"] == "killed"]
    alive = [one for one in found if one["verdict"] != "killed"]
    explained = [one for one in alive if _key(one) in equivalent]
    print()
    for one in sorted(alive, key=lambda one: (one["module"], one["line"])):
        print(_in_words(one, equivalent))
    counted = Counter(one["how"] for one in killed)
    print(", ".join(f"{count} {how}" for how, count in counted.most_common()))
    share = 100 * len(killed) / max(len(found) - len(explained), 1)
    told = f"without {len(explained)} that no test can tell from the product, {share:.1f} %"
    of_all = 100 * len(killed) / max(len(found), 1)
    print(f"{len(killed)} of {len(found)} mutants killed, {of_all:.1f} %; {told}; seed {asked.seed}, of {of} mutants")
    wrong = [one for one in killed if _key(one) in equivalent]
    for one in wrong:
        print(f"{one['module']}:{one['line']}: stands in {asked.equivalent.name}, and {one['test']} kills it: delete the entry")
    return int(bool(wrong) or share < asked.least)


def _in_words(one: dict[str, Any], equivalent: dict[tuple[str, str, str], str]) -> str:
    beside = {
        "killed": f"{one.get('how')}: {one.get('test')}",
        "unknown": str(one.get("how")),
        "survives": f"{one.get('tried')} tests tried",
    }.get(one["verdict"], "")
    reason = f"; equivalent: {equivalent[_key(one)]}" if one["verdict"] != "killed" and _key(one) in equivalent else ""
    return f"{one['module']}:{one['line']}: {one['verdict']} ({beside})  {' '.join(one['change'].split())}{reason}"


def _key(one: dict[str, Any]) -> tuple[str, str, str]:
    return one["module"], one["was"], one["became"]


def _equivalent(path: Path) -> dict[tuple[str, str, str], str]:
    """Reasons why no test can tell a mutant from the product, by module and the line without and with it."""
    entries = tomllib.loads(path.read_text(encoding="utf-8")).get("mutant", []) if path.exists() else []
    return {_key(entry): entry["reason"] for entry in entries}


def _modules(given: Path) -> list[Path]:
    return sorted(given.rglob("*.py")) if given.is_dir() else [given]


def _resumed(log: Path) -> dict[str, dict[str, Any]]:
    """The last line of each mutant in a log, of which an unfinished line is cut off."""
    text = log.read_text(encoding="utf-8") if log.exists() else ""
    log.write_text(text[: text.rfind("\n") + 1], encoding="utf-8")
    return {one["mutant"]: one for one in map(json.loads, log.read_text(encoding="utf-8").splitlines())}


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="+", type=Path, help="modules, or folders of them")
    parser.add_argument("--tests", action="append", required=True, metavar="WORDS", help="a stage: what pytest is given")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--least", type=float, default=90.0, metavar="PERCENT")
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS", help="of a processor, for one mutant's tests of one stage")
    parser.add_argument("--results", type=Path, default=REPOSITORY / ".mutation", metavar="FOLDER")
    parser.add_argument("--repository", type=Path, default=REPOSITORY, help=argparse.SUPPRESS)
    parser.add_argument("--equivalent", type=Path, default=EQUIVALENT, help=argparse.SUPPRESS)
    return parser


if __name__ == "__main__":
    sys.exit(main())
