"""The robots' files of a folder or of an installed distribution, told by their root elements, and the outcomes expected of them.

Where another outcome than an explained answer is expected, ``expected_robots.toml`` beside a file, or in a folder above it, holds an
entry for it::

    [[expected]]
    file = "arm.urdf"
    subject = "mujoco/urdf"
    outcome = "refused"
    reason = "why, in a sentence"
"""

from __future__ import annotations

import importlib.metadata
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from harness.errors import InvalidInput
from harness.files.reading import FORMATS
from harness.library import TEMPLATE_SUFFIX

SUFFIXES = (".urdf", ".xml", ".mjcf")
# The first tag that is no declaration, comment or instruction.
_ROOT = re.compile(rb"<\s*([A-Za-z_][\w.:-]*)")
_COMMENT = re.compile(rb"<!--.*?-->|<\?.*?\?>", re.DOTALL)
# A part of a model that others include has no world.
_WORLD = {b"robot": b"<robot", b"mujoco": b"<worldbody"}


def find_files(places: Sequence[str]) -> list[Path]:
    """The model files of folders, files and installed distributions, sorted, each once.

    Raises:
        InvalidInput: a place is none of these, or holds no model file.
    """
    found: dict[Path, None] = {}
    for place in places:
        own = sorted(path for path in _candidates(place) if format_of(path))
        if not own:
            templates = Path(place).is_dir() and sorted(Path(place).rglob(f"*{TEMPLATE_SUFFIX}"))
            what = f"; {templates[0].name} is a xacro template: write the URDF of it by xacro first" if templates else ""
            raise InvalidInput(
                place, None, f"holds no model of a robot: no {', '.join(SUFFIXES)} file with <robot> or <mujoco> as root element{what}"
            )
        found |= dict.fromkeys(own)
    return list(found)


def format_of(path: Path) -> str:
    """The format, "urdf" or "mjcf", of a URDF or an MJCF with a world by its first tag, well-formed or not; "" for any other file."""
    try:
        content = _COMMENT.sub(b"", path.read_bytes())
    except OSError:
        return ""
    root = _ROOT.search(content)
    return FORMATS[root[1].decode()] if root and root[1] in _WORLD and _WORLD[root[1]] in content else ""


def _candidates(place: str) -> Iterator[Path]:
    path = Path(place)
    if path.is_file():
        yield path
        return
    if path.is_dir():
        files = list(path.rglob("*"))
    else:
        try:
            files = [Path(str(file.locate())) for file in importlib.metadata.files(place) or []]
        except importlib.metadata.PackageNotFoundError:
            problem = "there is no such file or folder, and no distribution of this name is installed"
            raise InvalidInput(place, None, f"{problem}; name a folder of robots") from None
    yield from (path for path in files if path.suffix.lower() in SUFFIXES and path.is_file())


NAME = "expected_robots.toml"


class ExpectedOutcome(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One entry; ``file`` is relative to the folder, ``outcome`` as of ``harness.results.comparison.SubjectRecord``."""

    file: str
    subject: str
    outcome: str
    reason: str


class _File(msgspec.Struct, forbid_unknown_fields=True):
    expected: list[ExpectedOutcome] = []


def expected_outcomes(paths: Iterable[Path]) -> dict[tuple[Path, str], ExpectedOutcome]:
    """The expectations of files by path and subject: those of the nearest folder, at a file or above it, that has some.

    Raises:
        InvalidInput: as ``load_expectations``.
    """
    by_folder: dict[Path, dict[tuple[Path, str], ExpectedOutcome]] = {}
    found: dict[tuple[Path, str], ExpectedOutcome] = {}
    for path in paths:
        folder = next((one for one in path.resolve().parents if (one / NAME).is_file()), None)
        if folder is not None:
            if folder not in by_folder:
                by_folder[folder] = load_expectations(folder)
            found |= {(path, subject): entry for (of, subject), entry in by_folder[folder].items() if of == path.resolve()}
    return found


def load_expectations(folder: Path) -> dict[tuple[Path, str], ExpectedOutcome]:
    """The expectations of a folder by resolved path and subject, the first of each; none where it has no such file.

    Raises:
        InvalidInput: the file is no TOML of such entries, or names a robot that is not there.
    """
    path, found = folder / NAME, dict[tuple[Path, str], ExpectedOutcome]()
    if not path.is_file():
        return found
    try:
        entries = msgspec.toml.decode(path.read_bytes(), type=_File).expected
    except msgspec.DecodeError as error:
        raise InvalidInput(path, None, f"{error}; expected entries with file, subject, outcome and reason") from error
    for entry in entries:
        if not (folder / entry.file).is_file():
            raise InvalidInput(path, None, f"names {entry.file!r}, which is not in the folder; remove the entry, or correct the path")
        found.setdefault(((folder / entry.file).resolve(), entry.subject), entry)
    return found
