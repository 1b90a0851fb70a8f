"""The hard states stored with a system, as states to compare at."""

from __future__ import annotations

import json

from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidInput
from harness.library import Library
from harness.results.hard_states import load_found, path_of


def stored_states(library: Library, mechanism: Mechanism) -> States | None:
    """The stored states of a mechanism without repetitions, in the file's order; None where there are none.

    Raises:
        InvalidInput: as ``load_found``, or a state does not have the mechanism's sizes.
    """
    distinct: dict[str, dict[str, list[float]]] = {}
    for number, found in enumerate(load_found(library, mechanism.name), start=1):
        sizes = [len(part) for part in found.state.values()]
        if sizes != [mechanism.nq, mechanism.nv, mechanism.nv]:
            problem = f"entry {number} has {sizes[0]}, {sizes[1]} and {sizes[2]} numbers for q, v and tau"
            expected = f"expected {mechanism.nq}, {mechanism.nv} and {mechanism.nv} as {mechanism.name} has; remove the entry"
            raise InvalidInput(path_of(library, mechanism.name), None, f"{problem}; {expected}")
        distinct[json.dumps(found.state)] = found.state
    return States.concatenate([States.at(**state) for state in distinct.values()]) if distinct else None
