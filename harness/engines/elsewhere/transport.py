"""Messages between the harness and the interpreter of an engine, as bytes that both can read.

Both have this package's sources, and may have different versions of NumPy, which do not read each other's pickles.
"""

from __future__ import annotations

import builtins
import contextlib
import io
import pickle
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from harness.errors import message_of


class Loaded(NamedTuple):
    """A model that stays in the interpreter of its engine: its number there, its plain attributes, and its methods."""

    number: int
    attributes: Mapping[str, Any]
    methods: Sequence[str]


def dumps(value: Any) -> bytes:
    """``value`` pickled, its arrays as plain bytes."""
    stream = io.BytesIO()
    _Pickler(stream, protocol=5).dump(value)
    return stream.getvalue()


def pickled(value: Any) -> bytes:
    """``value`` pickled, for a reader with this one's NumPy; ``loads`` reads both."""
    return pickle.dumps(value, protocol=5)


def loads(content: bytes) -> Any:
    """The value that ``dumps`` made ``content`` of."""
    return pickle.loads(content)


def portable(error: Exception) -> Exception:
    """An exception that the other side can read: a class of an engine becomes one of its name that derives from Python's own."""
    kind = type(error)
    if kind.__module__.partition(".")[0] == __name__.partition(".")[0] or kind.__module__ == builtins.__name__:
        with contextlib.suppress(Exception):
            loads(dumps(error))
            return error
    known = next(base for base in kind.__mro__ if base.__module__ == builtins.__name__)
    # The constructors of some take several arguments, as that of UnicodeDecodeError.
    made = known if known in (ValueError, TypeError, RuntimeError, MemoryError, ImportError, NotImplementedError) else RuntimeError
    return _raised(made, kind.__name__, message_of(error))


def _raised(base: type[Exception], name: str, message: str) -> Exception:
    found: Exception = type(name, (base,), {"__reduce__": lambda self: (_raised, (base, name, message))})(message)
    return found


class _Pickler(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
            return _array, (value.tobytes(), value.dtype.str, value.shape, isinstance(value, np.generic))
        return NotImplemented


def _array(content: bytes, kind: str, shape: tuple[int, ...], is_scalar: bool) -> Any:
    array = np.frombuffer(content, dtype=kind).reshape(shape).copy()
    return array[()] if is_scalar else array
