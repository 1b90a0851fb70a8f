"""Verdicts that are expected to be other than ``agrees``: one file, each entry with its reason.

``expected_verdicts.toml`` of a library holds ``[[expected]]`` tables with ``system``, ``subject``,
``verdict``, ``reason``, ``link`` and ``backward_error``, the largest that the reason explains.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from harness.errors import InvalidInput
from harness.library import Library, nearest
from harness.verdict import GRAVITY

_TEXTS = ("system", "subject", "verdict", "reason", "link")


@dataclass(frozen=True)
class Expectation:
    """One entry of the file; a verdict holds up to ``backward_error``, so that a fault still shows beside it."""

    verdict: str = "agrees"
    reason: str = ""
    link: str = ""
    backward_error: float = math.inf


def load_expectations(library: Library, subjects: Collection[str]) -> Mapping[tuple[str, str], Expectation]:
    """Expectations by (system, subject); a pair without an entry is expected to agree.

    Raises:
        InvalidInput: the file is malformed, or an entry names a system or subject that does not exist
            any more.
    """
    path = library.expected_verdicts
    if not path.is_file():
        return {}
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidInput(path, None, f"cannot be read as TOML: {error}") from error
    systems = library.system_names()
    expectations: dict[tuple[str, str], Expectation] = {}
    entries = data.pop("expected", [])
    if data or not isinstance(entries, list):
        raise InvalidInput(path, None, "holds something other than [[expected]] tables")
    for number, entry in enumerate(entries, start=1):
        where = f"[[expected]] number {number}"
        texts = [entry.get(key) for key in _TEXTS] if isinstance(entry, dict) else []
        most = entry.get("backward_error") if isinstance(entry, dict) else None
        if not (texts and all(isinstance(text, str) and text for text in texts) and isinstance(most, int | float) and len(entry) == 6):
            raise InvalidInput(path, None, f"{where} must have exactly the texts {', '.join(_TEXTS)} and the number backward_error")
        for key, known in (("system", systems), ("subject", subjects), ("verdict", GRAVITY)):
            if entry[key] not in known:
                raise InvalidInput(path, None, f"{where} names {key} {entry[key]!r}, which does not exist; {nearest(entry[key], known)}")
        pair = entry["system"], entry["subject"]
        if pair in expectations:
            raise InvalidInput(path, None, f"{where} repeats the pair {pair[0]}, {pair[1]}")
        expectations[pair] = Expectation(entry["verdict"], entry["reason"], entry["link"], float(most))
    return expectations
