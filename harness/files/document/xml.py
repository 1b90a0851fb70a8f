"""One model file as an XML tree with the line of every element, read without trusting its author.

DOCTYPE is refused (so there are no entities to expand and nothing to fetch), as are files beyond the
size, number of elements and depth the engines can bear. Expat gives the line where a tag starts; lxml, the tree and the
better messages, only knows where it ends.
"""

from __future__ import annotations

import copyreg
import re
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.python import CannotRun, raised_in, run_file
from harness.library import member_of

MAXIMUM_BYTES = 10_000_000
# Several times as many as the largest robots have; a second to read.
MAXIMUM_ELEMENTS = 50_000
# libxml2 stops at 256, and links a few thousand deep overflow Pinocchio's stack.
MAXIMUM_DEPTH = 200
_SHOWN = 60
# Bytes at the beginning of a file, of which one is zero in every encoding that is wider than UTF-8.
_ENOUGH = 4
# Whatever has a name on a disk and is no regular file.
_KINDS = (
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
# The version of an XML declaration, which stands at the beginning of a file.
_VERSION = re.compile(r"""\A(\ufeff?<\?xml\s+version\s*=\s*)(["'])[\w.:-]*\2""")
# Engines in processes of their own are asked about elements too, which go there as text.
copyreg.pickle(etree._Element, lambda element: (etree.fromstring, (etree.tostring(element, with_tail=False),)))


@dataclass(frozen=True)
class Document:
    """A parsed model file.

    Attributes:
        text: the file's content, character by character.
        root: the root element; comments and processing instructions are left out.
        lines: element to the line (1-based) its tag starts on.
        comments: (line, text) of every comment.
    """

    path: Path
    text: str
    root: etree._Element
    lines: Mapping[etree._Element, int]
    comments: tuple[tuple[int, str], ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that it is read from; those that an MJCF includes are documents of their own."""
        return (self.path,)

    def refuse(self, element: etree._Element, problem: str) -> NoReturn:
        """Raises InvalidModel at the line of ``element``."""
        raise InvalidModel(self.path, self.lines[element], problem)

    def by_name(self, elements: Iterable[etree._Element]) -> dict[str, etree._Element]:
        """Elements by name; raises InvalidModel where one has none, or another's."""
        found: dict[str, etree._Element] = {}
        for element in elements:
            name = element.get("name")
            if not name:
                self.refuse(element, f"<{literal_tag(element)}> has no name; add one, for it is matched by name")
            if name in found:
                line = self.lines[found[name]]
                self.refuse(element, f"{describe(element)} repeats the name of line {line}; give each its own")
            found[name] = element
        return found


def parse_document(path: Path, text: str, root_tag: str) -> Document:
    """The document of a file at ``path`` that holds ``text``, whose root element must be ``root_tag``.

    Raises:
        InvalidModel: not well-formed XML with that root, or beyond the limits above.
    """
    document = parse_any(path, text, f"a <{root_tag}> model")
    root = document.root
    if root.tag != root_tag:
        document.refuse(root, f"the root element is <{shorten(root.tag)}>; expected <{root_tag}>, without a default namespace")
    return document


def parse_any(path: Path, text: str, expected: str, any_prefix: bool = False) -> Document:
    """The document of a file at ``path`` that would hold ``text``, whatever its root element is; ``expected`` as of ``read_any``.

    Raises:
        InvalidModel: not well-formed XML, or beyond the limits above.
    """
    if not text.strip("\ufeff \t\r\n"):
        raise InvalidModel(path, None, f"is empty; expected {expected}")
    # Readers of robots' files take any version; every one that is met means the first.
    parsed = _VERSION.sub(r"\1\g<2>1.0\2", text, count=1)
    lines, comments, complaint = _scan(path, parsed)
    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        remove_comments=True,
        remove_pis=True,
        recover=any_prefix and complaint is None,
    )
    try:
        root = etree.fromstring(parsed.encode(), parser)
    except etree.XMLSyntaxError as error:
        raise _malformed(path, error.lineno, error.msg) from None
    if complaint is not None:
        raise complaint
    for entry in parser.error_log.filter_from_errors():
        if entry.type != etree.ErrorTypes.NS_ERR_UNDEFINED_NAMESPACE:
            raise _malformed(path, entry.line, f"{entry.message}, line {entry.line}, column {entry.column}")
    return Document(path, text, root, dict(zip(root.iter("*"), lines, strict=True)), tuple(comments))


def _malformed(path: Path, line: int, problem: str) -> InvalidModel:
    return InvalidModel(path, line or None, f"is not well-formed XML: {' '.join(problem.split())}; correct it, or restore the file")


def _written_by_family(path: Path, writer: Path, size: int) -> str:
    """The model that a family's writer gives for ``size``."""
    try:
        module = run_file(writer, f"_harness_{writer.parent.name}_{writer.stem}")
        model = getattr(module, "model", None)
        if model is None:
            raise InvalidModel(writer, None, "defines no model(n); expected a function that returns the text of the model of size n")
        try:
            text = model(size)
        except Exception as error:
            raise raised_in(writer, error) from error
    except CannotRun as error:
        raise InvalidModel(error.path, error.line, error.problem) from error
    if not isinstance(text, str):
        raise InvalidModel(writer, None, f"model({size}) returned a {type(text).__name__}; expected the text of {path.name}")
    return text


def irregular(path: Path) -> str:
    """The kind of what is at ``path``, such as "a FIFO"; "" for a regular file.

    Raises:
        OSError, ValueError: there is nothing, or it may not be known.
    """
    mode = path.stat().st_mode
    return next((kind for is_one, kind in _KINDS if is_one(mode)), "")


def read_text(path: Path) -> str:
    """The text of a file, or what the writer of a family gives for a member of it; raises InvalidModel where there is none."""
    member = member_of(path)
    if member is not None:
        return _written_by_family(path, *member)
    try:
        if kind := irregular(path):
            remedy = ": name one in it; harness survey takes all robots of a folder" if path.is_dir() else ""
            raise InvalidModel(path, None, f"is {kind}; expected a model file{remedy}")
        with path.open("rb") as file:
            content = file.read(MAXIMUM_BYTES + 1)
    except FileNotFoundError:
        raise InvalidModel(path, None, "there is no such file; write the model, or correct the path") from None
    except (OSError, ValueError) as error:
        raise InvalidModel(path, None, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > MAXIMUM_BYTES:
        raise InvalidModel(path, None, f"is larger than {MAXIMUM_BYTES} bytes; a model needs joints and inertias, not meshes")
    if b"\0" in content[:_ENOUGH]:
        raise InvalidModel(path, None, "is in UTF-16, UTF-32 or no text; save the file as UTF-8")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InvalidModel(path, line, f"byte 0x{content[error.start]:02x} is not UTF-8; save the file as UTF-8") from None


def _scan(path: Path, text: str) -> tuple[list[int], list[tuple[int, str]], InvalidModel | None]:
    """The line of every start tag in document order, and every comment; expat's complaint where it cannot go on."""
    lines: list[int] = []
    comments: list[tuple[int, str]] = []
    depth = 0
    parser = expat.ParserCreate("utf-8")

    def start(name: str, _attributes: object) -> None:
        nonlocal depth
        depth += 1
        lines.append(parser.CurrentLineNumber)
        if len(lines) > MAXIMUM_ELEMENTS:
            problem = f"is element {len(lines)} of the file; expected at most {MAXIMUM_ELEMENTS}, for no mechanism needs that many"
            raise InvalidModel(path, lines[-1], f"<{shorten(name)}> {problem}")
        if depth > MAXIMUM_DEPTH:
            raise InvalidModel(path, lines[-1], f"<{shorten(name)}> is nested more than {MAXIMUM_DEPTH} deep; no model needs that")

    def end(_name: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_declaration: object) -> None:
        raise InvalidModel(path, parser.CurrentLineNumber, "declares a DOCTYPE, which could define entities; remove it")

    parser.CommentHandler = lambda comment: comments.append((parser.CurrentLineNumber, comment))
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        return lines, comments, InvalidModel(path, error.lineno, f"is not well-formed XML: {expat.ErrorString(error.code)}; correct it")
    return lines, comments, None


def literal_tag(element: etree._Element) -> str:
    """The tag as written, prefix included: readers without namespaces, such as Drake's, go by that."""
    if element.tag[0] != "{":
        return str(element.tag)
    local = etree.QName(element).localname
    return f"{element.prefix}:{local}" if element.prefix else str(local)


def describe(element: etree._Element) -> str:
    """The element as a reader recognises it: tag, and name where it has one."""
    name = element.get("name")
    return f"<{literal_tag(element)}>" if name is None else f'<{literal_tag(element)} name="{shorten(name)}">'


def shorten(text: str) -> str:
    """``text`` on one line, cut where a message would become unreadable."""
    line = " ".join(text.split())
    return line if len(line) <= _SHOWN else line[:_SHOWN] + "..."
