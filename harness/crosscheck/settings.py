"""The choice of a cross-check, the states stored for it, the commands that repeat it, and the run in which it is made."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError
from pathlib import Path

from harness.engines import engine_files, subjects
from harness.environments import split_name
from harness.errors import EXTRAS, InvalidInput
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.hard_states import load_found, path_of
from harness.results.records import ACCELERATIONS, quantity_options
from harness.results.run import Run
from harness.version import __version__, version_of

DEFAULT_STATES = 1000
# States of a run that hypothesis chooses; the rest is sampled in bulk.
MOST_SEARCHED = 500


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A choice of comparisons.

    Attributes:
        library: where systems and models are. names: systems; subjects: as text; all for none.
        states: states per system; half of them, at most ``MOST_SEARCHED``, is searched for by
            hypothesis, the rest sampled. The hard states stored with a system come on top. seed: of both.
        stand_ins: model format to a file that stands in for the one system's own.
        state: the one state to compare at instead of sampling, for replays.
        examples: folder of hypothesis' example database; None for none.
        componentwise: whether every record gets its componentwise backward error; without, those that may be beyond ``AGREEMENT``.
        replay_options: command-line options that say where library and stand-ins are, for replay commands.
        worlds: equal ones that every subject is asked for at once, whether they answer alike; 0 for none.
    """

    library: Library
    names: Sequence[str] = ()
    subjects: Sequence[str] = ()
    states: int = DEFAULT_STATES
    seed: int = 0
    stand_ins: Mapping[str, Path] = field(default_factory=dict)
    state: States | None = None
    examples: Path | None = Path(".hypothesis/harness")
    componentwise: bool = False
    replay_options: Sequence[str] = ()
    worlds: int = 0

    def diagnosis(self, name: str, quantity: str = ACCELERATIONS) -> str:
        """The command that says all there is to say of why ``name``, or another system, is not as expected in a quantity."""
        chosen = [("--states", self.states, DEFAULT_STATES), ("--seed", self.seed, 0)]
        options = [str(word) for option, value, default in chosen if value != default for word in (option, value)]
        # Versions are asked by name alone; of others a diagnosis says more beside those that were not asked here.
        if not set(self.subjects) <= set(map(str, subjects(self.library))):
            options += [word for name in self.subjects for word in ("--subject", str(name))]
        return shlex.join(["harness", "diagnose", name, *self.replay_options, *quantity_options(quantity), *options])

    def held_against(self, name: str) -> str:
        """Advice in the place of a file that stands in for a robot's own."""
        options = [word for model_format, path in self.stand_ins.items() for word in (f"--{model_format}", str(path))]
        return f"to hold files against it: {shlex.join(['harness', 'diagnose', name, *options])}"

    @property
    def searched(self) -> int:
        return 0 if self.state is not None else min(self.states // 2, MOST_SEARCHED)


def stored_states(library: Library, mechanism: Mechanism) -> States | None:
    """The stored states of a mechanism without repetitions, in the file's order; None where there are none.

    Raises:
        InvalidInput: as ``load_found``, or a state does not have the mechanism's sizes.
    """
    distinct: dict[str, dict[str, list[float]]] = {}
    for number, found in enumerate(load_found(library, mechanism.name), start=1):
        sizes = [len(found.state[name]) for name in ("q", "v", "tau")]
        if sizes != [mechanism.nq, mechanism.nv, mechanism.nv]:
            problem = f"entry {number} has {sizes[0]}, {sizes[1]} and {sizes[2]} numbers for q, v and tau"
            expected = f"expected {mechanism.nq}, {mechanism.nv} and {mechanism.nv} as {mechanism.name} has; remove the entry"
            raise InvalidInput(path_of(library, mechanism.name), None, f"{problem}; {expected}")
        distinct[json.dumps(found.state)] = found.state
    return States.concatenate([States.at(**state) for state in distinct.values()]) if distinct else None


def describe_run(library: Library, states: int, seed: int, profile: str, command: Sequence[str], workers: str) -> Run:
    """Versions, machine and settings of a run that starts now; ``workers`` is how many processes it is spread over."""
    versions = {"harness": __version__, "python": platform.python_version()}
    for distribution in ("sympy", "numpy", "scipy", "python-flint", "hypothesis", *EXTRAS):
        with contextlib.suppress(PackageNotFoundError):
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
        titles={name: file.title for name, file in known.items() if file.title},
    )
