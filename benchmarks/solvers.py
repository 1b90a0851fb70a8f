"""docs/reference/solvers.md: how near each solver of constraints comes to the optimum, on the robots of dm_control's suite."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.history import REPOSITORY
from harness.results.table import relative_text

PAGE = REPOSITORY / "docs" / "reference" / "solvers.md"
METHODS = ("Newton", "CG", "PGS")


def files() -> list[Path]:
    """The robots' files of dm_control's suite.

    Raises:
        LookupError: it is not installed, with what to do.
    """
    found = importlib.util.find_spec("dm_control")
    if found is None or not found.submodule_search_locations:
        raise LookupError('dm_control is not installed; run pip install -e ".[robots]"')
    return sorted(Path(found.submodule_search_locations[0], "suite").glob("*.xml"))


def measured(paths: Iterable[Path]) -> dict[str, Any]:
    """The JSON of ``harness bench --solvers`` on these files."""
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "solvers.json"
        command = [sys.executable, "-m", "harness", "bench", *map(str, paths), "--solvers", "--methods", "mujoco", "--json", str(found)]
        # Its exit status tells of files that leave nothing to a solver.
        subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
        content: dict[str, Any] = json.loads(found.read_text(encoding="utf-8"))
    return content


def page(found: Mapping[str, Any]) -> str:
    """The page with a row for each file on which something is left to a solver."""
    version = found["benchmark"]["run"]["versions"]["mujoco"]
    costs: dict[str, list[Mapping[str, Any]]] = {}
    for cost in found["benchmark"]["solvers"]:
        if cost["states"]:
            costs.setdefault(Path(cost["system"]).name, []).append(cost)
    rows = "\n".join(f"| {' | '.join([name, *_cells(own)])} |" for name, own in sorted(costs.items()))
    return f"""# Solvers

How far MuJoCo {version} is from the optimum that it documents, on the robots of dm_control's suite with everything on that is judged,
at 64 states of each: in free motion, beyond limits, and where its own steps lead. Made by `python -m benchmarks solvers`.

*As the file says* is the worst relative error with the file's own solver, iterations and tolerance. The other columns have a tolerance of 0
and say within how many iterations every answer is right to the last digit, or what the worst relative error is after 1,024.

| file | states | where bodies touch | as the file says | {" | ".join(METHODS)} |
| --- | --- | --- | --- | {" | ".join("---" for _ in METHODS)} |
{rows}

PGS with elliptic cones leaves out contacts whose force begins with friction: their optimum is out of its reach.
`harness bench FILE --solvers --all` has every step, with its time.
"""


def _cells(costs: list[Mapping[str, Any]]) -> list[str]:
    of_file, *others = costs
    ends = {cost["method"]: cost for cost in others}
    reached = [
        f"{last['iterations']:,}" if last["right"] == last["states"] else f"{relative_text(last['relative_error'])} left"
        for last in (ends[method] for method in METHODS)
    ]
    return [str(of_file["states"]), str(of_file["touching"]), relative_text(of_file["relative_error"]), *reached]
