"""Outcomes of the units under way, kept in the cache so that a night that was killed asks only for what was not answered.

What a unit asks follows from the outcomes before, in the order in which they came: the same outcomes bring it to the same point. Of a
cross-check an outcome is that of a batch of states.

An outcome is a pickle. The cache holds machine code, too: whoever may write there is trusted with what runs.
"""

from __future__ import annotations

import base64
import hashlib
import itertools
import pickle
import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from harness.storage import cache_directory, read_entry, write_entry
from harness.workers import Outcome, Task

_DIGITS = 32


@dataclass(frozen=True)
class Answered:
    """The outcomes of the units of a night, or of a stage of it, each unit's in a folder of its own."""

    folder: Path

    @classmethod
    def of(cls, history: Path, library: str, started: str) -> Answered:
        """Those of the night of a library that began at ``started`` and is kept in the file ``history``."""
        return cls(cache_directory() / "nights" / _name(f"{history.resolve()} {library}") / _name(started))

    def of_stage(self, stage: str) -> Answered:
        """Those of one stage of the night."""
        return Answered(self.folder / _name(stage))

    def forget_all(self) -> None:
        """Remove those of all nights of the same library and history."""
        shutil.rmtree(self.folder.parent, ignore_errors=True)

    def forget(self, unit: str) -> None:
        """Remove the outcomes of a unit that is complete."""
        shutil.rmtree(self._folder(unit), ignore_errors=True)

    def count(self) -> int:
        """The number of outcomes of the night, without what a kill left of one that was being written."""
        return sum(path.is_file() and not path.name.startswith(".") for path in self.folder.rglob("*"))

    def keep(self, unit: str, number: int, place: int, outcome: Outcome) -> None:
        """Keep outcome ``number`` of a unit, from 0 in the order in which they come; ``place`` is that of its task among the unit's.

        What cannot be pickled or written is asked again, with all behind it.
        """
        with suppress(Exception):
            content = pickle.dumps((place, outcome.value, outcome.exception, outcome.crash), protocol=5)
            write_entry(self._folder(unit) / str(number), base64.b64encode(content).decode())

    def read(self, unit: str) -> Iterator[tuple[int, Outcome]]:
        """The outcomes of a unit in their order, each with the place of its task; the tasks themselves are not kept."""
        for number in itertools.count():
            if (text := read_entry(self._folder(unit) / str(number))) is None:
                return
            try:
                place, value, exception, crash = pickle.loads(base64.b64decode(text))
            # Of another version of a library, which may say so in any way.
            except Exception:
                return
            yield place, Outcome(Task(None, _nothing, ()), value, exception, crash)

    def _folder(self, unit: str) -> Path:
        return self.folder / _name(unit)


def _name(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:_DIGITS]


def _nothing() -> None:
    """Stands for the function of a task that need not run again."""
