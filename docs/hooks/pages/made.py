"""What a generator of pages returns, and the few words of Markdown that all write."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[3]
DOCS = REPOSITORY / "docs"


@dataclass
class Made:
    """Files by their paths in the documentation, and entries of the navigation as mkdocs has them."""

    files: dict[str, str | bytes] = field(default_factory=dict)
    nav: list[Any] = field(default_factory=list)


def fenced(text: str, language: str = "text", marked: Iterable[int] = ()) -> str:
    """A block of code, in which the lines ``marked`` are highlighted."""
    lines = " ".join(str(line) for line in sorted(set(marked)))
    highlighted = f' hl_lines="{lines}"' if lines else ""
    return f"```{language}{highlighted}\n{text.strip(chr(10))}\n```\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(escaped(cell) for cell in line) + " |" for line in lines) + "\n"


def escaped(cell: str) -> str:
    """Text on one line of a table."""
    return " ".join(cell.split()).replace("|", "\\|")


def literal(text: str) -> str:
    """Text whose characters mean nothing in Markdown."""
    return re.sub(r"([\\`*_{}\[\]<>#|])", r"\\\1", text)


def linked(text: str) -> str:
    """Text in which addresses are links."""
    return re.sub(r"https?://[^\s;,)]+", lambda found: f"<{found[0]}>", text)
