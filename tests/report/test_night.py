"""A night for CI: JUnit XML by the schema, and Markdown with what matters first."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from lxml import etree
from support_results import RECORD, RUN

from harness.report.night import MOST_LISTED, MOST_SHOWN, NightSummary, render_junit, render_summary
from harness.results.night import BROKEN, Case, Night, NightSettings, case_of
from harness.results.trend import MEDIAN, ChangedCell

SCHEMA = etree.XMLSchema(etree.parse(Path(__file__).parent / "junit.xsd"))
SETTINGS = NightSettings(stages=["cross-check"], states=1000, seed=7)
GOOD = replace(RECORD, verdict="agrees", backward_error=1.0, system="collar", message="")
WHY = "no springs between points"
LEFT_OUT = replace(GOOD, verdict="unsupported", expected="unsupported", expected_reason=WHY, backward_error=None, subject="other/urdf")
HOSTILE = "a\x00b <script> & ]]> \ud800 `x` | [y](z)\n```\nsecond\x1b[31m"
CASES = [
    Case.of(("atlas", "far_base", "mujoco/mjcf"), [HOSTILE], outcome=BROKEN, replay="harness atlas far_base"),
    case_of(RECORD, "cross-check"),
    case_of(GOOD, "cross-check"),
    case_of(LEFT_OUT, "cross-check"),
]
CHANGE = ChangedCell(
    system="collar", subject="mujoco/mjcf", number=MEDIAN, before=1.2, now=3.0, by=0.9, nights=9, place=9, found_by="jump"
)  # fmt: skip


def summary_of(cases: list[Case], **others: object) -> NightSummary:
    return NightSummary(run=RUN, night=Night(settings=[SETTINGS]), cases=cases, **others)  # type: ignore[arg-type]


def parsed(summary: NightSummary) -> etree._Element:
    return etree.fromstring(render_junit(summary).encode())


@pytest.mark.parametrize("cases", [CASES, CASES[2:3], []])
def test_junit_xml_is_what_the_schema_says(cases: list[Case]) -> None:
    SCHEMA.assertValid(parsed(summary_of(cases)))


@pytest.mark.parametrize(
    ("broken", "by"),
    [(' tests="1"', ""), ("<testcase ", "<test "), ('time="0.002"', 'time="soon"'), ('name="mujoco/mjcf" time', "time")],
)
def test_the_schema_refuses_what_is_none(broken: str, by: str) -> None:
    text = render_junit(summary_of(CASES[2:3]))
    assert broken in text
    with pytest.raises((etree.DocumentInvalid, etree.XMLSyntaxError)):
        SCHEMA.assertValid(etree.fromstring(text.replace(broken, by).encode()))


def test_junit_xml_counts_and_says_what_the_report_says() -> None:
    root = parsed(summary_of(CASES))
    assert [root.get(name) for name in ("tests", "failures", "errors")] == ["4", "1", "1"]
    assert [(suite.get("name"), suite.get("tests"), suite.get("skipped")) for suite in root] == [
        ("atlas", "1", "0"),
        ("cross-check", "3", "1"),
    ]
    [failure] = root.iter("failure")
    assert failure.text is not None
    assert failure.text.split("\n  ")[: len(RECORD.explanation.split("\n  "))] == RECORD.explanation.split("\n  ")
    case = failure.getparent()
    assert case is not None
    assert (case.get("classname"), case.get("name")) == ("cross-check.arm_2r", "mujoco/mjcf")
    [skipped] = root.iter("skipped")
    assert skipped.text == WHY


def test_what_is_not_as_expected_comes_first_and_new_ones_before_others() -> None:
    known = replace(CASES[1], group="zebra")
    text = render_summary(summary_of([*CASES, known], before=[known, CASES[2]], changes=[CHANGE]))
    places = [text.index(words) for words in ("are not as expected", "### atlas: far", "### cross-check: arm", "### cross-check: zebra")]
    places += [text.index(words) for words in ("## Changed in the trend", "## Since the last night", "## Counts", "The whole night again")]
    assert places == sorted(places)
    assert "3 of 5 cases are not as expected, 2 of them new since the last night" in text
    assert "### cross-check: arm\\_2r mujoco/mjcf (new)" in text or "### cross-check: arm_2r mujoco/mjcf (new)" in text
    assert "zebra mujoco/mjcf (new)" not in text
    assert "| collar | mujoco/mjcf | median backward error | 1.20 | 3.00 | 9 | jump |" in text
    assert f"```sh\n{RECORD.replay}\n```" in text


def test_nothing_in_a_message_is_obeyed() -> None:
    text = render_summary(summary_of(CASES))
    assert not re.search(r"[\x00-\x09\x0b-\x1f\ud800-\udfff]", text)
    # A block ends where its own fence does.
    block = text.partition("### atlas")[2].partition("Again:")[0]
    fence = re.findall(r"^(`{3,})", block, re.MULTILINE)
    assert fence[0] == fence[-1] and len(fence[0]) > 3
    text.encode()


@pytest.mark.ci
def test_a_summary_fits_a_step() -> None:
    many = [Case.of(("cross-check", f"system_{place:03}", "mujoco/mjcf"), ["x" * 100_000], replay="harness check") for place in range(500)]
    text = render_summary(summary_of(many, before=[]))
    assert len(text.encode()) < 2**20
    assert f"{500 - MOST_SHOWN} more are in `nightly.xml`" in text
    # The first of each, not the last.
    shown, listed = (re.findall(rf"^{mark} .*system_(\d+)", text, re.MULTILINE) for mark in ("###", "-"))
    assert shown == [f"{place:03}" for place in range(MOST_SHOWN)]
    assert listed == [f"{place:03}" for place in range(MOST_LISTED)] and f"- and {500 - MOST_LISTED} more" in text


def test_a_quiet_night_says_so() -> None:
    text = render_summary(summary_of([CASES[2]], before=[CASES[2]]))
    assert "The one case is as expected." in text
    assert "Nothing is new." in text
    assert "Not as expected" not in text
