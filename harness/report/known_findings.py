"""What engines are known to get wrong beside the mechanisms, as ``known_findings.toml`` declares it, which says who meets it."""

from __future__ import annotations

import functools
import tomllib
from importlib.resources import files

import msgspec


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
