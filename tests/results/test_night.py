"""What is new in a night, case by case, and what the summary says of it."""

from __future__ import annotations

import re

from support_results import RUN

from harness.report.night import NightSummary, render_summary
from harness.results.night import Case, Night, NightSettings, new_since

# Whether the case was good the night before, and is: not there, good, or not good; and where the summary lists it.
CHANGES = {
    (None, True): "Came",
    (None, False): "New and not as expected",
    (True, None): "Went",
    (False, None): "Went",
    (True, True): None,
    (True, False): "New and not as expected",
    (False, True): "Good again",
    (False, False): None,
}


def cases(night: int) -> list[Case]:
    """A case of each change, in the first or the second night."""
    return [
        Case.of(("cross-check", f"from {change[0]} to {change[1]}", "mujoco/mjcf"), [] if change[night] else ["it disagrees"])
        for change in CHANGES
        if change[night] is not None
    ]


def test_each_case_is_new_good_again_come_or_gone_or_as_it_was() -> None:
    expected: dict[str, set[str]] = {}
    for (before, now), title in CHANGES.items():
        if title:
            expected.setdefault(title, set()).add(f"cross-check: from {before} to {now} mujoco/mjcf")
    since = new_since(cases(0), cases(1))
    worse, mended = ({case.title for case in found} for found in (since.worse, since.mended))
    assert {"New and not as expected": worse, "Good again": mended, "Came": set(since.came), "Went": set(since.went)} == expected
    settings = NightSettings(stages=[], states=1, seed=0)
    summary = NightSummary(run=RUN, night=Night(settings=[settings]), cases=cases(1), before=cases(0))
    news = render_summary(summary).partition("## Since the last night")[2].partition("## Counts")[0]
    lists = re.findall(r"^([A-Z].+) \((\d+)\):\n\n((?:- .+\n)+)", news, re.MULTILINE)
    assert {title: set(names.removeprefix("- ").rstrip().split("\n- ")) for title, _, names in lists} == expected
    assert {title: int(count) for title, count, _ in lists} == {title: len(names) for title, names in expected.items()}
    assert summary.sentence == "3 of 6 cases are not as expected, 2 of them new since the last night."
    assert [case.title in worse for case in summary.bad] == [True, True, False]
