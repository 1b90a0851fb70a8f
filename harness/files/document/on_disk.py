"""What stands on the disk where an element of a model names a file: to open a FIFO or a device may wait forever."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from harness.files.document.source import Source
from harness.files.document.xml import irregular, literal_tag, shorten

# Attributes that name a file: of meshes, height fields, skins and models, in URDFs, and the six sides of a texture.
_NAMING = re.compile("file(name|up|down|left|right|front|back)?")
_FOLDERS = ("meshdir", "texturedir", "assetdir")
# Before a path in a URDF.
_SCHEME = re.compile("^[a-z]+://")


def refuse_irregular_files(source: Source) -> None:
    """Refuse an element that names a FIFO, a device, a socket or a directory as a file, before an engine opens it.

    Raises:
        InvalidModel: at the line of the element.
    """
    folders = _folders(source)
    for element in source.root.iter("*"):
        for attribute, text in element.attrib.items():
            if _NAMING.fullmatch(attribute) is None:
                continue
            kinds = {path: _kind(path) for path in _places(text, folders)}
            # Readers differ in where they look; a directory beside the file that they find is none of their business.
            is_found = any(path.is_file() for path in kinds)
            for path, kind in kinds.items():
                if kind and not (is_found and path.is_dir()):
                    what = f'<{literal_tag(element)} {attribute}="{shorten(text)}">'
                    source.refuse(element, f"{what}: {path} is {kind}; expected a regular file")


def _kind(path: Path) -> str:
    try:
        return irregular(path)
    except (OSError, ValueError):
        return ""


def _folders(source: Source) -> list[Path]:
    """Where readers look: in the folders of the model and of its included files, and in those that it names below them."""
    own = dict.fromkeys([source.document.path.parent, *(source.place(element).path.parent for element in source.root.iter("*"))])
    named = [str(one.get(name)) for one in source.root.iter("compiler") for name in _FOLDERS if one.get(name)]
    return [folder / name for folder in own for name in ("", *named)]


def _places(text: str, folders: list[Path]) -> Iterator[Path]:
    """Where the file of an attribute may lie; some readers go by the name of a file alone."""
    name = _SCHEME.sub("", text.strip())
    if name:
        yield from dict.fromkeys(folder / one for folder in folders for one in (name, Path(name).name))
