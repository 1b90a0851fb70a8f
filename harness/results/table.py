"""One table for every medium: terminal, Markdown and HTML, each with its own escaping; and how numbers are written.

A cell holds plain data. Its column says what kind of number that is. A record declares the column of a field, or of a property, where
it declares its type: ``seconds: Annotated[float, Column("time", "seconds")]``. A ``TableOf`` names the fields that a table has.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, TypeVar, get_args, get_origin, get_type_hints

if TYPE_CHECKING:
    from rich.table import Table as RichTable

# Classes of the page's style sheet to styles of the terminal.
_STYLES = {"surprise": "bold red", "misreads": "red", "declared": "cyan", "explained": "cyan", "expected": "green"}
# Characters that Markdown takes for markup; an underscore within a word is none.
_MARKUP = re.compile(r"[\\`*\[\]|]|~(?=~)|(?<=~)~|(?<![^\W_])_|_(?![^\W_])")
_Key = TypeVar("_Key")
_Held = TypeVar("_Held")


def error_text(value: float | None) -> str:
    """Three significant digits; a dash where nothing was compared."""
    return "-" if value is None else f"{value:#.3g}".removesuffix(".") if value else "0"


def relative_text(value: float | None) -> str:
    """Three significant digits; beyond 1, where no digit is right and the size says nothing, that alone."""
    return "> 1" if value is not None and value > 1 else error_text(value)


def seconds_text(value: float | None) -> str:
    """Three significant digits in the unit that suits; a dash for None."""
    if value is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if not abs(value) < size:
            return f"{error_text(value / size)} {unit}"
    return f"{error_text(value / 1e-9)} ns"


def number_text(value: float) -> str:
    """The shortest decimal that reads back as the same float64."""
    return repr(float(value)).removesuffix(".0")


def counted(number: int, noun: str) -> str:
    """ "1 state", "2 states"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def counted_nouns(number: int, nouns: str) -> str:
    """ "1 equality", "6 actuators", "1 degree of freedom", of a noun in the plural."""
    noun, *rest = nouns.partition(" of ")
    one = f"{noun[:-3]}y" if noun.endswith("ies") else noun.removesuffix("s")
    return f"{number} {''.join([one, *rest]) if number == 1 else nouns}"


def program_name(engine: str, title: str) -> str:
    """ "MuJoCo" of mujoco, "MuJoCo 3.13.0" of mujoco@3.13.0; the name itself where there is no title."""
    name, _, version = engine.partition("@")
    return f"{title or name} {version}".rstrip()


def plural(number: int, one: str, several: str) -> str:
    """The word that goes with a number."""
    return one if number == 1 else several


def joined(words: Sequence[str]) -> str:
    """ "MuJoCo", "MuJoCo and Pinocchio", "adam, MuJoCo and Pinocchio"; "" of none."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def first_of(names: Sequence[str], most: int) -> str:
    """The first of several names, and how many more there are."""
    more = len(names) - most
    return ", ".join(names) if more <= 0 else f"{', '.join(names[:most])} and {more} more"


def grouped(pairs: Iterable[tuple[_Key, _Held]]) -> dict[_Key, list[_Held]]:
    """Items by their keys, which stand in the order in which they come."""
    found: dict[_Key, list[_Held]] = {}
    for key, item in pairs:
        found.setdefault(key, []).append(item)
    return found


# How a value of each kind is written; all but "text" stand at the right of their column.
_KINDS: Mapping[str, Callable[[Any], str]] = {
    "text": str,
    "error": error_text,
    "relative": relative_text,
    "seconds": seconds_text,
    "count": "{:,}".format,
    "rounded": "{:.2f}".format,
    "given": "{:g}".format,
    "figure": "{:.5g}".format,
    "plain": str,
}


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        title: its heading. unit: stands behind each number.
        kind: of its values: "text", "error", "relative" (an error of which more than 1 says nothing), "seconds", "count", "rounded"
            (two decimals), "given" (as somebody wrote it), "figure" (five digits) or "plain" (a text at the right).
    """

    title: str
    kind: str = "text"
    unit: str = ""

    @property
    def is_number(self) -> bool:
        """True where the values stand at the right."""
        return self.kind != "text"

    def text(self, value: object) -> str:
        """A value in the column's kind; a dash for a number that is None."""
        if isinstance(value, str):
            return value
        if value is None:
            return "-" if self.is_number else ""
        return f"{_KINDS[self.kind](value)} {self.unit}".rstrip()


@dataclass(frozen=True)
class Cell:
    """A value with its looks.

    Attributes:
        value: as a bare cell has it; on a page, one with ``__html__`` is drawn by that. notes: further lines, smaller where the medium can.
        tone: classes of the page's style sheet, as "agrees" or "disagrees surprise".
        fills: whether the tone colours the whole cell of a page and not the value alone.
        link: address on the page. hint: shown beside the pointer. attributes: further ones of the cell on a page, as "id".
    """

    value: object
    notes: Sequence[str] = ()
    tone: str = ""
    fills: bool = False
    link: str = ""
    hint: str = ""
    attributes: Mapping[str, str] = field(default_factory=dict)


@dataclass
class Table:
    """Rows under columns.

    Attributes:
        columns: a bare text is a column of text. rows: a value or a ``Cell`` for each column.
        caption: stands above the rows of a page. style: class of the page's style sheet; in a "matrix" the first column is a heading too.
    """

    columns: Sequence[Column | str]
    rows: Sequence[Sequence[object]]
    caption: str = ""
    style: str = ""
    heads: list[Column] = field(init=False)

    def __post_init__(self) -> None:
        self.heads = [column if isinstance(column, Column) else Column(column) for column in self.columns]

    @classmethod
    def of(cls, items: Iterable[Any], columns: Mapping[Column | str, str | Callable[[Any], object]], caption: str = "") -> Table:
        """A row for each item; a column maps to the name of the item's attribute, or to a function of the item."""
        getters = [attrgetter(value) if isinstance(value, str) else value for value in columns.values()]
        return cls(list(columns), [[getter(item) for getter in getters] for item in items], caption)

    def only(self, *titles: str) -> Table:
        """The columns of these titles, in this order.

        Raises:
            ValueError: there is no such column.
        """
        places = [[head.title for head in self.heads].index(title) for title in titles]
        rows = [[row[place] for place in places] for row in self.rows]
        return Table([self.heads[place] for place in places], rows, self.caption, self.style)

    def without(self, *titles: str) -> Table:
        """The other columns."""
        return self.only(*(head.title for head in self.heads if head.title not in titles))

    def with_column(self, column: Column | str, cells: Sequence[object], before: str) -> Table:
        """A further column of these cells, which stands before the one of a title.

        Raises:
            ValueError: there is no such column.
        """
        place = [head.title for head in self.heads].index(before)
        rows = [[*row[:place], cell, *row[place:]] for row, cell in zip(self.rows, cells, strict=True)]
        return Table([*self.heads[:place], column, *self.heads[place:]], rows, self.caption, self.style)

    def texts(self, separator: str = ", ") -> list[list[str]]:
        """The rows as text, with a separator before each note."""
        return [[separator.join(_lines(head, cell)) for head, cell in zip(self.heads, row, strict=True)] for row in self.rows]

    def __str__(self) -> str:
        """Lines of plain text, none of them wrapped; the headings come first."""
        lines = [[printable(text) for text in line] for line in ([head.title for head in self.heads], *self.texts())]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        sides = [str.rjust if head.is_number else str.ljust for head in self.heads]
        padded = ([side(text, width) for side, text, width in zip(sides, line, widths, strict=True)] for line in lines)
        return "\n".join("  ".join(line).rstrip() for line in padded)

    def terminal(self) -> RichTable:
        """A table to print with rich, uncropped; no markup or control character of a cell reaches the terminal.

        Where it is too wide, texts are wrapped between words; no name and no number is broken.
        """
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(box=None, header_style="bold", pad_edge=False)
        rows = [["\n".join(map(printable, _lines(head, cell))) for head, cell in zip(self.heads, row, strict=True)] for row in self.rows]
        for place, head in enumerate(self.heads):
            texts = [row[place] for row in rows]
            words = " ".join(texts).split() if head.kind in ("text", "plain") else "\n".join(texts).split("\n")
            least = max(map(len, [*words, *head.title.split()]), default=0)
            justify: Literal["left", "right"] = "right" if head.is_number else "left"
            table.add_column(Text(printable(head.title)), justify=justify, overflow="fold", min_width=least)
        for row, texts in zip(self.rows, rows, strict=True):
            tones = [cell.tone.split() if isinstance(cell, Cell) else [] for cell in row]
            styles = [next((style for tone, style in _STYLES.items() if tone in own), "") for own in tones]
            table.add_row(*(Text(text, style) for text, style in zip(texts, styles, strict=True)))
        return table

    def markdown(self) -> str:
        """A table of pipes; "" without rows."""
        if not self.rows:
            return ""
        lines = [[head.title for head in self.heads], ["---:" if head.is_number else "---" for head in self.heads], *self.texts()]
        return "\n".join("| " + " | ".join(map(markdown_cell, line)) + " |" for line in lines)

    def html(self, name: str = "") -> str:
        """A ``<table>`` in a ``<div>`` that scrolls; "" without rows. ``name`` becomes its attribute ``data-table``."""
        if not self.rows:
            return ""
        caption = f"<caption>{escape(self.caption)}</caption>\n" if self.caption else ""
        heads = "".join(f"<th{_attributes(_class(head), scope='col')}>{escape(head.title)}</th>" for head in self.heads)
        rows = "\n".join(f"<tr>{self._html_row(row)}</tr>" for row in self.rows)
        # What scrolls must be reached by keyboard, and says its name there.
        scrolling = _attributes("wide", role="group", tabindex="0", **{"aria-label": self.caption})
        about = _attributes(self.style, **{"data-table": name})
        opening = f"<div{scrolling}>\n<table{about}>\n{caption}<thead><tr>{heads}</tr></thead>"
        return f"{opening}\n<tbody>\n{rows}\n</tbody>\n</table>\n</div>"

    # For templates, which do not escape it again, and for notebooks.
    __html__ = _repr_html_ = html

    def _html_row(self, row: Sequence[object]) -> str:
        is_matrix = "matrix" in self.style.split()
        scopes = ["row" if is_matrix and place == 0 else "" for place in range(len(row))]
        return "".join(_html_cell(scope, head, cell) for scope, head, cell in zip(scopes, self.heads, row, strict=True))


Row = TypeVar("Row")


def columns_of(kind: type) -> Mapping[str, Column]:
    """Columns that a class of records declares, by the name of the field or property."""
    hints = get_type_hints(kind, include_extras=True)
    for name, one in ((name, one) for base in reversed(kind.__mro__) for name, one in vars(base).items() if isinstance(one, property)):
        # The types of other properties need not be known at run time.
        if "Column(" in str(one.fget.__annotations__.get("return")):
            hints[name] = get_type_hints(one.fget, include_extras=True)["return"]
    annotated = {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Annotated}
    return {name: column for name, (_, *about) in annotated.items() for column in about if isinstance(column, Column)}


@dataclass(frozen=True)
class TableOf(Generic[Row]):
    """Table of records of one class.

    Attributes:
        kind: of the records, which declares the columns. names: of its fields and properties that are shown, in this order.
        caption: as of ``Table``.
    """

    kind: type[Row]
    names: str
    caption: str = ""

    def __call__(self, records: Iterable[Row]) -> Table:
        columns = columns_of(self.kind)
        return Table.of(records, {columns[name]: name for name in self.names.split()}, self.caption)


def markdown_line(text: str) -> str:
    """``text`` as a paragraph of Markdown: on one line, no character of it taken for markup."""
    return re.sub(r"^(\d*)(?=[-#>+=.)])", r"\1\\", markdown_cell(text))


def markdown_cell(text: str) -> str:
    """``text`` within a line or a table of Markdown."""
    marked = _MARKUP.sub(r"\\\g<0>", printable(" ".join(text.split())))
    return re.sub(r"&(?=#?\w+;)", "&amp;", marked).replace("<", "&lt;")


def printable(text: str) -> str:
    """``text`` on one line that commands no terminal: what is not printed is a space, or its Python escape."""
    return "".join(
        letter if letter.isprintable() else " " if letter.isspace() else letter.encode("unicode_escape").decode() for letter in text
    )


def _lines(head: Column, cell: object) -> list[str]:
    """A cell's value and its notes, without those that are empty."""
    look = cell if isinstance(cell, Cell) else Cell(cell)
    return [line for line in (head.text(look.value), *look.notes) if line]


def _html_cell(scope: str, head: Column, cell: object) -> str:
    look = cell if isinstance(cell, Cell) else Cell(cell)
    drawn = getattr(look.value, "__html__", None)
    inner = (drawn() if drawn else escape(head.text(look.value))) + "".join(f"<small> {escape(note)}</small>" for note in look.notes)
    alone = "" if look.fills else f"verdict {look.tone}" if look.tone else ""
    if look.link:
        inner = f"<a{_attributes(look.tone if look.fills else alone, href=look.link)}>{inner}</a>"
    elif alone or look.fills:
        inner = f"<span{_attributes(alone)}>{inner}</span>"
    tag = "th" if scope else "td"
    about = _attributes(look.tone if look.fills else _class(head), scope=scope, title=look.hint, **look.attributes)
    return f"<{tag}{about}>{inner}</{tag}>"


def _class(head: Column) -> str:
    return "number" if head.is_number else ""


def _attributes(kind: str, **others: str) -> str:
    known = {"class": kind} | others
    return "".join(f' {name}="{escape(value)}"' for name, value in known.items() if value)
