"""The page for every reader: landmarks, headings, captions, links, contrast, and the width of a phone."""

from __future__ import annotations

import base64
import functools
import hashlib
import math
import re
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import lxml.html
import pytest
from comparison.test_trends import survey
from hypothesis import given
from hypothesis import strategies as st
from report import test_benchmark_report, test_hard_report, test_report
from report.test_report import CARDS, CAUSE, SYSTEMS, night, run_on

from harness import report
from harness.report.comparison import render
from harness.report.figures import COLOURS, library
from harness.report.html import sentence_case
from harness.report.markup import equations, picture
from harness.report.sparkline import Sparkline
from harness.results.benchmark import Benchmark
from harness.results.cross_check import CrossCheckResult, Picture, SuperfluousPart
from harness.results.records import Record
from harness.results.run import Run

SVG = (
    '<svg class="mechanism" viewBox="0 0 460 260" role="img"><title>Joints slide</title>'
    '<path class="link" d="M0 0L1 1" style="stroke:#2f8fd0"/></svg>'
)
STYLE = (Path(report.__file__).parent / "style.css").read_text()
# What stands on what, in text; every pair by the names of the style sheet.
TEXT = [
    *((ink, paper) for ink in ("ink", "soft", "link", "bad") for paper in ("paper", "panel")),
    *((f"{tone}", f"{tone}-back") for tone in ("good", "declared", "warn", "bad", "none")),
]


def changed(records: list[Record]) -> list[Record]:
    """A night in which a median is another."""
    return [test_report.with_median(one, 3.0) if (one.system, one.subject) == ("collar", "lagrange") else one for one in records]


def earlier_benchmark(day: int) -> tuple[Run, Benchmark]:
    """A benchmark of days before, whose first method costs five times as much from the eighth day on."""
    run = test_benchmark_report.RUN
    found = test_benchmark_report.sample()
    [first, *others] = found.accelerations
    dearer = replace(first, fastest=(first.fastest or 0.0) * (5.0 if day < 8 else 1.0))
    started = datetime.fromisoformat(run.started) - timedelta(days=20 - day)
    return replace(run, started=started.isoformat()), replace(found, accelerations=[dearer, *others])


@functools.cache
def whole() -> dict[str, str]:
    """A report with every part that a report can have."""
    found = CrossCheckResult(
        records=changed(night(3)), systems=list(CARDS), pictures=[Picture(system=name, svg=SVG) for name in SYSTEMS], causes=[CAUSE],
        worst_cases=[test_hard_report.CASE, replace(test_hard_report.CASE, subject="lagrange", reproducer="")],
        superfluous=[SuperfluousPart("collar", "mujoco/mjcf", "mjcf/collar.xml", 7, "joint", "armature", "0", "is not felt")],
    )  # fmt: skip
    return report.build(
        run_on(3),
        found,
        [(run_on(day), night(day)) for day in range(3)],
        benchmarks=[(test_benchmark_report.RUN, test_benchmark_report.sample()), *(earlier_benchmark(day) for day in range(12))],
        atlas=(test_hard_report.RUN, test_hard_report.sample()),
        robots=report.Survey(
            replace(run_on(2), profile="survey robots"), survey(arm=(1e9, 4.0), leg=(None, None)), earlier=[survey(arm=(2.0, None))]
        ),
    )


# Every kind of page.
KINDS = (
    "index.html", "about.html", "differences.html", "changes.html", "mechanisms/collar.html", "engines/mujoco.html", "benchmark.html",
    "hard.html", "robots.html", "robots/arm.urdf.html",
)  # fmt: skip


@functools.cache
def sites() -> dict[str, dict[str, str]]:
    """Reports on everything, on measurements without verdicts, and on nothing."""
    measurements = report.build(
        benchmarks=[(test_benchmark_report.RUN, test_benchmark_report.sample())], atlas=(test_hard_report.RUN, test_hard_report.sample())
    )
    return {"whole": whole(), "benchmark and atlas": measurements, "nothing": test_report.build(run_on(0), [], [])}


SHOWN = [*(("whole", name) for name in KINDS), ("benchmark and atlas", "index.html"), ("nothing", "index.html")]


@pytest.fixture(scope="module", params=SHOWN, ids=" ".join)
def page(request: pytest.FixtureRequest) -> Any:
    site, name = request.param
    return lxml.html.fromstring(sites()[site][name])


@pytest.fixture(scope="module")
def full() -> Any:
    """All pages with drawings and charts, as one."""
    return every_page(whole())


def test_a_page_has_one_main_part_and_a_contents_that_leads_to_every_heading(page: Any) -> None:
    [_] = page.xpath("//main")
    [contents] = page.xpath("//nav")
    assert contents.get("aria-label")
    assert [child.tag for child in page.body if child.tag != "script"] == ["header", "nav", "main"]
    headings = page.xpath("//main//h2")
    assert headings
    assert [heading.get("id") for heading in headings] == [link.get("href")[1:] for link in contents.xpath("./ul/li/a")]
    assert [heading.text_content() for heading in headings] == [link.text_content() for link in contents.xpath("./ul/li/a")]


def test_headings_go_down_one_level_at_a_time(page: Any) -> None:
    levels = [int(heading.tag[1]) for heading in page.xpath("//h1 | //h2 | //h3 | //h4 | //h5")]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_every_table_has_a_caption_and_every_heading_of_one_its_scope(page: Any) -> None:
    for table in page.xpath("//table"):
        assert table[0].tag == "caption" and table[0].text_content().strip()
        assert table.xpath(".//th") and all(head.get("scope") in ("col", "row") for head in table.xpath(".//th"))


def test_names_are_unique_and_every_link_leads_somewhere(page: Any) -> None:
    names = page.xpath("//@id")
    assert len(names) == len(set(names))
    assert {link[1:] for link in page.xpath("//a/@href") if link.startswith("#")} <= set(names)
    assert all(link.text_content().strip() for link in page.xpath("//a"))


def test_nothing_that_can_be_clicked_stands_in_something_that_can(page: Any) -> None:
    assert not page.xpath("//summary//a | //a//a | //summary//summary")


def test_what_scrolls_can_be_reached_by_keyboard_and_has_a_name(page: Any) -> None:
    for scrolling in page.xpath("//div[contains(@class, 'wide')] | //div[@class='equations']"):
        assert scrolling.get("tabindex") == "0" and scrolling.get("role") == "group" and scrolling.get("aria-label")


def test_a_policy_allows_no_script_but_the_site_s_own_and_no_style_but_that_and_what_charts_compute(page: Any) -> None:
    [policy] = page.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    has_charts = bool(page.xpath("//script[@class='packed']"))
    own = "'self' file:"
    styles = f"{own} 'unsafe-inline'" if has_charts else own
    assert rules == {"default-src": "'none'", "script-src": own, "style-src": styles, "img-src": own}
    assert all(script.get("src") or script.get("type") == "text/plain" for script in page.xpath("//script"))
    assert not page.xpath("//style | //@style") and not page.xpath("//@*[starts-with(name(), 'on')]")


def test_the_style_of_a_page_that_stands_alone_is_allowed_by_its_hash() -> None:
    text = render(run_on(0), "two files", [])
    style = text[text.index("<style>") + 7 : text.index("</style>")]
    hashed = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert f"content=\"default-src 'none'; style-src 'sha256-{hashed}'\"" in text and "<script" not in text


def test_every_drawing_says_what_it_shows(full: Any) -> None:
    drawings = full.xpath("//*[local-name()='svg']")
    assert len(drawings) > len(SYSTEMS)
    for drawing in drawings:
        # What stands beside the name of its mechanism says nothing more.
        is_named = drawing.get("role") == "img" and (drawing.get("aria-label") or drawing[0].tag == "title")
        assert is_named or (drawing.get("aria-hidden") == "true" and drawing.getparent().text_content().strip())
    charts = full.xpath("//figure//div[@data-root-id]")
    assert charts
    for chart in charts:
        assert chart.getparent().get("role") == "img" and chart.getparent().get("aria-label")


def every_page(files: dict[str, str]) -> Any:
    return lxml.html.fromstring("".join(text for name, text in files.items() if name.endswith(".html")))


def luminance(colour: str) -> float:
    """Relative luminance. Source: WCAG 2.2, definitions."""
    parts = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one: str, other: str) -> float:
    low, high = sorted([luminance(one), luminance(other)])
    return (high + 0.05) / (low + 0.05)


def palettes() -> dict[str, dict[str, str]]:
    light, dark = (
        dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block)) for block in STYLE.split("@media (prefers-color-scheme: dark)")[:2]
    )
    return {"light": light, "dark": dark}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_what_it_stands_on(scheme: str) -> None:
    palette = palettes()[scheme]
    assert contrast("#ffffff", "#000000") == pytest.approx(21.0)
    for ink, paper in TEXT:
        assert contrast(palette[ink], palette[paper]) >= 4.5, (ink, paper)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_marks_of_charts_and_pictures_stand_out(scheme: str) -> None:
    for colour in COLOURS:
        assert contrast(colour, palettes()[scheme]["paper"]) >= 3.0, colour


def test_no_text_is_coloured_by_anything_but_the_palette() -> None:
    rules = re.sub(r"--[\w-]+:[^;]*;", "", STYLE)
    assert not re.search(r"(?<![\w-])(color|fill|background): *#", rules)


def test_no_width_is_fixed_beyond_a_phone() -> None:
    """390 px are 24 rem; what is wider wraps, scrolls in its own box, or stands in a query for wider windows."""
    narrow = re.sub(r"@media \(min-width[^{]*\{(?:[^{}]*\{[^{}]*\})*[^{}]*\}", "", STYLE)
    assert "13rem minmax" in STYLE and "13rem minmax" not in narrow
    widths = re.findall(r"(?:(?<![-\w(])(?:min-)?width: *|minmax\()([\d.]+)(rem|px)", narrow)
    assert widths and all(float(size) * {"rem": 16, "px": 1}[unit] <= 360 for size, unit in widths)
    for selector, rule in re.findall(r"([^{}]*)\{([^{}]*)\}", narrow):
        if "nowrap" in rule:
            assert "td" in selector or ".verdict" in selector, selector
        # Lines of a program or a command wrap, so that nothing but tables and equations scrolls.
        if "overflow-x" in rule:
            assert selector.strip() in (".wide", ".equations"), selector


def test_a_sentence_begins_with_a_capital_and_a_path_or_name_as_it_is_written() -> None:
    assert sentence_case("the urdf model is at fault") == "The urdf model is at fault"
    assert sentence_case("use a ball joint") == "Use a ball joint"
    for text in (
        "urdf/arm.urdf:3: <mass>",
        "edited.urdf:25: x",
        "mujoco/mjcf: as pinocchio",
        "arm_2r, m1 = 3",
        "m = 2 explains it",
        "",
        "4 bars",
    ):
        assert sentence_case(text) == text


def test_a_path_at_the_head_of_a_cause_keeps_its_letters() -> None:
    text = " ".join(lxml.html.fromstring(whole()["mechanisms/collar.html"]).text_content().split())
    assert "mjcf/collar.xml:9: <inertial" in text and "Mjcf/" not in text


def test_only_a_drawing_passes_as_one() -> None:
    assert picture(SVG) is not None and "<path" in picture(SVG)
    for rest in (
        "",
        "x",
        SVG.replace("path", "script"),
        SVG.replace("class=", "onclick="),
        SVG.replace("stroke:#2f8fd0", "background:url(x)"),
    ):
        shown = picture(rest) or ""
        assert not re.search("script|onclick|url", shown)
    assert equations(SVG) is None


@pytest.mark.ci
def test_a_reason_why_several_pairs_differ_is_given_once() -> None:
    about = {"verdict": "unstable", "expected": "unstable", "expected_reason": "small pivots", "expected_link": "a book"}
    entries = [test_report.record(name, "lagrange", **about) for name in SYSTEMS]
    page = lxml.html.fromstring(test_report.build(run_on(0), CARDS, entries)["differences.html"])
    [listed] = page.xpath("//h2[@id='expected']/following-sibling::ul[1]/li")
    assert " ".join(listed.text_content().split()).startswith("unstable Small pivots. Source: a book.")
    assert [link.text_content() for link in listed.xpath(".//a")] == [f"{name}, lagrange" for name in SYSTEMS]


@pytest.mark.usefixtures("without_charts")
def test_the_trend_of_each_pair_is_shown() -> None:
    history = [(run_on(day), [replace(entry, backward_error=10.0**day) for entry in night(day)]) for day in range(3)]
    page = every_page(test_report.build(run_on(3), CARDS, night(3), history))
    trends = page.xpath("//section//*[local-name()='svg'][@class='trend']")
    # Worst, 99 % and median.
    assert len(trends) == 3 * len(SYSTEMS) * len(test_report.SUBJECTS)
    labels = [trend.get("aria-label") for trend in trends]
    assert labels.count("1.00 to 100 in 4 runs") == 6 and "1.00 to 654 in 4 runs" in labels and "1.00 to inf in 4 runs" in labels
    assert not every_page(test_report.build(run_on(0), CARDS, night(0))).xpath("//*[@class='trend']")


@given(st.lists(st.none() | st.floats(), max_size=5), st.sets(st.integers(0, 4)))
def test_any_trend_can_be_drawn(values: list[float | None], changes: set[int]) -> None:
    line = Sparkline(values, changes)
    shown = lxml.html.fromstring(f"<div>{line.__html__()}</div>")
    coordinates = [float(number) for place in shown.xpath("//polyline/@points") for number in re.split("[ ,]", place) if number]
    assert all(0 <= number <= 80 for number in coordinates)
    assert shown.xpath("//svg/@aria-label") == [str(line)]
    assert len(shown.xpath("//path[@class='change']")) == sum(
        value is not None and not math.isnan(value) and place in changes for place, value in enumerate(values)
    )


def test_change_points_are_drawn_in_the_trend_of_their_cell_and_listed_on_the_page_of_changes() -> None:
    mechanism, changes = (lxml.html.fromstring(whole()[name]) for name in ("mechanisms/collar.html", "changes.html"))
    [row] = mechanism.xpath("//table[starts-with(caption, 'Trends of')]/tbody/tr[*[1]='lagrange']")
    # Worst, 99 % and median.
    assert [len(line.xpath(".//*[@class='change']")) for line in row.xpath(".//*[local-name()='svg']")] == [0, 0, 1]
    assert "Median backward error of each run" in mechanism.text_content()
    told = test_report.changes_on(whole()["changes.html"])
    assert [line[1:4] for line in told] == [["arm_2r", "heyoka float32", "cost"], ["collar", "lagrange", "median backward error"]]
    assert "2 numbers changed in the trend of 13 runs" in whole()["index.html"]
    assert changes.xpath("//table[starts-with(caption, 'Changed in')]//a/@href") == ["mechanisms/arm_2r.html", "mechanisms/collar.html"]
    assert len(lxml.html.fromstring(whole()["mechanisms/arm_2r.html"]).xpath("//*[@id='cost']/..//*[@class='change']")) == 1


def test_equations_too_long_to_be_read_are_shown_as_the_energies_they_follow_from() -> None:
    long = replace(CARDS[0], equations_mathml="", equations_text="", energies_text="kinetic = m * v**2 / 2", operations=2263)
    page = lxml.html.fromstring(test_report.build(run_on(0), [long], [])["mechanisms/arm_2r.html"])
    [equations] = page.xpath("//section[h2/@id='equations']")
    assert "kinetic = m * v**2 / 2" in equations.text_content() and "2,263 operations" in equations.text_content()


def test_pages_share_the_chart_library_and_each_has_less_than_3_mb_with_it() -> None:
    files = whole()
    assert files["bokeh.js"] == library() and not any(library() in text for name, text in files.items() if name != "bokeh.js")
    shared = sum(len(files[name].encode()) for name in ("bokeh.js", "charts.js", "site.js", "style.css"))
    assert all(len(text.encode()) + shared < 3_000_000 for name, text in files.items() if name.endswith(".html"))
