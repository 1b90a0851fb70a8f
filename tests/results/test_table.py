"""One table, three media: each escapes what would break it, and all of them write numbers alike."""

from __future__ import annotations

import html
import io
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from support import Page

from harness.results.table import Cell, Column, Table, counted_nouns

EVIL = "[red]a[/red] | <b>\n\x1b[31mb\x1b]0;title\x07 & \"'"


def printed(table: Table, width: int = 200) -> str:
    stream = io.StringIO()
    Console(file=stream, width=width, force_terminal=True, color_system="standard").print(table.terminal())
    return stream.getvalue()


def test_each_medium_escapes_what_would_break_it() -> None:
    table = Table(
        [EVIL, "other"], [[Cell(EVIL, [EVIL], EVIL, fills=True, link=EVIL, hint=EVIL), 1], [Cell(EVIL, tone=EVIL), EVIL]], EVIL, EVIL
    )
    shown = printed(table)
    assert "\x1b]" not in shown and "\x1b[31m" not in shown and "\x07" not in shown and "[red]a[/red]" in shown
    assert "\x1b" not in str(table) and len(str(table).splitlines()) == 3
    lines = table.markdown().splitlines()
    assert len(lines) == 4 and {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {3} and "<" not in table.markdown()
    page = table.html()
    assert "<b>" not in page and html.unescape(page).count(EVIL) == 13
    assert set(Page(page).tags) == {"div", "table", "caption", "thead", "tbody", "tr", "th", "td", "a", "small", "span"}


def test_numbers_are_written_by_their_kind_in_every_medium() -> None:
    columns = ["name", Column("error", "error"), Column("time", "seconds"), Column("count", "count"), Column("step", "given", "s")]
    table = Table(columns, [["a", 1 / 3, 2.5e-7, 12345, 1e-3], ["b", None, None, 0, "none"], [None, float("inf"), 0.0, -1, float("nan")]])
    wanted = [["a", "0.333", "250 ns", "12,345", "0.001 s"], ["b", "-", "-", "0", "none"], ["", "inf", "0 ns", "-1", "nan s"]]
    assert table.texts() == wanted
    assert table.markdown().splitlines()[1:3] == ["| --- | ---: | ---: | ---: | ---: |", "| a | 0.333 | 250 ns | 12,345 | 0.001 s |"]
    assert '<td class="number">250 ns</td>' in table.html()
    assert printed(table).splitlines()[1].split("  ")[-1].strip() == "0.001 s"
    assert str(table).splitlines()[2].split() == ["b", "-", "-", "0", "none"]


def test_columns_are_chosen_by_title() -> None:
    table = Table(["a", Column("b", "count"), "c"], [[1, 2, 3]], "above", "matrix")
    chosen = table.only("c", "b")
    assert chosen.texts() == [["3", "2"]] and (chosen.caption, chosen.style) == ("above", "matrix")
    assert table.without("a", "c").texts() == [["2"]]
    with pytest.raises(ValueError, match="d"):
        table.only("d")


def test_looks_of_a_cell() -> None:
    cells = [Cell("x", ["y"], "agrees", link="#z"), Cell("x", [], "empty", fills=True), Cell("x", tone="disagrees surprise")]
    table = Table(["1", "2", "3"], [cells], style="matrix")
    assert table.texts() == [["x, y", "x", "x"]]
    assert '<th scope="row"><a class="verdict agrees" href="#z">x<small> y</small></a></th>' in table.html()
    assert '<td class="empty"><span>x</span></td><td><span class="verdict disagrees surprise">x</span></td>' in table.html()
    assert "\x1b[1;31mx" in printed(table)


def test_a_table_without_rows_is_nothing_on_a_page() -> None:
    assert Table(["a"], []).html() == Table(["a"], []).markdown() == ""


@pytest.mark.ci
@given(st.lists(st.tuples(st.text(), st.none() | st.floats(), st.none() | st.integers()), min_size=1, max_size=4))
def test_anything_can_be_shown(rows: list[tuple[str, float | None, int | None]]) -> None:
    table = Table(["a", Column("b", "seconds"), Column("c", "count")], rows)
    assert len(str(table).split("\n")) == len(table.markdown().split("\n")) - 1 == len(rows) + 1
    assert table.html().count("<tr>") == len(rows) + 1 and printed(table)


def test_a_relative_error_beyond_one_has_no_size() -> None:
    table = Table([Column("there", "relative")], [[value] for value in (1e-16, 0.5, 1.0, 5e203, float("inf"), None)])
    assert [text for [text] in table.texts()] == ["1.00e-16", "0.500", "1.00", "> 1", "> 1", "-"]


def test_a_noun_goes_with_its_number() -> None:
    of_one = {
        "equalities": "1 equality",
        "bodies": "1 body",
        "degrees of freedom": "1 degree of freedom",
        "further differences": "1 further difference",
        "attributes of joints": "1 attribute of joints",
    }
    for nouns, one in of_one.items():
        assert (counted_nouns(1, nouns), counted_nouns(2, nouns)) == (one, f"2 {nouns}")
