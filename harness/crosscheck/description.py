"""A run as plain data for the report."""

from __future__ import annotations

import os
import platform
import shlex
from collections.abc import Sequence
from datetime import UTC, datetime

from harness.engines import engine_files
from harness.environments import split_name
from harness.library import Library
from harness.results.records import Run
from harness.version import __version__, version_of


def describe_run(library: Library, states: int, seed: int, profile: str, command: Sequence[str], workers: str) -> Run:
    """Versions, machine and settings of a run that starts now; ``workers`` is how many processes it is spread over."""
    versions = {"harness": __version__, "python": platform.python_version()}
    for distribution in ("sympy", "numpy", "scipy", "heyoka", "python-flint", "hypothesis", "cma", "distributed"):
        versions[distribution] = version_of(distribution)
    known = {name: file for name, file in engine_files(library).items() if not split_name(name)[1]}
    engines = {name: file for name, file in known.items() if file.version is not None}
    versions |= {file.requires[1]: str(file.version) for file in engines.values()}
    machine = {"system": platform.system(), "processor": platform.machine(), "cpus": str(os.cpu_count()), "worker processes": workers}
    # Of other programs: at the start none of the run's own is at work.
    machine |= {"load": f"{os.getloadavg()[0]:.2f} at the start"} if hasattr(os, "getloadavg") else {}
    return Run(
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=versions,
        machine=machine,
        seed=seed,
        profile=profile,
        states=states,
        library=library.name,
        command=shlex.join(command),
        engines={name: str(file.version) for name, file in engines.items()},
    )
