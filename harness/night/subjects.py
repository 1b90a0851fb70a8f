"""The subjects of a night: every installed one, and those of the engines that are asked beside them."""

from __future__ import annotations

from collections.abc import Sequence

from harness.engines import select_subjects, subjects
from harness.errors import InvalidRequest
from harness.library import Library, nearest


def subjects_of(library: Library, engines: Sequence[str]) -> list[str]:
    """Names of the subjects; none, which means all, where no engine was asked for.

    Raises:
        InvalidRequest: no subject is of such an engine.
    """
    if not engines:
        return []
    chosen = [str(subject) for subject in select_subjects(library, ())]
    known = [str(subject) for subject in subjects(library)]
    for engine in engines:
        own = [name for name in known if name.partition("/")[0] == engine]
        if not own:
            names = sorted({name.partition("/")[0] for name in known})
            raise InvalidRequest(f"no engine is called {engine!r}; {nearest(engine, names)}; harness list has those that are there")
        chosen += own
    return list(dict.fromkeys(chosen))
