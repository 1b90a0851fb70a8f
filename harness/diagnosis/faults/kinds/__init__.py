"""Mistakes that no hypothesis of the diagnosis undoes, each a ``UnknownKind`` declared in a module of this package.

A campaign that plants what the diagnosis looks for shows how well it looks. These show what it says of the rest: they must be caught,
and the diagnosis should say that no single change explains them.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from harness.diagnosis.hypotheses import Planted
from harness.models.model_file import ModelFile


@dataclass(frozen=True)
class UnknownKind:
    """One kind of mistake outside the vocabulary of the diagnosis.

    Attributes:
        name: for the command line and the report. title: what people call the mistake. source: where it is known from.
        plants: the ways to make it in a sound model.
    """

    name: str
    title: str
    source: str
    plants: Callable[[ModelFile], Iterator[Planted]]

    def plant(self, model: ModelFile) -> Iterator[Planted]:
        """The mistakes that can be made in a model."""
        return self.plants(model)


def find_unknown_kinds() -> list[UnknownKind]:
    """Every kind that a module of this package holds, sorted by name."""
    modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    found = {value.name: value for module in modules for value in vars(module).values() if isinstance(value, UnknownKind)}
    return [found[name] for name in sorted(found)]
