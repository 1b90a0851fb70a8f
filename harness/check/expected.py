"""Verdicts that are expected to be other than ``agrees``: one file, each entry with its reason.

``expected_verdicts.toml`` of a library holds ``[[expected]]`` tables with ``system``, ``subject``,
``verdict``, ``reason``, ``link`` and ``backward_error``, the largest that the reason explains. An entry with
the verdict ``unsupported`` has no backward error, and excuses the subject's model where that is missing.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from harness.errors import InvalidInput
from harness.library import MODEL_SUFFIXES, Library, nearest
from harness.verdict import SEVERITY, Verdict

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
        if not (texts and all(isinstance(text, str) and text for text in texts)):
            raise InvalidInput(path, None, f"{where} must have the texts {', '.join(_TEXTS)}, none of them empty")
        for key, known in (("system", systems), ("subject", subjects), ("verdict", SEVERITY)):
            if entry[key] not in known:
                raise InvalidInput(path, None, f"{where} names {key} {entry[key]!r}, which does not exist; {nearest(entry[key], known)}")
        compared = entry["verdict"] != Verdict.UNSUPPORTED
        most = entry.get("backward_error") if compared else math.inf
        if set(entry) != {*_TEXTS, *(["backward_error"] if compared else [])} or type(most) not in (int, float):
            rest = "the number backward_error" if compared else f"no backward_error, for what is {Verdict.UNSUPPORTED} is not compared"
            raise InvalidInput(path, None, f"{where} must have exactly the texts {', '.join(_TEXTS)} and {rest}")
        pair = entry["system"], entry["subject"]
        if pair in expectations:
            raise InvalidInput(path, None, f"{where} repeats the pair {pair[0]}, {pair[1]}")
        expectations[pair] = Expectation(entry["verdict"], entry["reason"], entry["link"], float(most))
    return expectations


def why_no_model(
    library: Library, system: str, subject: str, model_format: str, expectations: Mapping[tuple[str, str], Expectation]
) -> str:
    """Why a subject has no model of a system to read: its entry's reason, where that says ``unsupported``.

    "" where the model exists, where ``model_format`` needs none, and where no entry excuses that it is missing.
    """
    expectation = expectations.get((system, subject), Expectation())
    if expectation.verdict != Verdict.UNSUPPORTED or model_format not in MODEL_SUFFIXES or library.has_model(system, model_format):
        return ""
    return expectation.reason
