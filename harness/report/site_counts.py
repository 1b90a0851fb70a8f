"""Sums over the cells of a site: addresses, counts of each engine with its line and its badge, and lines on features."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from statistics import median

from harness.results.engine_lines import TIES, EngineOutcome, engine_line
from harness.results.site import FeatureLine, Number, SiteCell, SiteColumn, SiteCount, plain_number
from harness.results.table import error_text
from harness.verdict import DEPARTS, GIVES, SEVERITY, Verdict


def slugs(names: Iterable[str]) -> dict[str, str]:
    """A word for each name that a file, an address and an ``id`` may hold, no two alike, whatever a file system makes of case."""
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_.@]+", "-", name).strip(".") or "-"
        number, word = 2, plain
        while word.casefold() in taken:
            number, word = number + 1, f"{plain}-{number}"
        taken.add(word.casefold())
        found[name] = word
    return found


def pages_in(folder: str, names: Iterable[str]) -> dict[str, str]:
    """The page of each name in a folder."""
    return {name: f"{folder}/{word}.html" for name, word in slugs(names).items()}


def engine_counts(columns: Sequence[SiteColumn], cells: Sequence[SiteCell]) -> Iterator[SiteCount]:
    """Counts of each engine and version, over its formats."""
    versions = {(column.engine, column.version): "-".join(filter(None, (column.engine, column.version))) for column in columns}
    titles = {column.engine: column.title for column in columns}
    badges = slugs(versions[one] for one in sorted(versions))
    for (engine, version), name in sorted(versions.items()):
        own = {column.name for column in columns if (column.engine, column.version) == (engine, version)}
        formats = {column.name: column.format for column in columns}
        verdicts = [cell for cell in cells if cell.column in own]
        unsupported = sum(cell.verdict == Verdict.UNSUPPORTED for cell in verdicts)
        yield SiteCount(
            engine=engine,
            title=titles[engine],
            version=version,
            agrees=sum(cell.agrees for cell in verdicts),
            asked=len(verdicts) - unsupported,
            misreads=sum(cell.tone == Verdict.MISREADS for cell in verdicts),
            unsupported=unsupported,
            tone=gravest_tone(cell for cell in verdicts if cell.verdict != Verdict.UNSUPPORTED),
            line=engine_line(_answer(cell, formats[cell.column]) for cell in verdicts),
            badge=f"badges/{badges[name]}.svg",
        )


def badge_text(count: SiteCount) -> str:
    """ "111 of 115 agree, 4 misread"."""
    return f"{count.agrees} of {count.asked} agree" + (f", {count.misreads} misread" if count.misreads else "")


def _answer(cell: SiteCell, model_format: str) -> EngineOutcome:
    return EngineOutcome(
        name=cell.row,
        format=model_format,
        outcome=cell.outcome if cell.is_robot or cell.outcome == DEPARTS else cell.verdict,
        is_robot=cell.is_robot,
        readings=cell.readings,
        features=cell.features,
        from_rigid=value_of(cell.from_rigid),
    )


def gravest_tone(cells: Iterable[SiteCell]) -> str:
    """The looks of the gravest of the cells; of constraints that give they lie between agreement and all else."""
    return max((cell.tone for cell in cells), key=lambda tone: SEVERITY.get(tone, 0.5), default="")


def feature_lines(columns: Sequence[SiteColumn], cells: Sequence[SiteCell]) -> Iterator[FeatureLine]:
    """By feature, then by column."""
    for feature in sorted({name for cell in cells for name in asked_of(cell)}):
        for column in columns:
            own = [cell for cell in cells if cell.column == column.name and feature in asked_of(cell)]
            if own:
                yield _feature_line(feature, column.name, own)


def asked_of(cell: SiteCell) -> list[str]:
    """The features of a cell; of another quantity than accelerations that quantity alone."""
    return cell.features if cell.quantity == "accelerations" else [cell.quantity]


def _feature_line(feature: str, column: str, cells: Sequence[SiteCell]) -> FeatureLine:
    agrees = sum(cell.agrees for cell in cells)
    unsupported = sum(cell.verdict == Verdict.UNSUPPORTED for cell in cells)
    distances = [float(cell.from_rigid) for cell in cells if cell.from_rigid is not None and feature in TIES]
    worst, soft = largest(cell.backward_error for cell in cells), median(distances) if distances else None
    others = {verdict: sum(cell.verdict == verdict for cell in cells) for verdict in SEVERITY if verdict != Verdict.AGREES}
    parts = [f"soft, {soft:.1e} from rigid at the file's settings"] if soft is not None and soft > GIVES else []
    if agrees:
        what = "agrees with what its engine documents" if parts else "agrees"
        parts.append(f"{what} on {agrees} of {len(cells)}, worst {error_text(worst)}")
    parts += [f"{verdict} on {count} of {len(cells)}" for verdict, count in others.items() if count]
    reasons = list(dict.fromkeys(cell.reason for cell in cells if not cell.agrees and cell.reason))
    line = "; ".join(parts) + (f": {reasons[0]}" if len(reasons) == 1 else "")
    return FeatureLine(
        feature=feature, column=column, asked=len(cells), agrees=agrees, unsupported=unsupported, worst=plain_number(worst),
        from_rigid=plain_number(soft), line=line,
    )  # fmt: skip


def largest(errors: Iterable[Number]) -> float | None:
    """The largest that there is, NaN counting as infinite; None of none."""
    known = [float(error) for error in errors if error is not None]
    return max((math.inf if math.isnan(error) else error for error in known), default=None)


def value_of(number: Number) -> float | None:
    """The number that the data hold as text where it is not finite."""
    return None if number is None else float(number)


def error_of(number: Number) -> str:
    """Three digits; "nan" and "inf" as they are."""
    return number if isinstance(number, str) else error_text(number)
