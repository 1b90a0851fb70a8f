"""Contacts of an engine held against the shapes of a file, as plain data and in a sentence."""

from __future__ import annotations

from dataclasses import dataclass, field

from harness.results.table import counted_nouns, error_text


@dataclass(frozen=True, kw_only=True)
class ShapesRecord:
    """The contacts that an engine finds, against those that the file has.

    Attributes:
        contacts: how many are judged by closed forms. given: how many are taken as the engine finds them.
        error: the worst of distances, normals and points, in roundoffs of what is added.
        rest: what is otherwise than in the file, a sentence for each pair of shapes and kind.
        rule: the engine's rule for shapes that explains all, and what to do about it; "" for the documented one.
    """

    verdict: str
    contacts: int
    given: int
    error: float
    rest: list[str] = field(default_factory=list)
    rule: str = ""

    @property
    def text(self) -> str:
        """The judgement as a sentence."""
        given = f"; {counted_nouns(self.given, 'contacts')} of other shapes taken as found" if self.given else ""
        if self.rest:
            more = f", and {counted_nouns(len(self.rest) - 1, 'further differences')}" if len(self.rest) > 1 else ""
            return f"other contacts than the file has: {self.rest[0]}{more}"
        if not self.contacts:
            return f"no contact is of shapes with a closed form{given}" if given else "no shapes touch, and none do by the file"
        by, why = ("the engine's own rule", f". {self.rule}") if self.rule else ("the file", "")
        return f"{counted_nouns(self.contacts, 'contacts')} within {error_text(self.error)} roundoffs of where {by} has them{given}{why}"
