"""Declarations found by name: a module of the package holds one, and no list is edited."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Mapping
from operator import attrgetter
from typing import TypeVar

from harness.errors import InvalidRequest
from harness.library import nearest

Declared = TypeVar("Declared")


def module_names(package: str) -> list[str]:
    """Names of a package's modules, sorted, without its packages, and modules that begin with an underscore, which several share."""
    found = pkgutil.iter_modules(importlib.import_module(package).__path__)
    return sorted(module.name for module in found if not (module.ispkg or module.name.startswith("_")))


def declared(package: str, kind: type[Declared], noun: str, key: Callable[[Declared], str] = attrgetter("name")) -> dict[str, Declared]:
    """Every object of one class that a module of one package holds, by itself or in a list or tuple.

    They are by key, in the order of the modules' names and of their text; ``noun`` is one of them in a message, as "method".

    Raises:
        ValueError: two declarations have one key.
    """
    found: dict[str, Declared] = {}
    for name in module_names(package):
        for value in vars(importlib.import_module(f"{package}.{name}")).values():
            for one in value if isinstance(value, (list, tuple)) else (value,):
                if isinstance(one, kind) and found.setdefault(key(one), one) is not one:
                    raise ValueError(f"{package} has two of the name {key(one)!r}; expected one {noun} of a name")
    return found


def select(names: Iterable[str], known: Mapping[str, Declared], noun: str) -> list[Declared]:
    """Those of ``known`` with these names, each once and in their order; all for none.

    Raises:
        InvalidRequest: a name that none has; the message gives the nearest one.
    """
    chosen = list(dict.fromkeys(names))
    for name in chosen:
        if name not in known:
            raise InvalidRequest(f"no {noun} is called {name!r}; {nearest(name, known)}")
    return [known[name] for name in chosen] or list(known.values())
