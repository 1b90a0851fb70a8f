"""What the model files of a system mean, held against its energies: by recursion over the file, and by no engine.

Engines that agree may share a misreading. MuJoCo leaves out a rotation of an inertia below about 2e-6 rad: a file with one of
5e-10 passes there, and fails with the engine that reads it as it stands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from harness.certify.compare import compare
from harness.certify.quantities.accelerations import reference_kernel
from harness.certify.sampling import sample
from harness.equations.derivation import load_mechanism
from harness.equations.states import States
from harness.errors import InvalidInput
from harness.library import Library
from harness.models.model_file import read_model
from harness.robots.accelerations import accelerations

# Sampled states beside those at which a subject is known to be wrong.
SAMPLED = 8


def errors_of_files(
    library: Library,
    name: str,
    paths: Mapping[str, Path],
    states: Sequence[Mapping[str, Sequence[float]]],
    seed: int,
    note: Callable[[str], None],
) -> dict[str, float]:
    """The largest backward error of each file's meaning [data roundoffs], by format; a file that has none that is known is left out.

    ``paths`` are the files by format, ``states`` {"q", "v", "tau"} each, of the free joints' velocities in the parent's frame.
    """
    mechanism = load_mechanism(library, name)
    everywhere = States.concatenate([sample(mechanism, SAMPLED, seed), *(States.at(**state) for state in states)])
    reference = reference_kernel(mechanism, False).evaluate(everywhere)
    found = {}
    for model_format, path in paths.items():
        note(model_format)
        try:
            meant = accelerations(read_model(path, model_format), mechanism.joints, mechanism.gravity, everywhere)
        except (InvalidInput, ValueError):
            # The record's own message has the reason.
            continue
        known = compare(reference, meant).known("backward_error")
        if len(known):
            found[model_format] = float(np.max(known))
    return found
