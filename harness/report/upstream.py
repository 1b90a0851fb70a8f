"""Issues in the engines' own trackers, as ``upstream.toml`` declares them, and findings beside the mechanisms, as
``known_findings.toml`` does.
"""

from __future__ import annotations

import functools
import tomllib
from dataclasses import dataclass
from importlib.resources import files

import msgspec

from harness.results.site import Upstream


@dataclass(frozen=True, kw_only=True)
class Declared(Upstream):
    """An entry of the file: of a ``feature`` of the engine, or of ways of asking it whose names begin with ``way``."""

    engine: str
    feature: str = ""
    way: str = ""

    @property
    def issue(self) -> Upstream:
        return Upstream(title=self.title, link=self.link, state=self.state, seen=self.seen)


@functools.cache
def declared() -> list[Declared]:
    """Every entry.

    Raises:
        ValueError: the file holds something else.
    """
    text = files(__package__).joinpath("upstream.toml").read_text("utf-8")
    return [msgspec.convert(entry, Declared) for entry in tomllib.loads(text)["upstream"]]


def of_feature(engine: str, feature: str) -> list[Upstream]:
    """The issues on a feature of an engine."""
    return [one.issue for one in declared() if one.engine == engine and one.feature == feature]


def of_way(engine: str, way: str) -> list[Upstream]:
    """The issues on a way of asking an engine."""
    return [one.issue for one in declared() if one.engine == engine and one.way and way.startswith(one.way)]


class KnownFinding(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One ``[[finding]]`` table.

    Attributes:
        engine, version: of the engine that was tried. title: what it does. link: where its own source or tracker says so.
        reproducer: a program that needs the engine alone; its last two lines of output are what the engine says and what is right.
    """

    engine: str
    version: str
    title: str
    link: str
    reproducer: str


@functools.cache
def known_findings() -> list[KnownFinding]:
    """Every table.

    Raises:
        ValueError: the file holds something else.
    """
    text = files(__package__).joinpath("known_findings.toml").read_text("utf-8")
    return [msgspec.convert(entry, KnownFinding) for entry in tomllib.loads(text)["finding"]]
