"""Extent of what is told of a result: rows that matter by default, every row, or all that is known of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import TypeVar

# Rows with less than this share of the largest effect are counted instead.
LEAST_SHARE = 1e-3
_Row = TypeVar("_Row")


class Detail(IntEnum):
    """Extent of what a command tells; each level includes the one before."""

    BRIEF = 0
    ALL = 1
    VERBOSE = 2


def telling(rows: Sequence[_Row], effect: Callable[[_Row], float | None], detail: Detail = Detail.BRIEF) -> tuple[list[_Row], str]:
    """The rows with at least ``LEAST_SHARE`` of the largest effect, and words that count the others, "" where there are none.

    A row whose effect is None, which is not known, is kept. Above ``Detail.BRIEF`` all rows are.
    """
    effects = [effect(row) for row in rows]
    largest = max((abs(size) for size in effects if size is not None), default=0.0)
    if detail > Detail.BRIEF or not largest:
        return list(rows), ""
    kept = [row for row, size in zip(rows, effects, strict=True) if size is None or abs(size) >= LEAST_SHARE * largest]
    fewer = len(rows) - len(kept)
    return kept, f"{fewer} more below {LEAST_SHARE:g} of the largest (--all)" if fewer else ""
