"""Declarations found by name: a module of the package holds one, and no list is edited."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Generic, TypeVar

from harness.errors import InvalidRequest
from harness.library import nearest

Declared = TypeVar("Declared")


def module_names(package: str) -> list[str]:
    """Names of a package's modules, sorted, without its packages, and modules that begin with an underscore, which several share."""
    found = pkgutil.iter_modules(importlib.import_module(package).__path__)
    return sorted(module.name for module in found if not (module.ispkg or module.name.startswith("_")))


@dataclass(frozen=True)
class Registry(Generic[Declared]):
    """Every object of one class that a module of one package holds, by itself or in a list or tuple.

    Attributes:
        package: whose modules are imported when the registry is asked, and not before.
        kind: class of the declarations. noun: of one of them in a message, as "method".
        key: of a declaration, by which it is told from the others.
    """

    package: str
    kind: type[Declared]
    noun: str
    key: Callable[[Declared], str] = attrgetter("name")

    def all(self) -> dict[str, Declared]:
        """The declarations by key, in the order of the modules' names and of their text.

        Raises:
            ValueError: two declarations have one key.
        """
        found: dict[str, Declared] = {}
        for name in module_names(self.package):
            for value in vars(importlib.import_module(f"{self.package}.{name}")).values():
                for one in value if isinstance(value, (list, tuple)) else (value,):
                    if isinstance(one, self.kind) and found.setdefault(self.key(one), one) is not one:
                        raise ValueError(f"{self.package} has two of the name {self.key(one)!r}; expected one {self.noun} of a name")
        return found

    def sorted(self) -> dict[str, Declared]:
        """The declarations in the order of their keys."""
        return dict(sorted(self.all().items()))

    def select(self, names: Iterable[str]) -> list[Declared]:
        """The declarations of these keys, each once; all for none.

        Raises:
            InvalidRequest: a name that none has; the message gives the nearest one.
        """
        return select(names, self.all(), self.noun)


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
