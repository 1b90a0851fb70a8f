"""Addresses of the pages of a report, and of places on them, made of names that may hold anything."""

from __future__ import annotations

import re
from collections.abc import Iterable

INDEX, BENCHMARK, HARD, ROBOTS = "index.html", "benchmark.html", "hard.html", "robots.html"


def slugs(names: Iterable[str]) -> dict[str, str]:
    """A word for each name that a file, an address and an ``id`` may hold, no two alike, whatever a file system makes of case."""
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_.@]+", "-", name).strip(".") or "-"
        number, word = 2, plain
        while word.casefold() in taken:
            number, word = number + 1, f"{plain}-{number}"
        taken.add(word.casefold())
        found[name] = word
    return found


def pages(folder: str, names: Iterable[str]) -> dict[str, str]:
    """The page of each name in a folder."""
    return {name: f"{folder}/{word}.html" for name, word in slugs(names).items()}
