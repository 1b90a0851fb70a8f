"""``harness list KIND``: every name that another command takes."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

import pytest
from support import harness

from harness.bench.methods import DERIVATIVES, find_methods
from harness.diagnosis.faults.campaign import kinds_of_faults
from harness.hard.cases import hard_cases
from harness.motion.integrators import KINDS, integrators

NAMES = {
    "cases": ("case", hard_cases()),
    "derivatives": ("method", [method.name for method in find_methods(DERIVATIVES)]),
    "faults": ("kind", kinds_of_faults()),
    "integrators": ("integrator", [integrator.name for integrator in integrators()]),
    "methods": ("method", list(dict.fromkeys(method.name for of in KINDS for method in find_methods(of)))),
}


@pytest.mark.parametrize("kind", NAMES)
def test_every_name_of_a_kind_is_listed(kind: str, tmp_path: Path) -> None:
    title, names = NAMES[kind]
    done = harness("list", kind, "--json", "out.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line[: len(name)] for line, name in zip(lines[3:], names, strict=False)] == list(names)
    assert lines[0].startswith("Names that harness ")
    assert [row[title] for row in json.loads((tmp_path / "out.json").read_text())[kind]] == list(names)


@pytest.mark.ci
def test_the_kinds_are_said_where_somebody_looks_for_them() -> None:
    kinds: Collection[str] = NAMES.keys()
    assert harness("list").stdout.splitlines()[-1] == f"other names: harness list {'|'.join(kinds)}"
    unknown = harness("list", "charts")
    assert unknown.returncode == 2 and all(f"'{kind}'" in unknown.stderr for kind in kinds)
    assert "harness list faults" in harness("faults", "--kind", "axes").stderr
