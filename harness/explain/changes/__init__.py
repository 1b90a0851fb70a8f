"""Changes: what may be wrong with a model, or with what a reader makes of it, declared by name.

``readings`` are changes of a tree that engines' readers make, ``mistakes`` those that authors of files make, and ``numbers`` every single
number. ``held`` are numbers that an engine holds of one file otherwise than of another. All but the first are written into the text of a
file as a ``Change``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harness.files.text.scan import TextPlace

# Kinds of changes that no module declares: one number of a file, and one parameter of the truth.
NUMBER, PARAMETER = "number", "parameter"


@dataclass(frozen=True)
class Change:
    """One change of a model's text, at a free value or without one.

    Attributes:
        kind: name of its declaration. statement: what it says here, as "its damping was left out".
        places: every place that changes, the one that names it first; a mistake's are in lines of the text that has it, with those
            that it forgot to change.
        text: of the whole file with the change at a value; a change without a free value ignores it.
        start: the value at which ``text`` is the file as it is, or closest to it; None for a change without a free value.
        scale: a natural size of the value, above 0, for steps and for relative changes.
        through: from an engine to one that makes the mistake itself; None where the text has it.
        path: of the file that ``text`` is of, where a model has several; None for that of the model.
    """

    kind: str
    statement: str
    places: tuple[TextPlace, ...]
    text: Callable[[float], str]
    start: float | None = None
    scale: float = 1.0
    through: Callable[[Any], Any] | None = None
    path: Path | None = None

    @property
    def place(self) -> TextPlace:
        return self.places[0]

    @property
    def is_sized(self) -> bool:
        """True for a change with a free value."""
        return self.start is not None
