"""The common form of what studies find: dataclasses whose fields are lists of plain data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self


@dataclass(kw_only=True)
class StudyResult:
    """Base of the results; a part that was not asked for is an empty list.

    Attributes:
        STUDY: name under which the history keeps results of this class.
    """

    STUDY: ClassVar[str]

    def extend(self, more: Self) -> None:
        """Add what another task of the same study found."""
        for part in fields(self):
            getattr(self, part.name).extend(getattr(more, part.name))

    def stored_parts(self) -> Iterator[tuple[str, Any]]:
        """(field, one of its items) of every field that does not follow from the others."""
        for part in fields(self):
            if not part.metadata.get("derived"):
                yield from ((part.name, item) for item in getattr(self, part.name))
