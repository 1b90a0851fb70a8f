"""The lines of a layer's text on which prims and their properties stand, which no interface of USD tells.

Values are skipped, whatever they hold; the text has been parsed by USD before.

Source: OpenUSD documentation, Usda file format specification.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

# Whatever can hold brackets, quotes or line ends without meaning them comes first.
_TOKEN = re.compile(
    r"""(?P<skipped>\#[^\n]*|/\*.*?\*/|@@@.*?@@@|@[^@\n]*@|<[^>\n]*>|[ \t\r,;]+)
    |(?P<string>\"\"\"(?:\\.|.)*?\"\"\"|'''(?:\\.|.)*?'''|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')
    |(?P<end>\n)|(?P<mark>[{}()\[\]=])|(?P<word>[^\s,;{}()\[\]="'<@]+)|(?P<other>.)""",
    re.DOTALL | re.VERBOSE,
)
_SPECIFIERS, _CLOSING = ("def", "over", "class"), {"(": ")", "[": "]"}
ROOT = "/"


@dataclass
class _Block:
    """A text between braces: the contents of the prim or variant ``path``, a set of variants ``set``, or "" for a dictionary."""

    path: str
    set: str = ""


@dataclass
class _LayerScan:
    blocks: list[_Block] = field(default_factory=lambda: [_Block(ROOT)])
    words: list[str] = field(default_factory=list)
    found: dict[str, int] = field(default_factory=dict)
    opened: _Block | None = None

    def statement(self, line: int) -> None:
        """Note the property that the words before ``=``, a bracket or the end of a line declare."""
        if len(self.words) > 1 and self.blocks[-1].path and not self.blocks[-1].set and self.words[0] not in (*_SPECIFIERS, "variantSet"):
            name = self.words[-1].partition(".")[0]
            self.found.setdefault(f"{self.blocks[-1].path}.{name}", line)
        self.words.clear()

    def named(self, text: str, line: int) -> None:
        """Take a string as the name of the prim, variant or set of variants that words have opened."""
        block = self.blocks[-1]
        if block.set:
            self.opened = _Block(f"{block.path}{{{block.set}={text}}}")
        elif self.words[:1] == ["variantSet"]:
            self.opened = _Block(block.path, set=text)
        elif self.words and self.words[0] in _SPECIFIERS and block.path:
            path = f"{block.path.rstrip('/') if block.path == ROOT else block.path + ('' if block.path.endswith('}') else '/')}"
            path = f"{path or ''}{'/' if block.path == ROOT else ''}{text}"
            self.found.setdefault(path, line)
            self.opened = _Block(path)


def lines_of(text: str) -> Mapping[str, int]:
    """The line (1-based) of each prim, as "/arm/link", and of each property, as "/arm/link.physics:mass", of a layer.

    Metadata of the layer are properties of "/".
    """
    scan, line, at, length = _LayerScan(), 1, 0, len(text)
    while at < length:
        match = _TOKEN.match(text, at)
        assert match is not None
        kind, token = match.lastgroup, match.group()
        start, at = line, match.end()
        line += token.count("\n")
        if kind == "string":
            scan.named(token.strip("\"'"), start)
        elif kind == "word":
            scan.words.append(token)
        elif kind == "end":
            scan.statement(start)
        elif kind == "mark":
            at, line = _mark(scan, token, text, at, line)
    return scan.found


def _mark(scan: _LayerScan, token: str, text: str, at: int, line: int) -> tuple[int, int]:
    """Take a mark; the place and line behind what it encloses."""
    if token in "([":
        inside = text[at : (end := _closed(text, at, token))]
        if token == "(" and len(scan.blocks) == 1 and not scan.words and scan.opened is None:
            for number, own in enumerate(inside.split("\n")):
                if "=" in own:
                    scan.found.setdefault(f"{ROOT}.{own.partition('=')[0].strip()}", line + number)
        if scan.opened is None and token == "(":
            scan.statement(line)
        return end + 1, line + inside.count("\n")
    if token == "=":
        scan.statement(line)
    elif token == "{":
        scan.blocks.append(scan.opened or _Block(""))
        scan.opened = None
        scan.words.clear()
    elif token == "}" and len(scan.blocks) > 1:
        scan.statement(line)
        scan.blocks.pop()
    return at, line


def _closed(text: str, at: int, opening: str) -> int:
    """The place of the bracket that closes one; the end of the text where none does."""
    closing = _CLOSING[opening]
    end = text.find(closing, at)
    # Lists of numbers are most of a file.
    if end >= 0 and not re.search(r"[\[(\"'@#<{]", text[at:end] if end - at < 200 else text[at : at + 200]) and opening not in text[at:end]:
        return end
    depth, length = 1, len(text)
    while at < length:
        match = _TOKEN.match(text, at)
        assert match is not None
        if match.lastgroup == "mark":
            depth += {opening: 1, closing: -1}.get(match.group(), 0)
            if not depth:
                return match.start()
        at = match.end()
    return length
