"""Inputs of a night: its subjects, and digests of all that it reads, by which a night that goes on tells what was changed in between."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from harness.comparison.collection import find_files
from harness.engines import select_subjects, subjects
from harness.errors import InvalidRequest
from harness.library import MODEL_SUFFIXES, Library, nearest
from harness.storage import sources_digest

_DIGITS = 16


def digests(library: Library, survey: Sequence[str]) -> dict[str, str]:
    """Name of a file to a digest of its content, and "harness" to that of the program.

    Raises:
        InvalidInput: a place to survey holds no robot.
    """
    package = Path(__file__).resolve().parents[1]
    rooms = sorted(path.name for path in package.iterdir() if path.is_dir() and any(path.glob("*.py")))
    found = {"harness": sources_digest(*rooms).hex()[:_DIGITS]}
    found |= {name: _digest(path) for name, path in _files(library)}
    return found | {str(path): _digest(path) for path in (find_files(survey) if survey else [])}


def _files(library: Library) -> Iterator[tuple[str, Path]]:
    """Name and path of every file of the library; its name tells no place of this machine."""
    folders = [
        ("systems", library.systems, "*.py"),
        ("engines", library.engines, "**/*.py"),
        ("hard_states", library.hard_states, "*.json"),
    ]
    folders += [(name, library.models / name, pattern) for name, suffix in MODEL_SUFFIXES.items() for pattern in (f"*{suffix}", "*.py")]
    for name, folder, pattern in folders:
        yield from ((f"{name}/{path.relative_to(folder)}", path) for path in sorted(folder.glob(pattern)))
    if library.expected_verdicts.is_file():
        yield library.expected_verdicts.name, library.expected_verdicts


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:_DIGITS]


def subjects_of(library: Library, engines: Sequence[str]) -> list[str]:
    """Names of the subjects; none, which means all, where no engine was asked for.

    Raises:
        InvalidRequest: no subject is of such an engine.
    """
    if not engines:
        return []
    chosen = [str(subject) for subject in select_subjects(library, ())]
    known = [str(subject) for subject in subjects(library)]
    for engine in engines:
        own = [name for name in known if name.partition("/")[0] == engine]
        if not own:
            names = sorted({name.partition("/")[0] for name in known})
            raise InvalidRequest(f"no engine is called {engine!r}; {nearest(engine, names)}; harness list has those that are there")
        chosen += own
    return list(dict.fromkeys(chosen))
