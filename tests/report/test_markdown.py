"""The report in Markdown, read as a Markdown reader reads it: names and messages of others are text and nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from report import test_benchmark_report, test_hard_report
from report.test_report import CAUSE, card, record, run_on

from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.markdown import render_markdown
from harness.report.summary import Summary
from harness.results.atlas import HardReason
from harness.results.cross_check import CrossCheckResult, SuperfluousPart
from harness.results.table import markdown_cell, markdown_line

READER = MarkdownIt("commonmark").enable(["table", "strikethrough"])
PLAIN = ("name", "subject", "message", "reason", "link", "element")
EVIL = [
    "a | b", "`code", "**loud** _soft_ ~~gone~~", "<b>tag</b> &lt; &amp;", "[text](http://x.example)", "![image](x)",
    "two\n\n# lines", "- item",
    "1. item", "> quote", "\\| \\` \\", "```\nfence", "\x1b[31mred\x1b[0m\x07", "\u202egnp.exe", "---", "===", "carriage\r# return",
]  # fmt: skip


def plain_text(text: str) -> str:
    """Text on one line, control characters as Python writes them."""
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in " ".join(text.split()))


def read(text: str) -> tuple[list[str], str]:
    """Kinds of what a reader makes of the text, those of lines and those within, and all that it shows."""
    blocks = READER.parse(text)
    kinds = [block.type for block in blocks]
    inner: list[Any] = [child for block in blocks for child in block.children or ()]
    shown = "\n".join(
        "".join(child.content for child in block.children) if block.children else block.content
        for block in blocks
        if block.content or block.children
    )
    return sorted(kinds + [child.type for child in inner if child.type not in ("text", "text_special")]), shown


def built(words: dict[str, str]) -> str:
    """A report in which somebody else's text stands wherever there is a place for it; every place says which."""
    name = words["name"]
    other = [
        replace(record(name, words["subject"], message=words["message"], replay=words["message"]), verdict="error"),
        record("a", "b", expected="unstable", expected_reason=words["reason"], expected_link=words["link"]),
    ]
    found = CrossCheckResult(
        records=other,
        systems=[replace(card(name), description=words["message"], source=words["reason"])],
        superfluous=[SuperfluousPart(name, words["subject"], "mjcf/x.xml", 7, words["element"], "", "", "is not felt")],
        causes=[replace(CAUSE, system=name, subject=words["subject"], inference=words["message"], found=None, first_line=words["reason"])],
        worst_cases=[replace(test_hard_report.CASE, system=name, subject=words["subject"])],
    )
    atlas, benchmark = test_hard_report.sample(), test_benchmark_report.sample()
    reason = HardReason(verdict="unstable", reason=words["reason"], remedy=words["message"], link=words["link"])
    atlas.rows[0] = replace(atlas.rows[0], subject=words["subject"], case=name, reasons=[reason], problems=[words["message"]])
    benchmark.problems = [words["message"]]
    run = replace(run_on(0), command=words["message"])
    parts = BenchmarkSummary(test_benchmark_report.RUN, benchmark), HardSummary(test_hard_report.RUN, atlas)
    return render_markdown(Summary(run, found), *parts)


@pytest.mark.parametrize("evil", EVIL)
def test_text_of_others_adds_no_markup(evil: str) -> None:
    plain, _ = read(built(dict.fromkeys(PLAIN, "plain words")))
    found, shown = read(built(dict.fromkeys(PLAIN, evil)))
    assert found == plain
    line = plain_text(evil)
    assert shown.count(line) >= len(PLAIN)


@pytest.mark.ci
@given(st.text(max_size=12) | st.text(alphabet="|`*_~<>&;#[]()!\\-+=.1ab\n\r\t \x1b", max_size=12))
@settings(max_examples=150)
def test_any_text_is_shown_as_it_is(text: str) -> None:
    line = plain_text(text)
    kinds, shown = read(markdown_line(text))
    assert kinds == (["inline", "paragraph_close", "paragraph_open"] if line else []) and shown == line
    kinds, shown = read(f"| a |\n| --- |\n| {markdown_cell(text)} |")
    assert kinds.count("td_open") == 1 and shown == f"a\n{line}".rstrip("\n")
    assert not any("html" in kind or kind in ("code_inline", "em_open", "strong_open", "s_open", "link_open") for kind in kinds)


def test_no_control_character_reaches_the_file() -> None:
    entry = record("a", "b", verdict="error", message="\x1b]0;title\x07 one\r\ntwo\tthree")
    text = render_markdown(Summary(run_on(0), CrossCheckResult(records=[entry])), None, None)
    assert all(letter == "\n" or letter.isprintable() for letter in text)
    assert "\\x1b]0;title\\x07 one two three" in read(text)[1]


def test_a_plain_name_is_written_as_it_is() -> None:
    assert markdown_cell("arm_2r, mujoco/mjcf") == "arm_2r, mujoco/mjcf"
    assert markdown_line("https://example.org/a_b?c=1&d=2#e") == "https://example.org/a_b?c=1&d=2#e"
