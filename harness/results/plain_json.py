"""Strict JSON of plain data: it has no infinities, so that a number that is not finite is the string "inf", "-inf" or "nan"."""

from __future__ import annotations

import json
import math
import numbers
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any


def dumps(value: Any, indent: int | None = None) -> str:
    """Strict JSON of plain data and dataclasses of it; numbers that are not finite become "inf", "-inf" or "nan"."""
    return json.dumps(_plain(value), indent=indent, allow_nan=False)


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {part.name: _plain(getattr(value, part.name)) for part in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, bool | str) or value is None:
        return value
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        number = float(value)
        return number if math.isfinite(number) else str(number)
    raise TypeError(f"{value!r} is of type {type(value).__name__}, which has no place in a record")
