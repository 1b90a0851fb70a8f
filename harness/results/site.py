"""Data of the pages of a report, as one document: ``site.json``, with a JSON Schema.

JSON has no infinities: a number that is not finite is the text "inf", "-inf" or "nan".
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any, Literal

Number = float | Literal["inf", "-inf", "nan"] | None


def plain_number(value: float | None) -> Number:
    """A number as the JSON has it."""
    if value is None or math.isfinite(value):
        return value
    return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"


@dataclass(frozen=True, kw_only=True)
class SiteColumn:
    """A column of the matrix: an engine of one version with the format that it reads.

    Attributes:
        name: of the subject, as "mujoco/mjcf" or "mujoco@3.13.0/mjcf". title: of the engine, as its authors write it.
        version: "" where the run does not say it. page: its engine's page.
    """

    name: str
    engine: str
    title: str
    version: str
    format: str
    page: str


@dataclass(frozen=True, kw_only=True)
class SiteRow:
    """A row of the matrix.

    Attributes:
        kind: "mechanism", "variant" of a mechanism's models, or "robot". features: what it asks of an engine beyond hinges and slides.
    """

    name: str
    kind: str
    description: str
    features: list[str]
    page: str


@dataclass(frozen=True, kw_only=True)
class SiteCell:
    """One subject on one row; a pair without a cell was not asked.

    Attributes:
        verdict, expected: values of ``harness.verdict.Verdict``. outcome: what the cell says: the verdict, whether it is that of
            constraints that give, and of a robot whether the engine's documented reading of the file explains it.
        agrees: whether the answer is right; with constraints that give, right by the engine's documentation.
        is_robot: whether the row is a robot's file. tone: class of the style sheet.
        quantity: what was compared. features: what this subject's file of the row asks of it.
        backward_error: the worst [data roundoffs]; median_backward_error, relative_error, from_rigid, seconds_per_state: as of ``Record``.
        reading: what moves the accelerations most, of what the engine reads otherwise in the file, and by how much; "" for nothing.
        readings: names of all that it reads otherwise and moves them.
        reason, link: why another verdict than agreement is expected. message: what was said of it.
        diagnosis: lines. replay: shell command. reproducer: program that needs the engine alone; "" where there is none.
        page: where all of this is told.
    """

    row: str
    column: str
    verdict: str
    expected: str
    as_expected: bool
    outcome: str
    agrees: bool
    is_robot: bool
    tone: str
    quantity: str
    features: list[str]
    states: int
    backward_error: Number
    median_backward_error: Number
    relative_error: Number
    from_rigid: Number
    seconds_per_state: Number
    reading: str
    readings: list[str]
    reason: str
    link: str
    message: str
    diagnosis: list[str]
    replay: str
    reproducer: str
    page: str


@dataclass(frozen=True, kw_only=True)
class FeatureLine:
    """Verdicts of one subject on one feature, over all rows that have it.

    Attributes:
        asked: number of rows; agrees, unsupported: of them.
        worst: largest backward error of those that were compared [data roundoffs].
        from_rigid: median over the rows of how far constraints that give are from rigid ones; None where they do not give.
        line: the same in words.
    """

    feature: str
    column: str
    asked: int
    agrees: int
    unsupported: int
    worst: Number
    from_rigid: Number
    line: str


@dataclass(frozen=True, kw_only=True)
class Upstream:
    """An issue of an engine's own tracker.

    Attributes:
        state: "open", "closed" or "merged" on the day ``seen``, ISO 8601.
    """

    title: str
    link: str
    state: str
    seen: str


@dataclass(frozen=True, kw_only=True)
class SiteFinding:
    """Fault of an engine in one way of being asked.

    Attributes:
        way: the function and settings, the subject, or the version. rows: mechanisms on which it does, none for what is known beside
            them. row: of the statement and the reproducer. link: where the engine's source or tracker says so.
        reproducer: a program that needs the engine alone and prints its answer, and below it the certified one.
    """

    engine: str
    way: str
    row: str
    rows: list[str]
    statement: str
    backward_error: Number
    reproducer: str
    upstream: list[Upstream]
    link: str = ""


@dataclass(frozen=True, kw_only=True)
class SiteCount:
    """Number of cells of an engine's version that agree: of those where it gave an answer, ``unsupported`` ones aside; with its badge.

    Attributes:
        tone: class of the style sheet for its gravest cell. line: what was found of it, in a sentence.
    """

    engine: str
    title: str
    version: str
    agrees: int
    asked: int
    misreads: int
    unsupported: int
    tone: str
    line: str
    badge: str


@dataclass(frozen=True, kw_only=True)
class SiteChange:
    """A change point of a trend, as of ``harness.results.trend.ChangedCell``.

    Attributes:
        place: of the night that shows it. run: how many nights in a row, this one the last, had to show it.
        before: geometric mean of the nights since the change before; now: of the mildest night of the run. nights: how many were before.
        found_by: "jump" or "drift".
    """

    place: int
    run: int
    before: float
    now: float
    nights: int
    found_by: str


@dataclass(frozen=True, kw_only=True)
class SiteTrend:
    """A number of a subject on a mechanism over the nights of its study.

    Attributes:
        study: "cross-check" or "benchmark". column: a subject, with the quantity where that is not the accelerations, or a method.
        number: "median backward error", "99 % backward error", "worst backward error", or "cost" in units of a reference computation.
        values: one for each night of ``Site.nights``, oldest first; None for a night without the number.
    """

    study: str
    row: str
    column: str
    number: str
    values: list[Number]
    changes: list[SiteChange]


@dataclass(frozen=True, kw_only=True)
class ShownColumn:
    """A column of a table; ``kind`` and ``unit`` as of ``harness.results.table.Column``."""

    title: str
    kind: str
    unit: str


@dataclass(frozen=True, kw_only=True)
class ShownCell:
    """``value`` is what the column's kind writes; ``notes`` are lines below it."""

    value: float | int | str | None
    notes: list[str]


@dataclass(frozen=True, kw_only=True)
class ShownTable:
    """A table of a page: the element whose ``data-table`` is ``name``."""

    page: str
    name: str
    caption: str
    columns: list[ShownColumn]
    rows: list[list[ShownCell]]


@dataclass(frozen=True, kw_only=True)
class Site:
    """Everything that the pages tell.

    Attributes:
        run: what was run, as of ``harness.results.run.Run``; versions: distribution to version; limit: backward error up to which
            an answer agrees [data roundoffs].
        cells: of accelerations; quantities: of other quantities.
        nights: study to the starts of its runs over which numbers have trends, oldest first, ISO 8601. trends: none of a single run.
        tables: every table of every page, with its numbers in full.
    """

    run: dict[str, str | int]
    versions: dict[str, str]
    limit: float
    columns: list[SiteColumn] = field(default_factory=list)
    rows: list[SiteRow] = field(default_factory=list)
    cells: list[SiteCell] = field(default_factory=list)
    counts: list[SiteCount] = field(default_factory=list)
    features: list[FeatureLine] = field(default_factory=list)
    findings: list[SiteFinding] = field(default_factory=list)
    quantities: list[SiteCell] = field(default_factory=list)
    nights: dict[str, list[str]] = field(default_factory=dict)
    trends: list[SiteTrend] = field(default_factory=list)
    tables: list[ShownTable] = field(default_factory=list)


def schema() -> str:
    """The JSON Schema of ``site.json``, draft 2020-12."""
    import msgspec

    document: dict[str, Any] = {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(Site)}
    return json.dumps(document, indent=2, sort_keys=True) + "\n"
