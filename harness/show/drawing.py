"""A drawing that stands alone: in a notebook, and as a file of its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

# Colours of a light page, which a notebook's own scheme does not change.
_COLOURS = "--panel: #f5f6f8; --ink: #1c2127; --soft: #58616c; --rule: #d5d9df;"


@dataclass(frozen=True, repr=False)
class Drawing:
    """An ``<svg>`` element with its looks in it. A notebook shows it.

    Attributes:
        svg: the element. title: what it shows, in words.
    """

    svg: str
    title: str

    @classmethod
    def styled(cls, drawn: str, kind: str, rules: str, title: str) -> Drawing:
        """An ``<svg>`` element of class ``kind`` with the rules of a style sheet, whose colours are variables as in the report's."""
        opening, end, rest = drawn.partition(">")
        return cls(f"{opening}{end}<style>svg.{kind} {{ {_COLOURS} }}\n{rules}</style>{rest}", title)

    def save(self, path: str | Path) -> None:
        """Write the drawing to an SVG file.

        Raises:
            OSError: the file cannot be written.
        """
        Path(path).write_text(self.svg, encoding="utf-8")

    def __repr__(self) -> str:
        return f"<{self.title}; a notebook shows it, and save(path) writes it to an SVG file>"

    def _repr_svg_(self) -> str:
        return self.svg
