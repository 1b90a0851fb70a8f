"""Plain data back into the dataclasses it was written from: the inverse of ``dataclasses.asdict`` and ``harness.results.records.dumps``."""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

_Class = TypeVar("_Class")


def restored(kind: type[_Class], data: Mapping[str, Any]) -> _Class:
    """An instance of the dataclass ``kind`` from what JSON holds of it.

    Fields that are absent take their defaults, so that older data stays readable. "inf", "-inf" and "nan"
    become numbers where the annotation of a field says float.

    Raises:
        TypeError, ValueError, AttributeError: ``data`` is not from an instance of ``kind``.
    """
    hints = _hints(typing.cast("Any", kind))
    return kind(**{name: _value(hints.get(name, Any), value) for name, value in data.items()})


@functools.cache
def _hints(kind: Any) -> dict[str, Any]:
    if not dataclasses.is_dataclass(kind):
        raise TypeError(f"{kind.__name__} is no dataclass")
    return typing.get_type_hints(kind)


def _value(hint: Any, value: Any) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        [hint] = [argument for argument in arguments if argument is not type(None)]
        return None if value is None else _value(hint, value)
    if origin is list:
        return [_value(arguments[0], item) for item in value]
    if origin is dict:
        return {key: _value(arguments[1], item) for key, item in value.items()}
    if dataclasses.is_dataclass(hint):
        return restored(typing.cast("type[Any]", hint), value)
    return float(value) if hint is float else value
