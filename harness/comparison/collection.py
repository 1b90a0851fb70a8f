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

import contextlib
import importlib.metadata
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import msgspec

from harness.errors import InvalidInput, InvalidRequest
from harness.files.document.xml import MAXIMUM_BYTES, irregular
from harness.files.mjcf.reading import MOST_FILES
from harness.files.reading import FORMATS
from harness.library import STAGE_SUFFIXES, TEMPLATE_SUFFIX

SUFFIXES = (".urdf", ".xml", ".mjcf", *STAGE_SUFFIXES)
# The first tag that is no comment or instruction, or the root that a DOCTYPE names.
_ROOT = re.compile(rb"<\s*(!DOCTYPE\s+)?([A-Za-z_][\w.:-]*)")
_COMMENT = re.compile(rb"<!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z)", re.DOTALL)
# Meshes, included files and height fields of an MJCF.
_OTHER_FILE = re.compile(rb"\bfile\s*=")
# A part of a model that others include has no world, and a model may include the file that has its world.
_WORLD = {b"robot": b"<robot", b"mujoco": b"<worldbody"}
_INCLUDED = re.compile(rb"<include\b[^>]*\bfile\s*=\s*[\"']([^\"'<>]+)[\"']")
# Layers that a stage names.
_LAYER = re.compile(rb"@([^@\n]+)@")


def find_files(places: Sequence[str]) -> list[Path]:
    """The model files of folders, files and installed distributions, sorted, each once.

    Raises:
        InvalidInput: a place is none of these, holds no model file, or holds a folder that cannot be listed.
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
    layers = {layer for path in found if path.suffix.lower() in STAGE_SUFFIXES for layer in _layers(path)}
    return [path for path in found if path.resolve() not in layers or str(path) in places]


def _layers(path: Path) -> Iterator[Path]:
    """The layers that the text of a stage names, which are parts of it."""
    with contextlib.suppress(OSError):
        content = b"" if irregular(path) else path.read_bytes()
        for name in _LAYER.findall(content) if content.startswith(b"#usda") else ():
            yield (path.parent / os.fsdecode(name)).resolve()


def format_of(path: Path) -> str:
    """The format of what looks like a model; "" for other files, such as a part of an MJCF, which has no world.

    Stages are told by their suffix. Another file looks like one by its root element, or by its suffix where it cannot be read.
    """
    if path.suffix.lower() in STAGE_SUFFIXES:
        return FORMATS["usd"]
    by_suffix = "urdf" if path.suffix.lower() == ".urdf" else ""
    try:
        if irregular(path):
            return by_suffix or "mjcf"
        with path.open("rb") as file:
            content = file.read(MAXIMUM_BYTES)
            is_whole = not file.read(1)
    except OSError:
        return by_suffix or "mjcf"
    # Encodings that are wider than UTF-8 put zeros between letters.
    content = _COMMENT.sub(b"", content.replace(b"\0", b""))
    root = _ROOT.search(content)
    if root is None or root[2] not in _WORLD:
        return by_suffix
    # The world may be an entity, or stand behind what is read.
    is_model = root[1] or not is_whole or _WORLD[root[2]] in content or _includes_a_world(path.parent, content, set())
    return FORMATS[root[2].decode()] if is_model else by_suffix


def _includes_a_world(folder: Path, content: bytes, seen: set[Path]) -> bool:
    """True where a file that an MJCF includes, from its ``folder``, has a world, or cannot be read, as the model itself then tells."""
    for name in _INCLUDED.findall(content):
        file = folder / os.fsdecode(name)
        if file.resolve() in seen or len(seen) > MOST_FILES:
            continue
        seen.add(file.resolve())
        try:
            inner = b"" if irregular(file) else _COMMENT.sub(b"", file.read_bytes())
        except (OSError, ValueError):
            return True
        if _WORLD[b"mujoco"] in inner or _includes_a_world(folder, inner, seen):
            return True
    return False


def _candidates(place: str) -> Iterator[Path]:
    path = Path(place)
    if path.exists() and not path.is_dir():
        yield path
        return
    if path.is_dir():
        files = [Path(folder, name) for folder, _, names in os.walk(path, onerror=_unlisted) for name in names]
    else:
        try:
            files = [Path(str(file.locate())) for file in importlib.metadata.files(place) or []]
        except importlib.metadata.PackageNotFoundError:
            problem = "there is no such file or folder, and no distribution of this name is installed"
            raise InvalidInput(place, None, f"{problem}; name a folder of robots") from None
    yield from (path for path in files if path.suffix.lower() in SUFFIXES and not path.is_dir())


def _unlisted(error: OSError) -> NoReturn:
    raise InvalidInput(
        error.filename, None, f"this folder cannot be listed ({error.strerror}); give yourself the right, or name the folders to be read"
    ) from None


def files_before(places: Sequence[str], before: Path) -> dict[Path, Path]:
    """The model files of ``places`` in the folder ``before``, an earlier state of the current one, by where they are or were here.

    Raises:
        InvalidInput: ``before`` is no folder.
        InvalidRequest: a place does not lie in the current folder.
    """
    if not before.is_dir():
        raise InvalidInput(before, None, "is no folder; name one that holds an earlier state of the current folder")
    found = dict[Path, Path]()
    for place in places:
        here = os.path.relpath(place)
        if os.pardir in Path(here).parts:
            raise InvalidRequest(
                f"{place} does not lie in the current folder, of which {before} is an earlier state; go to the folder of both"
            )
        earlier = before / here
        there = [path for path in _candidates(str(earlier)) if format_of(path)] if earlier.exists() else []
        found |= {Path(place) / path.relative_to(earlier): path for path in sorted(there)}
    return found


def is_as_before(now: Path, before: Path) -> bool:
    """True where a model file cannot mean anything else than before: it has the same text, and no other file has a part in it."""
    if irregular(now) or irregular(before):
        return False
    text = now.read_bytes()
    names_others = _LAYER if now.suffix.lower() in STAGE_SUFFIXES else _OTHER_FILE
    return text == before.read_bytes() and (format_of(now) == "urdf" or not names_others.search(text))


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
