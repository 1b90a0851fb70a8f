"""What makes the numbers of a file the truth: the energies of the same mechanism move as they say."""

from __future__ import annotations

import numpy as np

from harness.certify.compare import compare
from harness.certify.reference import Reference, ReferenceKernel
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.files.model_file import ModelFile
from harness.verdict import AGREEMENT, Verdict


def hold_against_energies(declared: ModelFile, energies: ReferenceKernel, states: States, reference: Reference) -> None:
    """Refuse a file whose accelerations, ``reference``, with constraints held rigid, are not those of the energies at ``states``.

    Raises:
        InvalidModel: they are not.
    """
    comparison = compare(energies.evaluate(states), np.asarray(reference.high))
    if (comparison.verdicts == Verdict.DISAGREES.value).any():
        worst = f"{comparison.known('backward_error').max():.3g} data roundoffs from those of the energies"
        problem = f"the accelerations of its numbers are {worst}, expected up to {AGREEMENT:g}; check accelerations first"
        raise InvalidModel(declared.path, None, problem)
