"""A run and its systems as plain data for the report."""

from __future__ import annotations

import os
import platform
import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from statistics import median

from harness.crosscheck.judgement import Pair, SystemProgress
from harness.engines import EQUATIONS, engine_files
from harness.environments.folders import split_name
from harness.files.model_file import ModelFile, features_of
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.cross_check import SystemCard
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


def asked_features(system: SystemProgress, pair: Pair) -> list[str]:
    """What mechanism and model ask of the subject; of one that reads no model, what the models of the mechanism would."""
    own = pair.subject.format
    models = [model for name, model in system.models.items() if isinstance(model, ModelFile) and own in (name, EQUATIONS)]
    ties = None if system.mechanism is None else system.mechanism.constraints
    rolling = {"rolling"} if ties is not None and ties.holonomic < len(ties.rows) else set()
    return sorted(rolling.union(*map(features_of, models)))
