"""A night for CI: the summary in Markdown, and JUnit XML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from lxml import etree

from harness.report.markdown import fenced
from harness.results.night import BROKEN, FAILED, LEFT_OUT, PASSED, Case, NewSince, Night, NightSettings, new_since
from harness.results.run import Run
from harness.results.table import Column, Table, counted, grouped, markdown_line, printable
from harness.results.trend import ChangedCell, trend_changes_table


@dataclass(frozen=True, kw_only=True)
class NightSummary:
    """A night that is complete.

    Attributes:
        run: of the night. night: its course. cases: by stage, group and name.
        before: the cases of the last night that ended; None where there is none.
        changes: of the trend, that were found this night.
        problems: what the user has to mend.
        resumed: how many units were complete when the night went on; 0 where it was not interrupted.
    """

    run: Run
    night: Night
    cases: Sequence[Case]
    before: Sequence[Case] | None = None
    changes: Sequence[ChangedCell] = field(default_factory=list)
    problems: Sequence[str] = ()
    resumed: int = 0

    @property
    def settings(self) -> NightSettings:
        return self.night.settings[0]

    @cached_property
    def bad(self) -> list[Case]:
        """Cases that are not as expected, new ones first."""
        new = set() if self.since is None else {case.key for case in self.since.worse}
        return sorted((case for case in self.cases if not case.is_good), key=lambda case: (case.key not in new, case.key))

    @cached_property
    def since(self) -> NewSince | None:
        """Differences from the night before; None where there is none."""
        return None if self.before is None else new_since(self.before, self.cases)

    @property
    def as_expected(self) -> bool:
        """True where every case is good; what a trend says, and what a computation costs, changes nothing of it."""
        return bool(self.cases) and not self.bad

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        total, bad = len(self.cases), len(self.bad)
        if not total:
            return "Nothing was compared."
        if not bad:
            return f"All {counted(total, 'case')} are as expected." if total > 1 else "The one case is as expected."
        new = "" if self.since is None else f", {len(self.since.worse)} of them new since the last night"
        return f"{bad} of {counted(total, 'case')} {'is' if bad == 1 else 'are'} not as expected{new}."

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """Stage to outcome to number of cases."""
        outcomes = grouped((case.stage, case.outcome) for case in self.cases)
        return {stage: {name: found.count(name) for name in _OUTCOMES} for stage, found in outcomes.items()}

    def to_json(self) -> dict[str, Any]:
        """Plain data for ``harness.results.plain_json.to_json``."""
        return {
            "night": {
                "settings": self.settings,
                "sentence": self.sentence,
                "as_expected": self.as_expected,
                "resumed": self.resumed,
                "problems": list(self.problems),
                "faults": self.night.faults,
                "crashed": self.night.crashed,
            },
            "counts": self.counts,
            "cases": list(self.cases),
            "since_last_night": self.since,
            "changes": list(self.changes),
        }


# A summary of a step on GitHub holds 1 MiB; what is beyond stands in the XML.
MOST_SHOWN, MOST_LISTED, MOST_DETAILS = 60, 100, 4000
_OUTCOMES = (PASSED, FAILED, BROKEN, LEFT_OUT)


def render_summary(summary: NightSummary) -> str:
    """Cases that are not as expected, then those that are new, the changes in the trend, and the counts."""
    run, since, bad = summary.run, summary.since, summary.bad
    new = {case.key for case in since.worse} if since else set()
    versions = ", ".join(f"{name} {version}" for name, version in sorted(run.versions.items()))
    parts = [
        f"# Night of {run.started}",
        f"**{markdown_line(summary.sentence)}**",
        *_listed("## To be mended", summary.problems),
        *_listed("## Faults of the harness", summary.night.faults),
        *(["## Not as expected"] if bad else []),
        *(part for case in bad[:MOST_SHOWN] for part in _shown(case, case.key in new)),
        f"{len(bad) - MOST_SHOWN} more are in `nightly.xml`." if len(bad) > MOST_SHOWN else "",
        *(["## Changed in the trend", trend_changes_table(summary.changes).markdown()] if summary.changes else []),
        *(_news(since) if since else []),
        "## Counts",
        counts_table(summary).markdown(),
        markdown_line(f"Library {run.library}, {run.states:,} states for each system, seed {run.seed}; {versions}."),
        f"The night was interrupted; {counted(summary.resumed, 'unit')} of work were complete when it went on." if summary.resumed else "",
        "The whole night again:",
        fenced([run.command], "sh"),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def _news(since: NewSince) -> list[str]:
    """Differences from the last night."""
    names = {
        "New and not as expected": [case.title for case in since.worse],
        "Good again": [case.title for case in since.mended],
        "Came": since.came,
        "Went": since.went,
    }
    told = [part for title, own in names.items() for part in _listed(f"{title} ({len(own)}):", own)]
    return ["## Since the last night", *(told or ["Nothing is new."])]


def _shown(case: Case, is_new: bool) -> list[str]:
    lines = [printable(line) for line in (case.details or case.message)[:MOST_DETAILS].split("\n")]
    again = ["Again:", fenced([printable(case.replay)], "sh")] if case.replay else []
    return [f"### {markdown_line(case.title)}{' (new)' if is_new else ''}", fenced(lines, "text"), *again]


def _listed(title: str, names: Sequence[str]) -> list[str]:
    """Names below a title; nothing without any."""
    lines = [f"- {markdown_line(name)}" for name in names[:MOST_LISTED]]
    more = [f"- and {len(names) - MOST_LISTED} more"] if len(names) > MOST_LISTED else []
    return [title, "\n".join([*lines, *more])] if names else []


def counts_table(summary: NightSummary) -> Table:
    """A row for each stage."""
    heads = (Column(name, "count") for name in _OUTCOMES)
    return Table(["stage", *heads], [[stage, *found.values()] for stage, found in summary.counts.items()])


def render_junit(summary: NightSummary) -> str:
    """One suite for each stage and one test case for each case, as Jenkins' JUnit schema has them."""
    root = etree.Element("testsuites", name=f"harness nightly {summary.run.library}", **_totals(summary.cases))
    for stage, cases in grouped((case.stage, case) for case in summary.cases).items():
        suite = etree.SubElement(root, "testsuite", name=stage, timestamp=summary.run.started[:19], **_totals(cases))
        suite.set("skipped", str(sum(case.outcome == LEFT_OUT for case in cases)))
        for case in cases:
            _add_case(suite, case)
    return str(etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8").decode())


def _totals(cases: Iterable[Case]) -> dict[str, str]:
    every = list(cases)
    failures, errors = (sum(case.outcome == outcome for case in every) for outcome in (FAILED, BROKEN))
    seconds = sum(case.seconds for case in every)
    return {"tests": str(len(every)), "failures": str(failures), "errors": str(errors), "time": f"{seconds:.3f}"}


def _add_case(suite: etree._Element, case: Case) -> None:
    names = {"classname": printable(f"{case.stage}.{case.group}"), "name": printable(case.name)}
    element = etree.SubElement(suite, "testcase", **names, time=f"{case.seconds:.3f}")
    if case.outcome == LEFT_OUT:
        etree.SubElement(element, "skipped").text = printable(case.message)
    elif not case.is_good:
        details = case.details or case.message
        lines = [*details.split("\n"), *([f"replay: {case.replay}"] if case.replay and case.replay not in details else [])]
        tag = "failure" if case.outcome == FAILED else "error"
        wrong = etree.SubElement(element, tag, type=case.outcome, message=printable(case.message))
        wrong.text = "\n".join(map(printable, lines))
