"""docs/reference/solvers.md: how near each solver of constraints comes to the optimum, on known robots and over numbers of contacts."""

from __future__ import annotations

import importlib.util
import json
import math
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
# Contacts of a tray on so many feet.
FEET, CONES = (1, 10, 50), ("pyramidal", "elliptic")


def files() -> list[Path]:
    """The robots' files of dm_control's suite.

    Raises:
        LookupError: it is not installed, with what to do.
    """
    found = importlib.util.find_spec("dm_control")
    if found is None or not found.submodule_search_locations:
        raise LookupError('dm_control is not installed; run pip install -e ".[robots]"')
    return sorted(Path(found.submodule_search_locations[0], "suite").glob("*.xml"))


def tray(feet: int, cone: str) -> str:
    """An MJCF of a tray that falls from 5 mm on feet that are spread over it as the seeds of a sunflower."""
    angles = [number * math.pi * (3 - math.sqrt(5)) for number in range(feet)]
    radii = [0.3 * math.sqrt((number + 0.5) / feet) for number in range(feet)]
    geoms = "".join(
        f'<geom size="0.02" pos="{radius * math.cos(angle):.6f} {radius * math.sin(angle):.6f} -0.1"/>'
        for radius, angle in zip(radii, angles, strict=True)
    )
    inertial = '<inertial pos="0 0 0" mass="2" diaginertia="0.05 0.05 0.09"/>'
    body = f'<body name="tray" pos="0 0 0.125"><freejoint/>{inertial}{geoms}</body>'
    floor = '<geom name="floor" type="plane" size="2 2 1"/>'
    return f'<mujoco><option cone="{cone}"/><worldbody>{floor}{body}</worldbody></mujoco>'


def trays(folder: Path) -> list[Path]:
    """The files of trays of each number of feet with each kind of cones, which are written."""
    found = []
    for feet in FEET:
        for cone in CONES:
            found.append(folder / f"{feet} {'contact' if feet == 1 else 'contacts'}, {cone}.xml")
            found[-1].write_text(tray(feet, cone), encoding="utf-8")
    return found


def measured(paths: Iterable[Path]) -> dict[str, Any]:
    """The JSON of ``harness bench --solvers`` on these files."""
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "solvers.json"
        command = [sys.executable, "-m", "harness", "bench", *map(str, paths), "--solvers", "--methods", "mujoco", "--json", str(found)]
        # Its exit status tells of files that leave nothing to a solver.
        subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
        content: dict[str, Any] = json.loads(found.read_text(encoding="utf-8"))
    return content


def page(found: Mapping[str, Any], of_trays: Mapping[str, Any]) -> str:
    """The page with a row for each file on which something is left to a solver, and one for each number of contacts."""
    version = found["benchmark"]["run"]["versions"]["mujoco"]
    rows = "\n".join(f"| {' | '.join([name, *_cells(own)])} |" for name, own in sorted(_by_file(found).items()))
    of_contacts = "\n".join(f"| {' | '.join([Path(name).stem, *_cells(own, is_timed=True)])} |" for name, own in _by_file(of_trays).items())
    columns = " | ".join([*(f"{method} as the file says" for method in METHODS), *METHODS])
    dashes = " | ".join("---" for _ in METHODS * 2)
    return f"""# Solvers

MuJoCo's [constraints are soft](../concepts/constraints.md#soft-constraints): it documents an optimum, and its solvers approach it. These
tables say how far MuJoCo {version} is from that optimum on the robots of dm_control's suite. Everything that is judged is on. Up to 64
states of each robot are asked: in free motion, beyond limits, and where MuJoCo's own steps lead. `python -m benchmarks solvers` made this
page.

The columns *as the file says* have the worst relative error with the iterations and the tolerance of the file, or with MuJoCo's defaults
of 100 and 1e-8. The other columns have a tolerance of 0. They say how many iterations it takes until every answer is right to the last
digit, or which worst relative error is left after 1,024.

| file | states | where bodies touch | {columns} |
| --- | --- | --- | {dashes} |
{rows}

With elliptic cones, PGS leaves out contacts whose force begins with friction, so it cannot reach their optimum.
`harness bench FILE --solvers --all` has every step, with its time.

## By cones and number of contacts

A tray falls on feet, as many as there are contacts, at 64 states, with MuJoCo's default iterations and tolerance. The first figure of
each cell is that of the table above, the second the median time of such a call.

| contacts | states | where bodies touch | {columns} |
| --- | --- | --- | {dashes} |
{of_contacts}
"""


def _by_file(found: Mapping[str, Any]) -> dict[str, list[Mapping[str, Any]]]:
    """Costs by the names of files on which something is left to a solver."""
    costs: dict[str, list[Mapping[str, Any]]] = {}
    for cost in found["benchmark"]["solvers"]:
        if cost["states"]:
            costs.setdefault(Path(cost["system"]).name, []).append(cost)
    return costs


def _cells(costs: list[Mapping[str, Any]], is_timed: bool = False) -> list[str]:
    """The cells of a row, which has the median time of each call too where it is timed."""
    of_file = costs[0]
    ends = {(cost["method"], cost["iterations"] is None): cost for cost in costs}
    cells = []
    for cost in (ends[method, is_of_file] for is_of_file in (True, False) for method in METHODS):
        reached = relative_text(cost["relative_error"])
        if cost["iterations"] is not None:
            reached = f"{cost['iterations']:,}" if cost["right"] == cost["states"] else f"{reached} left"
        cells.append(f"{reached}, {cost['seconds_per_state'] * 1e6:.3g} µs" if is_timed else reached)
    return [str(of_file["states"]), str(of_file["touching"]), *cells]
