"""The outcomes that a folder of robots is expected to have, where an explained answer is not enough.

``expected_robots.toml`` beside the files holds an entry for each::

    [[expected]]
    file = "arm.urdf"
    subject = "mujoco/urdf"
    outcome = "refused"
    reason = "why, in a sentence"
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec

from harness.errors import InvalidInput

NAME = "expected_robots.toml"


class ExpectedOutcome(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One entry; ``file`` is relative to the folder, ``outcome`` as of ``harness.results.comparison.SubjectRecord``."""

    file: str
    subject: str
    outcome: str
    reason: str


class _File(msgspec.Struct, forbid_unknown_fields=True):
    expected: list[ExpectedOutcome] = []


@dataclass(frozen=True)
class Expectations:
    """The entries of a folder."""

    path: Path
    entries: tuple[ExpectedOutcome, ...] = ()

    def of(self, path: Path, subject: str) -> ExpectedOutcome | None:
        """The entry of a file and subject; None without one."""
        own = (entry for entry in self.entries if (self.path.parent / entry.file).resolve() == path.resolve() and entry.subject == subject)
        return next(own, None)


def load_expectations(folder: Path) -> Expectations:
    """The expectations of a folder, none where it has no such file.

    Raises:
        InvalidInput: the file is no TOML of such entries, or names a robot that is not there.
    """
    path = folder / NAME
    if not path.is_file():
        return Expectations(path)
    try:
        entries = msgspec.toml.decode(path.read_bytes(), type=_File).expected
    except msgspec.DecodeError as error:
        raise InvalidInput(path, None, f"{error}; expected entries with file, subject, outcome and reason") from error
    for entry in entries:
        if not (folder / entry.file).is_file():
            raise InvalidInput(path, None, f"names {entry.file!r}, which is not in the folder; remove the entry, or correct the path")
    return Expectations(path, tuple(entries))
