"""The array types of the harness, float64 and integers of any shape, records of such arrays, and norms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Indices = np.ndarray[Any, np.dtype[np.int64]]
_NO_COLUMNS = np.empty((0, 0))


def no_columns() -> Array:
    """The default of an array that a record of ``Rows`` may do without."""
    return _NO_COLUMNS


@dataclass(frozen=True)
class Rows:
    """A record of arrays, and of such records, that have the same first axis; what nobody gives has no columns."""

    def __post_init__(self) -> None:
        for one in fields(self):
            if getattr(self, one.name) is _NO_COLUMNS:
                object.__setattr__(self, one.name, np.empty((len(self), 0)))

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def __getitem__(self, selection: Any) -> Self:
        """The rows that a slice or an index array selects."""
        return type(self)(*(getattr(self, field.name)[selection] for field in fields(self)))

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """The rows of all parts, in order."""
        columns = ([getattr(part, field.name) for part in parts] for field in fields(cls))
        return cls(*(own[0].concatenate(own) if isinstance(own[0], Rows) else np.concatenate(own) for own in columns))


def norm_over_first_axis(vectors: Array) -> Array:
    """Euclidean norms along axis 0, without overflow or underflow in the squares."""
    largest = np.abs(vectors).max(axis=0)
    divisor = np.where(largest > 0, largest, 1.0)
    return np.asarray(largest * np.sqrt(((vectors / divisor) ** 2).sum(axis=0)))
