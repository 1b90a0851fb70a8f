"""The first of several versions that changed something."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

_Answer = TypeVar("_Answer")


def first_changed(
    versions: Sequence[str], ask: Callable[[str], _Answer], changed: Callable[[_Answer, _Answer], bool]
) -> tuple[str, str] | None:
    """The neighbours between which the answer leaves that of the first version; None where the last version has it too.

    ``versions`` go from the oldest to the newest, and are asked as often as a bisection needs, each once. Where the answer changes
    several times, one of the changes is found.
    """
    first = ask(versions[0])
    if not changed(first, ask(versions[-1])):
        return None
    same, other = 0, len(versions) - 1
    while other - same > 1:
        middle = (same + other) // 2
        if changed(first, ask(versions[middle])):
            other = middle
        else:
            same = middle
    return versions[same], versions[other]
