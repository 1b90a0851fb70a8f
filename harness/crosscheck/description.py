"""A run and its systems as plain data for the report."""

from __future__ import annotations

import os
import platform
import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from statistics import median

from harness.engines import engine_files
from harness.environments.folders import split_name
from harness.equations.mechanism import Mechanism
from harness.library import Library
from harness.results.records import Run, SystemCard
from harness.version import __version__, version_of


def describe_run(library: Library, states: int, seed: int, profile: str, command: Sequence[str], workers: str) -> Run:
    """Versions, machine and settings of a run that starts now; ``workers`` is how many processes it is spread over."""
    versions = {"harness": __version__, "python": platform.python_version()}
    for distribution in ("sympy", "numpy", "scipy", "heyoka", "python-flint", "hypothesis", "cma", "distributed"):
        versions[distribution] = version_of(distribution)
    engines = {name: file for name, file in engine_files(library).items() if not split_name(name)[1]}
    versions |= {file.requires[1]: file.version for file in engines.values() if file.version is not None}
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
    )


def describe_system(mechanism: Mechanism, reference_seconds: Sequence[float], compilation_seconds: float | None = None) -> SystemCard:
    """The card of a system in a report.

    ``reference_seconds`` are the costs per certified state, ``compilation_seconds`` is that of the certified kernel [s].
    """
    return SystemCard(
        name=mechanism.name,
        description=mechanism.description,
        source=mechanism.source,
        coordinates=[{"name": name, "joint": joint} for name, joint in zip(mechanism.coordinates, mechanism.joints, strict=True)],
        parameters=[{"name": name, "value": value, "unit": unit} for name, value, unit in mechanism.parameters],
        equations_mathml=mechanism.equations_mathml,
        equations_text=mechanism.equations_text,
        energies_text=mechanism.energies_text,
        operations=mechanism.operations,
        derivation_seconds=mechanism.derivation_seconds,
        reference_seconds_per_state=median(reference_seconds) if reference_seconds else None,
        compilation_seconds=compilation_seconds,
    )
