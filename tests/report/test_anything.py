"""Reports of anything: whatever was measured and whatever texts it holds, pages are complete, escaped, and fetch nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar, get_args, get_type_hints

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from report import test_benchmark_report, test_hard_report
from report.test_page import sites
from report.test_report import CARDS, SUBJECTS, night, run_on
from support import Page, missing, pages_of, site_of

from harness.report import build
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.cross_check import CrossCheckResult, SystemCard
from harness.results.records import Record
from harness.verdict import Verdict

_Kind = TypeVar("_Kind")
EVIL = "</script><script>alert(1)</script>"
numbers = st.floats() | st.sampled_from([0.0, 1e-3, 5e-324, -1.0])
names = st.sampled_from(["arm_2r", "collar", "gimbal", "mujoco RK4", *SUBJECTS]) | st.text(max_size=12)
verdicts = st.sampled_from([verdict.value for verdict in Verdict])
bins = st.sampled_from(["exact", "inf", "-3", "0", "7", "-647"]) | st.integers().map(str) | st.text(max_size=3)
counts = st.integers(0, 10**9)
FIXED: dict[str, st.SearchStrategy[Any]] = {
    "worst_state": st.none() | st.dictionaries(st.sampled_from("qv"), st.lists(st.floats(), max_size=3)),
    "distribution": st.dictionaries(bins, counts, max_size=4), "verdict_counts": st.dictionaries(verdicts, counts, max_size=3),
    "coordinates": st.just([{"name": "x", "joint": "slide"}]), "parameters": st.just([]), "representative": st.none(),
}  # fmt: skip


def anything(hint: Any, name: str = "") -> st.SearchStrategy[Any]:
    """Values of a field, sensible or not; verdicts are verdicts."""
    if name in FIXED:
        return FIXED[name]
    if hint is str and ("verdict" in name or name == "expected"):
        return verdicts
    if is_dataclass(hint):
        return any_of(hint)
    if hint.__class__.__name__ == "UnionType":
        return st.none() | anything(get_args(hint)[0])
    if getattr(hint, "__origin__", None) is dict:
        return st.dictionaries(names, anything(get_args(hint)[1]), max_size=2)
    if getattr(hint, "__origin__", None) is tuple and Ellipsis not in get_args(hint):
        return st.tuples(*map(anything, get_args(hint)))
    if get_args(hint):
        return st.lists(anything(get_args(hint)[0]), max_size=3)
    return {str: names, float: numbers, int: counts, bool: st.booleans()}[hint]


def any_of(kind: Callable[..., _Kind], *left_out: str) -> st.SearchStrategy[_Kind]:
    hints = {name: hint for name, hint in get_type_hints(kind).items() if name in {part.name for part in fields(kind)} - {*left_out}}  # type: ignore[arg-type]
    return st.builds(kind, **{name: anything(hint, name) for name, hint in hints.items()})


# What a cross-check makes of bounds, and what a file expects, makes sense.
SENSIBLE = (
    "quantity", "median_bounds", "percentile_99_bounds", "expected_backward_error", "expected_median_backward_error", "expected_share",
)  # fmt: skip
records, cards = st.lists(any_of(Record, *SENSIBLE), max_size=4), st.lists(any_of(SystemCard), max_size=2)
found = st.builds(CrossCheckResult, records=records, systems=cards)


@pytest.mark.ci
@pytest.mark.parametrize("part", ["found", "benchmarks", "atlas"])
def test_a_report_of_anything_can_be_built(part: str) -> None:
    kinds: dict[str, st.SearchStrategy[Any]] = {"found": found, "benchmarks": any_of(Benchmark, "cheapest"), "atlas": any_of(Atlas)}

    @settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
    @given(drawn=kinds[part], earlier=found)
    def check(drawn: Any, earlier: CrossCheckResult) -> None:
        given: dict[str, Any] = {"found": {"run": run_on(1), "found": drawn, "history": [(run_on(0), earlier.records)]}}
        given |= {"benchmarks": {"benchmarks": [(run_on(1), drawn)]}, "atlas": {"atlas": (run_on(1), drawn)}}
        built = build(**given[part])
        document = json.loads(built["report.json"], parse_constant=pytest.fail)
        assert part != "found" or len(document["records"]) == len(drawn.records)
        assert_sound(built)

    check()


def assert_sound(built: dict[str, str]) -> None:
    """Pages fetch nothing, every link leads somewhere, and no name stands twice on a page."""
    assert not missing(built)
    for text in pages_of(built).values():
        identifiers = Page(text).identifiers
        assert "default-src 'none'" in text and len(set(identifiers)) == len(identifiers)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["whole", "benchmark and atlas", "nothing"])
def test_pages_fetch_nothing_and_lead_where_their_links_say(name: str) -> None:
    assert_sound(sites()[name])


def spoilt(item: Any, name: str = "") -> Any:
    """The same with a script in the place of every text that is none of a few words."""
    if isinstance(item, str):
        return item if name in ("verdict", "expected", "quantity") else EVIL
    if isinstance(item, list):
        return [spoilt(part, name) for part in item]
    if not is_dataclass(item) or isinstance(item, type):
        return item
    return replace(item, **{part.name: spoilt(getattr(item, part.name), part.name) for part in fields(item)})


@pytest.mark.ci
def test_text_is_escaped() -> None:
    result = CrossCheckResult(records=[spoilt(night(3)[0])], systems=[spoilt(CARDS[0])], worst_cases=[spoilt(test_hard_report.CASE)])
    measured = (run_on(0), spoilt(test_benchmark_report.sample())), (run_on(0), spoilt(test_hard_report.sample()))
    built = build(run_on(0), result, benchmarks=[measured[0]], atlas=measured[1])
    assert not missing(built) and not any("<script>" in text for text in pages_of(built).values())
    page = site_of(built)
    assert page.words.count(EVIL) > 40 and not any(link.startswith(EVIL) for link in page.links)
