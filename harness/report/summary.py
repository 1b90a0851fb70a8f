"""A cross-check arranged for a reader, before it is HTML or Markdown: orders, sentences, worst cases, changes."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from functools import cached_property
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from harness.errors import shown_path
from harness.report.sparkline import NO_TREND, Sparkline
from harness.results.plain_json import dumps
from harness.results.records import Record, Records
from harness.results.run import Run, changed_versions
from harness.results.table import Table, counted, error_text, grouped
from harness.results.trend import ChangedCell, Trend, comparable, readings_of_records, trends
from harness.results.trend_numbers import TRACKED
from harness.verdict import SEVERITY, Verdict

if TYPE_CHECKING:
    from harness.results.cross_check import Cause, CrossCheckResult

Earlier = tuple[Run, Sequence[Record]]
# A verdict or a version that is not what it was in the run before: its name, before, and now.
ChangedValue = tuple[str, str, str]


class Summary:
    """Records arranged for a reader.

    Attributes:
        sentence: the result, as the command prints it. is_good: whether something was compared and everything is as expected.
        run, cards, earlier: of the arguments; cards by name, earlier runs oldest first.
        systems, subjects: sorted names of every card and record.
        records: those of accelerations. further: those of other quantities.
        cells: (system, subject) to its records of accelerations, nearly always one.
        unexpected: records of all quantities whose verdict is not the expected one.
        listed: records that are expected to differ; of other quantities those that an entry expects to.
        missing: (system, subject) pairs without a record, of the systems that have a card.
        superfluous: parts of models that their scenes do not need, by file and line; of a path, only the folder
            and the file stay, because reports are published.
        differs: what subjects do not hold alike after loading, by system; with such paths as well.
        causes: (system, subject) to why its record is wrong, where that was looked for; with such paths as well.
        pictures: system to its ``<svg>`` element.
        worst_cases: subject to its worst cases, worst first; empty where none were looked for.
    """

    def __init__(self, run: Run, found: CrossCheckResult, history: Sequence[Earlier] = ()) -> None:
        self.run, self.sentence = run, found.conclusion()
        self.is_good = bool(found.records) and found.as_expected
        self.cards = {card.name: card for card in found.systems}
        self.records, self.further = (Records(one for one in found.records if one.is_further is further) for further in (False, True))
        earlier = [(one, [record for record in records if not record.is_further]) for one, records in history]
        self.earlier = sorted(earlier, key=lambda entry: datetime.fromisoformat(entry[0].started))
        self.systems = sorted({record.system for record in found.records} | set(self.cards))
        self.subjects = sorted({record.subject for record in found.records})
        self.cells = grouped(((record.system, record.subject), record) for record in self.records)
        self.unexpected = [*self.records.unexpected, *self.further.unexpected]
        self.listed = [record for record in self.records if record.expected != "agrees"]
        # What nobody claims to compute needs no entry.
        self.listed += [record for record in self.further if record.expected != "agrees" and record.expected_link]
        # A variant of models, which has no card, need not stand in every format.
        self.missing = [
            (system, subject) for system in sorted(self.cards) for subject in self.subjects if (system, subject) not in self.cells
        ]
        self.causes = {(cause.system, cause.subject): _published(cause) for cause in found.causes}
        named = [replace(part, path=_short(part.path)) for part in found.superfluous]
        self.superfluous = sorted(named, key=lambda part: (part.path, part.line, part.subject))
        shortened = [replace(finding, places=[_short(place) for place in finding.places]) for finding in found.differs]
        self.differs = sorted(shortened, key=lambda finding: (finding.system, finding.joint, finding.quantity))
        self.pictures = {picture.system: picture.svg for picture in found.pictures}
        self.worst_cases = grouped((case.subject, case) for case in found.worst_cases)

    @property
    def differing(self) -> dict[str, int]:
        """Verdict to number of the pairs that differ for a known reason, the gravest first."""
        verdicts = [record.verdict for record in self.records if record.as_expected and record.verdict != Verdict.AGREES]
        return {verdict: verdicts.count(verdict) for verdict in sorted({*verdicts}, key=SEVERITY.__getitem__, reverse=True)}

    @property
    def remarks(self) -> list[str]:
        """Sentences that qualify the result: what is missing, and at which states was asked."""
        remarks = []
        if self.missing:
            verb = "has" if len(self.missing) == 1 else "have"
            remarks.append(f"{counted(len(self.missing), 'pair')} of the table {verb} no record: not run.")
        return [*remarks, *([f"{self.records.origins.capitalize()}."] if self.records.origins else [])]

    def expectations(self, further: bool) -> dict[tuple[str, str, str], list[Record]]:
        """(expected verdict, reason, link) to the records that are expected to differ for it, of accelerations or of ``further``."""
        listed = [record for record in self.listed if record.is_further is further]
        listed.sort(key=lambda record: SEVERITY[record.expected], reverse=True)
        return grouped(((record.expected, record.expected_reason, record.expected_link), record) for record in listed)

    @property
    def changed(self) -> str:
        """Extent of the changes since the last run, in a sentence; "" where there was none."""
        if not self.earlier:
            return ""
        verdicts, versions = len(self.changed_verdicts()), len(self.changed_versions())
        return f"Since the last run {counted(verdicts, 'verdict')} and {counted(versions, 'version')} changed."

    def of_system(self, system: str) -> Records:
        """The records of ``system``, by subject."""
        return Records(record for record in self.records if record.system == system)

    @cached_property
    def nights(self) -> list[tuple[Run, Sequence[Record]]]:
        """The runs over which numbers have trends, oldest first, this one last."""
        return [*comparable(self.run.states, self.earlier), (self.run, self.records)]

    @cached_property
    def trends(self) -> list[Trend]:
        """Trends of every subject that was ever asked in these runs."""
        return trends([readings_of_records(records) for _, records in self.nights])

    def changes_of_this_run(self) -> list[ChangedCell]:
        """Changes of the trends that this run shows: an engine has changed long before it is wrong."""
        return [change for trend in self.trends for change in trend.changes if change.place == len(self.nights) - 1]

    def trend(self) -> dict[str, list[tuple[datetime, float]]]:
        """Subject to (start of run, worst backward error of the pairs expected to agree), oldest first."""
        points: dict[str, list[tuple[datetime, float]]] = {subject: [] for subject in self.subjects}
        for run, records in [*self.earlier, (self.run, self.records)]:
            for subject, values in points.items():
                found = worst(record for record in records if record.subject == subject and record.expected == "agrees")
                if found is not None and found.backward_error is not None:
                    values.append((datetime.fromisoformat(run.started).replace(tzinfo=None), found.backward_error))
        return points

    def changed_verdicts(self) -> list[ChangedValue]:
        """Verdicts that differ from the latest earlier run that holds the same pair."""
        before: dict[tuple[str, str], str] = {}
        for _, records in self.earlier:
            before |= {(record.system, record.subject): record.verdict for record in records}
        changes: list[ChangedValue] = []
        for (system, subject), cell in sorted(self.cells.items()):
            known = before.get((system, subject), "not run")
            changes += [(f"{system}, {subject}", known, record.verdict) for record in cell if record.verdict != known]
        if self.earlier:
            gone = {(record.system, record.subject): record.verdict for record in self.earlier[-1][1]}
            changes += [(", ".join(pair), verdict, "not run") for pair, verdict in sorted(gone.items()) if pair not in self.cells]
        return changes

    def changed_versions(self) -> list[ChangedValue]:
        """Versions that differ from the last run."""
        if not self.earlier:
            return []
        return changed_versions(self.earlier[-1][0].versions, self.run.versions)


def verdicts_on(summary: Summary, system: str) -> Table:
    """The records of ``system``."""
    return replace(summary.of_system(system).table().without("system", "expected"), caption=f"Verdicts on {system}")


def trends_on(summary: Summary, system: str) -> Table:
    """The trends of the errors of each subject that was asked of ``system``; no row where there is no run to compare with."""
    subjects = dict.fromkeys(record.series for record in summary.of_system(system)) if len(summary.nights) > 1 else {}
    known = {(trend.subject, trend.number): Sparkline.of(trend) for trend in summary.trends if trend.system == system}
    rows = [[subject, *(known.get((subject, number), NO_TREND) for number in TRACKED.values())] for subject in subjects]
    return Table(["subject", *TRACKED], rows, f"Trends of backward errors on {system}")


def _short(path: str) -> str:
    """The folder and the file of a path."""
    return "/".join(PurePath(path).parts[-2:])


def _published(cause: Cause) -> Cause:
    """A cause with short paths wherever it names one of its files."""
    text = dumps(cause)
    for side in ("model", "textbook"):
        if cause.found and cause.found[side]:
            file = cause.found[side]["file"]
            for name in (file, shown_path(Path(file))):
                text = text.replace(json.dumps(name)[1:-1], json.dumps(_short(file))[1:-1])
    return replace(cause, **json.loads(text))


def changes_table(what: str, changes: Iterable[ChangedValue]) -> Table:
    """One row per change; ``what`` is the heading of what changed."""
    return Table([what, "before", "now"], list(changes), f"Changed {what.partition(' ')[0]}s" if " " in what else "Changes")


def worst(records: Iterable[Record]) -> Record | None:
    """The record with the largest backward error, NaN counting as largest; None where none has any."""
    compared = [(record.backward_error, record) for record in records if record.backward_error is not None]
    return max(compared, key=lambda pair: math.inf if math.isnan(pair[0]) else pair[0], default=(None, None))[1]


def states_of(record: Record) -> list[tuple[str, str, str]]:
    """The states of a record: what each is, with its error; its lines; and the command that computes it again."""
    error = f" ({error_text(record.backward_error)} data roundoffs)" if record.backward_error is not None else ""
    found = [(f"Worst state{error} of", record.worst_state, record.replay)]
    if (shown := record.representative) is not None:
        error = "no backward error" if shown.backward_error is None else f"{error_text(shown.backward_error)} data roundoffs"
        found.append((f"Simplest state that shows the verdict ({error}) of", shown.state, shown.replay))
    return [(what, state_lines(state), replay) for what, state, replay in found if state or replay]


def state_lines(state: Mapping[str, Sequence[float]] | None) -> str:
    """A state as one line per quantity that Python reads back exactly."""
    return "\n".join(f"{name} = {values!r}" for name, values in (state or {}).items())
