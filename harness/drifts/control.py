"""Controls of actuators from a table: CSV, npz or Parquet, a column for the time and one for each actuator; or from a policy in ONNX."""

from __future__ import annotations

import csv
import importlib
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.drifts.policy import OnnxPolicy
from harness.engines.moving import Control
from harness.errors import InvalidRequest

TIME = "time"


def read_control(path: Path) -> Control:
    """The controls of a table, whose column ``time`` [s] increases, and the others are called as actuators are; or those of a policy.

    Raises:
        InvalidRequest: there is no such file, or it is none.
    """
    if path.suffix.lower() == ".onnx":
        return Control.calling(OnnxPolicy(path))
    names, times, values = read_table(path, "controls, or a policy, .onnx", "actuator")
    return Control(names, times, values)


def is_table(path: Path) -> bool:
    """True for a file that is a table by its name."""
    return path.suffix.lower() in _READERS


def read_table(path: Path, noun: str, of: str) -> tuple[tuple[str, ...], Array, Array]:
    """Names of columns, times (n,) [s], and values (n, names) of a table of ``noun``, with a column for each ``of``.

    Raises:
        InvalidRequest: there is no such file, or it is none.
    """
    if not is_table(path):
        kind, _, further = noun.partition(",")
        raise InvalidRequest(f"{path}: expected a table of {kind}, {', '.join(_READERS)}{',' * bool(further)}{further}")
    noun = noun.partition(",")[0]
    try:
        columns = _READERS[path.suffix.lower()](path)
    except FileNotFoundError as error:
        raise InvalidRequest(f"{path}: there is no such table of {noun}") from error
    except InvalidRequest:
        raise
    except Exception as error:
        # What libraries raise of a file that is damaged is of many kinds.
        raise InvalidRequest(f"{path}: cannot be read as a table of numbers: {error}") from error
    if TIME not in columns or len(columns) < 2:
        raise InvalidRequest(f"{path} has the columns {', '.join(columns) or 'none'}; expected {TIME} and one for each {of}")
    times = columns.pop(TIME)
    if times.ndim == 1 and not len(times):
        raise InvalidRequest(f"{path} has no row; expected one for each time")
    if times.ndim != 1 or any(column.shape != times.shape for column in columns.values()):
        raise InvalidRequest(f"{path} has columns of several lengths; expected one number in each for each time")
    if not all(np.isfinite(column).all() for column in (times, *columns.values())):
        raise InvalidRequest(f"{path} holds a number that is not finite")
    if (np.diff(times) <= 0).any():
        row = int(np.argmax(np.diff(times) <= 0)) + 2
        raise InvalidRequest(f"{path}: the time of row {row} is not later than that before it; sort the rows")
    return tuple(columns), times, np.column_stack(list(columns.values()))


def _csv(path: Path) -> dict[str, Array]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        header, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row] or [[]]
    if len(header) == 1 and (other := next((sign for sign in ";\t|" if sign in header[0]), "")):
        raise ValueError(f"the header has no comma, but {other!r}; expected columns apart by commas, and points in numbers")
    if twice := next((name for name in header if header.count(name) > 1), ""):
        raise ValueError(f"two columns are called {twice!r}; leave out one")
    if any(len(row) != len(header) for row in rows):
        raise ValueError(f"a row has another number of cells than the header, which has {len(header)}")
    values = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    return dict(zip(header, values.T, strict=True))


def _npz(path: Path) -> dict[str, Array]:
    with np.load(path, allow_pickle=False) as file:
        return {name: _real(name, file[name]) for name in file.files}


def _parquet(path: Path) -> dict[str, Array]:
    try:
        parquet = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise InvalidRequest(f"{path}: Parquet is read by pyarrow, which is not installed; install it, or write a CSV") from error
    table = parquet.read_table(path)
    return {name: _real(name, table[name].to_numpy()) for name in table.column_names}


def _real(name: str, values: Any) -> Array:
    if np.iscomplexobj(values):
        raise ValueError(f"column {name!r} holds complex numbers")
    return np.asarray(values, dtype=np.float64)


# By what names of files end in.
_READERS = {".csv": _csv, ".npz": _npz, ".parquet": _parquet}
