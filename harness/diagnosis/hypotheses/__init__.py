"""The mistakes that a model may have, each a ``Hypothesis`` declared in a module of this package.

A hypothesis is two functions of a model's text. ``mend`` lists the changes that would undo the mistake, wherever it
could have been made; diagnosis tries them all. ``plant`` makes the mistake, wherever it can be made; the fault campaign
plants them all. No engine is imported here: what a change does to accelerations is found by ``harness.models.text.Watch``.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from harness.models.model_file import ModelFile
from harness.models.text import Place


@dataclass(frozen=True)
class Candidate:
    """One change of a model's text that may explain why an engine's accelerations are not the reference's.

    Attributes:
        hypothesis: name of the hypothesis; statement: what it says here, as "its damping was left out".
        place: what would change.
        text: of the whole file, with the change at a value; a change without a free value ignores it.
        start: the value at which ``text`` is the file as it is, or closest to it; None for a change without a free value.
        scale: a natural size of the value, above 0, for steps and for relative changes.
    """

    hypothesis: str
    statement: str
    place: Place
    text: Callable[[float], str]
    start: float | None = None
    scale: float = 1.0


@dataclass(frozen=True)
class Planted:
    """One mistake made in a model's text.

    Attributes:
        kind: name of the hypothesis; statement: what was done.
        places: every place that the mistake changed or forgot to change, in lines of the planted text; who names one of them
            names the mistake.
        text: of the whole file with the mistake at a size, relative to the number changed; a mistake without sizes ignores it.
        sized: whether it has sizes.
    """

    kind: str
    statement: str
    places: tuple[Place, ...]
    text: Callable[[float], str]
    sized: bool = False


@dataclass(frozen=True)
class Hypothesis:
    """One kind of mistake.

    Attributes:
        name: for the command line and the report. title: what people call the mistake.
        mend: the changes of a model that would undo it; none where every model that has the mistake is refused by name before
            a diagnosis. plant: the ways to make it in a sound model.
        source: where the mistake is known from.
    """

    name: str
    title: str
    mend: Callable[[ModelFile], Iterator[Candidate]]
    plant: Callable[[ModelFile], Iterator[Planted]]
    source: str


def find_hypotheses() -> list[Hypothesis]:
    """Every hypothesis that a module of this package holds, sorted by name."""
    modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    found = {value.name: value for module in modules for value in vars(module).values() if isinstance(value, Hypothesis)}
    return [found[name] for name in sorted(found)]
