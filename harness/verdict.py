"""The verdicts of a comparison, and the backward error up to which answers agree."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

# Largest backward error that agrees [units of data roundoff]: one number for every engine and system.
AGREEMENT = 64.0
# Relative distance from rigid constraints beyond which they give; less is rounding.
GIVES = 1e-12
# An answer that agrees with constraints that give, by the engine's documentation; and its class of the style sheet.
SOFT, DECLARED = "soft, as documented", "declared"
# An answer that is explained by where the engine's program leaves its own documentation.
DEPARTS = "departs from its documentation"


class Verdict(StrEnum):
    """The result of a comparison; in ascending order of severity.

    ``EXPLAINED`` is an answer on a user's file that is no agreement with the file, and is one with what the engine's readings make of it;
    or one by a law of constraints as the engine's program has it, where that departs from the documented one.
    ``MISREADS`` is a difference whose cause is known: the engine's reader accepts the file and makes something else of it, as one of its
    declared readings says. ``UNSUPPORTED`` is what the engine itself says that it cannot do.
    """

    AGREES = "agrees"
    EXPLAINED = "explained"
    UNDECIDED = "undecided"
    UNSUPPORTED = "unsupported"
    UNSTABLE = "unstable"
    MISREADS = "misreads"
    DISAGREES = "disagrees"
    ERROR = "error"


# Verdicts on an answer that is as right as it can be.
SOUND = (Verdict.AGREES, Verdict.EXPLAINED)
SEVERITY = {verdict.value: rank for rank, verdict in enumerate(Verdict)}


def is_soft(verdict: str, from_rigid: float | str | None) -> bool:
    """True where an answer is right by what its engine documents of constraints that give, at this distance from rigid ones."""
    return verdict == Verdict.AGREES and from_rigid is not None and float(from_rigid) > GIVES


def gravest(verdicts: Iterable[str]) -> str:
    """The gravest of ``verdicts``; "agrees" for none."""
    return max(verdicts, key=SEVERITY.__getitem__, default=Verdict.AGREES.value)
