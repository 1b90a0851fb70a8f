"""Measures the CPU seconds of commands and writes docs/reference/costs.md.

    python docs/hooks/command_costs.py

Each command runs twice, so that what is derived once is in the cache; the second run counts, with all of its processes.
"""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from pages.made import DOCS, REPOSITORY, table

PAGE = DOCS / "reference" / "costs.md"
ARM, ROBOTS = "harness/robots/arm.urdf", "harness/robots"
# Commands by what they stand for; {out} is a folder that goes away.
COMMANDS = {
    "list": "mechanisms and engines",
    "list cases": "other names",
    "show double_pendulum": "equations and models",
    f"compare {ARM}": "a robot with 6 degrees of freedom",
    f"compare {ARM} harness/robots/arm.xml": "two files of it",
    f"compare {ARM} --steps 100": "the gap between two motions",
    f"check {ARM}": "the same robot at searched states",
    f"survey {ROBOTS} --out {{out}}": "five robots' files",
    "check double_pendulum": "2 degrees of freedom, all quick quantities",
    "check double_pendulum --quantity accelerations": "accelerations alone",
    "check puma_560": "6 degrees of freedom",
    "check double_pendulum --quantity reactions": "what joints transmit",
    "check double_pendulum --quantity derivatives": "both kinds of derivatives",
    "diagnose double_pendulum": "a sound mechanism",
    "search double_pendulum --subject mujoco/mjcf --no-keep": "worst states of one engine",
    "bench double_pendulum": "cost against error",
    "faults double_pendulum --kind axis": "one kind of planted faults",
}
NOT_MEASURED = (
    "`harness report`, `nightly`, `atlas` and a check without names cover the whole catalogue: one to several minutes once the equations "
    "are in the cache. Deriving them takes about half a minute, once. `harness upgrade` and `engines add` take what pip takes for an "
    "engine, the first time."
)


def cpu_seconds(command: str, folder: str) -> float:
    """What the second run of a command takes of all processors.

    Raises:
        subprocess.CalledProcessError: it fails.
    """
    words = [sys.executable, "-m", "harness", *command.format(out=folder).split()]
    for _ in range(2):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(words, cwd=REPOSITORY, env=os.environ | {"PYTHONPATH": str(REPOSITORY)}, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def page() -> str:
    """The page with a measured table."""
    rows = []
    for command, what in COMMANDS.items():
        with tempfile.TemporaryDirectory() as folder:
            seconds = cpu_seconds(command, folder)
        shown = command.removesuffix(" --out {out}")
        rows.append([f"`harness {shown}`", what, f"{seconds:.1f}" if seconds < 10 else f"{seconds:.0f}"])
    machine = f"a virtual machine with {os.cpu_count()} {platform.machine()} cores"
    return "\n".join(
        [
            "# Costs\n",
            f"CPU seconds of all processes together, on {machine}, measured by `python docs/hooks/command_costs.py`.",
            "On several cores a command takes less time than that.\n",
            table(["command", "what it stands for", "CPU seconds"], rows),
            f"{NOT_MEASURED}\n",
            "`harness bench NAME` measures what engines cost. The limits on a cluster are on [its page](../how-to/cluster.md).\n",
        ]
    )


def main(path: Path = PAGE) -> None:
    """Measure, and write the page."""
    path.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
