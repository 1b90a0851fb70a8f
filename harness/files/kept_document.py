"""Documents that are kept in the process as long as their files stay as they are on the disk."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.source import Source, read_any
from harness.files.document.xml import Document
from harness.files.given import Place
from harness.files.mjcf.reading import put_included
from harness.library import member_of

_MOST = 4


@dataclass(frozen=True)
class KeptDocument:
    """A document whose included files are in their places.

    Attributes:
        elements: those of the file itself, by the numbers of their places.
        states: what tells of each file that the document is made of whether it is still the same.
    """

    document: Document
    elements: tuple[etree._Element, ...]
    states: Mapping[Path, object]

    def element(self, place: Place) -> etree._Element:
        """The element at a place; raises InvalidModel where the file, as it is now, has no such place."""
        if place.element >= len(self.elements):
            raise InvalidModel(place.path, None, "has changed since it was read; ask about it again")
        return self.elements[place.element]


_KEPT: OrderedDict[Path, KeptDocument] = OrderedDict()


def kept_document(path: Path) -> KeptDocument:
    """The document of a file, read again where that or a file that it is made of has changed; raises InvalidModel as ``read_any``.

    A path that is relative means another file in another working directory.
    """
    place = path.absolute()
    known = _KEPT.get(place)
    if known is None or any(_state(file) != state for file, state in known.states.items()):
        known = _KEPT[place] = _read(path)
        if len(_KEPT) > _MOST:
            _KEPT.popitem(last=False)
    _KEPT.move_to_end(place)
    return known


def _read(path: Path) -> KeptDocument:
    # Before the file is read: what changes meanwhile is read again.
    before = {path.absolute(): _state(path)}
    document = read_any(path, "a model")
    elements = tuple(document.lines)
    files = [*document.files]
    if next(document.root.iter("include"), None) is not None:
        source = Source(document)
        put_included(source)
        files += source.included
    return KeptDocument(document, elements, {file.absolute(): _state(file) for file in files} | before)


def _state(path: Path) -> object:
    """The identity, size and times of a file; of a member of a family, those of what writes it."""
    member = member_of(path)
    try:
        found = (path if member is None else member[0]).stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns
