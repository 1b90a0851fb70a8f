"""Parts of models that their scenes do not need, as plain data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SuperfluousPart:
    """A part of a model that its scene does not need.

    ``attribute`` is "" where the element itself is meant, whose name is then the value, and "text" for what
    stands between its tags.
    """

    system: str
    subject: str
    path: str
    line: int
    element: str
    attribute: str
    value: str
    why: str

    def __str__(self) -> str:
        part = {
            "": f"<{self.element} {self.value}>" if self.value else f"<{self.element}>",
            "text": f"<{self.element}>{self.value}</{self.element}>",
        }.get(self.attribute, f'<{self.element} {self.attribute}="{self.value}">')
        return f"{self.path}:{self.line}: {part} {self.why}"
