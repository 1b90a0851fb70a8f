"""Pieces of Markdown: tables, lists and text that cannot break them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; "" without rows."""
    if not rows:
        return ""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(map(cell, line)) + " |" for line in lines)


def bullets(items: Iterable[str]) -> str:
    """A list; "" without items."""
    return "\n".join(f"- {item}" for item in items)


def plain(text: str) -> str:
    """``text`` on one line, without tags."""
    return " ".join(text.split()).replace("<", "&lt;")


def cell(text: str) -> str:
    """``text`` as a cell of a table."""
    return plain(text).replace("|", "\\|")


def fenced(text: str) -> str:
    """``text`` as it is, whatever it holds."""
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"{fence}text\n{text}\n{fence}"
