"""Answers of each engine's version, and of each subject to each feature of a model, counted from the cells of the site."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from statistics import median

from harness.report.addresses import slugs
from harness.results.site import FeatureLine, SiteCell, SiteColumn, SiteCount, plain_number
from harness.results.table import error_text
from harness.verdict import SEVERITY, Verdict

# Features by which constraints give, and a distance from rigid ones that is no rounding.
_TIES, _SOFT = ("loops", "coupled joints", "coupled tendons", "mimic joints", "rolling"), 1e-12


def engine_counts(columns: Sequence[SiteColumn], cells: Sequence[SiteCell]) -> Iterator[SiteCount]:
    """Counts of each engine and version, over its formats."""
    versions = sorted({(column.engine, column.version) for column in columns})
    badges = slugs(f"{engine}-{version}".removesuffix("-") for engine, version in versions)
    for engine, version in versions:
        own = {column.name for column in columns if (column.engine, column.version) == (engine, version)}
        verdicts = [cell for cell in cells if cell.column in own]
        unsupported = sum(cell.verdict == Verdict.UNSUPPORTED for cell in verdicts)
        badge = f"badges/{badges[f'{engine}-{version}'.removesuffix('-')]}.svg"
        agrees = sum(cell.agrees for cell in verdicts)
        asked = len(verdicts) - unsupported
        yield SiteCount(engine=engine, version=version, agrees=agrees, asked=asked, unsupported=unsupported, badge=badge)


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
    errors = [float(cell.backward_error) for cell in cells if cell.backward_error is not None]
    distances = [float(cell.from_rigid) for cell in cells if cell.from_rigid is not None and feature in _TIES]
    worst, soft = largest(errors), median(distances) if distances else None
    others = {verdict: sum(cell.verdict == verdict for cell in cells) for verdict in SEVERITY if verdict != Verdict.AGREES}
    parts = [f"soft, {soft:.1e} from rigid at the file's settings"] if soft is not None and soft > _SOFT else []
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


def largest(errors: Iterable[float]) -> float | None:
    """The largest, NaN counting as infinite; None of none."""
    return max((math.inf if math.isnan(error) else error for error in errors), default=None)
