"""The results of planted faults, and the bars that all of them together must meet."""

from __future__ import annotations

import itertools
import math
import operator
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

from harness.diagnosis.faults.reader import MOST_ABOVE_THEORY
from harness.files.text.scan import TextPlace
from harness.results.run import StudyResult

# Share of the faults that a diagnosis names first, or in its class.
MUST_BE_NAMED = 0.95


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One planted mistake and its result.

    Attributes:
        system, format, kind, statement: what was planted; where: (line, element, attribute) of its places.
        sizes: those it was planted in, () for a mistake without sizes; missed: sizes that must be caught and were not.
        live: true where it moves any acceleration, or is refused. order: 2 where a small one moves them by its square only.
        caught_by: "" for nothing, "validator", "reader", "audit" or "check".
        smallest, theory: least size that the check catches, and the same by theory; None for a mistake without sizes.
        blamed: a party that the pattern of agreement blames although it is sound; "" for none. blamed_at: in that size.
        cleared: a party that the pattern would blame, had no change of the file explained what it answers.
        diagnosed: the size at which it was diagnosed; None where it was not. named, in_class: true where the diagnosis names one of
            the places first, or among those that explain as well. answer: its first line. seconds: it took.
        known: false where no diagnosis looks for a mistake of this kind. explained: true where a diagnosis holds some
            change for the cause. right_value: whether the change that it names first gives the right number; None where none is
            named. stopped: whether it used up its evaluations.
    """

    system: str
    format: str
    kind: str
    statement: str
    where: tuple[tuple[int, str, str], ...]
    sizes: tuple[float, ...] = ()
    missed: tuple[float, ...] = ()
    live: bool = True
    order: int = 1
    caught_by: str = ""
    smallest: float | None = None
    theory: float | None = None
    blamed: str = ""
    blamed_at: float | None = None
    cleared: str = ""
    diagnosed: float | None = None
    named: bool = False
    in_class: bool = False
    answer: str = ""
    seconds: float = 0.0
    known: bool = True
    explained: bool = False
    right_value: bool | None = None
    stopped: bool = False

    @property
    def misled(self) -> bool:
        """True where a diagnosis holds changes for the cause of which none is at a place of the mistake."""
        return self.live and self.explained and not (self.named or self.in_class)

    @property
    def judged(self) -> bool:
        """True where its place was named by a refusal, or asked of a diagnosis."""
        return self.live and (self.named or self.diagnosed is not None)

    @property
    def as_in_theory(self) -> bool:
        """False where the smallest size caught is beyond ``MOST_ABOVE_THEORY`` times theory; True without sizes."""
        return self.smallest is None or self.theory is None or self.smallest <= MOST_ABOVE_THEORY * self.theory

    @property
    def caught(self) -> bool:
        """True where it is caught in every size in which it must be; theory promises nothing of sizes that are all too small for it."""
        too_small = bool(self.sizes) and self.theory is not None and max(self.sizes) < MOST_ABOVE_THEORY * self.theory < math.inf
        return not self.missed and (bool(self.caught_by) or too_small)

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


@dataclass(kw_only=True)
class Campaign(StudyResult):
    """Findings of a campaign; ``deaths`` has a sentence for each model whose process died."""

    STUDY: ClassVar[str] = "campaign"

    faults: list[Fault] = field(default_factory=list)
    deaths: list[str] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class KindOfFault:
    """All faults of one kind.

    Attributes:
        kind: its name. planted: mistakes made; live: those that change the dynamics; caught: of these.
        judged: live ones that were diagnosed or refused by name; named, in_class: of these. known: whether the diagnosis knows the kind.
        diagnosed: live ones that were; found, found_in_class: of these, named first, and first or among those that explain as well.
        right: of those named first, with the right number. misled: diagnosed ones explained by changes elsewhere. stopped: diagnoses
            that used up their evaluations.
        blamed: live ones for which somebody sound is blamed.
        smallest, theory: medians of the least sizes caught and of those by theory, of faults of first order; None without sizes.
        seconds: median of the diagnoses [s]; longest: the longest [s].
    """

    kind: str
    planted: int
    live: int
    caught: int
    judged: int
    named: int
    in_class: int
    blamed: int
    smallest: float | None
    theory: float | None
    seconds: float | None
    longest: float | None
    known: bool
    diagnosed: int
    found: int
    found_in_class: int
    right: int
    misled: int
    stopped: int


@dataclass(frozen=True, kw_only=True)
class SmallestChange:
    """A number of a model file that accelerations depend on, and the smallest relative change of it that is caught.

    Attributes:
        place, value: of the number; statement: what changes with it where physics forbids it to change alone, "" for nothing.
        smallest: relative change; inf where none up to ``FURTHEST`` times theory is caught.
        theory: the same from data roundoff and the number's derivative.
    """

    system: str
    subject: str
    file: str
    place: TextPlace
    statement: str
    value: float
    smallest: float
    theory: float

    @property
    def ratio(self) -> float:
        """Ratio of the change that is caught to that of theory."""
        return self.smallest / self.theory

    @property
    def as_in_theory(self) -> bool:
        """True for a ratio of at most ``MOST_ABOVE_THEORY``."""
        return self.ratio <= MOST_ABOVE_THEORY

    @property
    def number(self) -> str:
        """Element and attribute, the place in the attribute, and what changes with it."""
        place = self.place
        index = f"[{place.index}]" if place.index else ""
        return f"{f'{place.element} {place.attribute}'.strip()}{index} {self.statement}".rstrip()

    def as_json(self) -> dict[str, Any]:
        """Plain data: the place of the number, its value, and both changes."""
        about = asdict(self)
        return {**about.pop("place"), **about}


# What is counted of a kind: of which other count it is a part, and which faults of that.
_PARTS: dict[str, tuple[str, Callable[[Fault], object]]] = {
    "live": ("planted", lambda one: one.live),
    "judged": ("live", lambda one: one.judged),
    "diagnosed": ("judged", lambda one: one.diagnosed is not None),
    "caught": ("live", lambda one: one.caught),
    "named": ("judged", lambda one: one.named),
    "in_class": ("judged", lambda one: one.named or one.in_class),
    "found": ("diagnosed", lambda one: one.named),
    "found_in_class": ("diagnosed", lambda one: one.named or one.in_class),
    "right": ("found", lambda one: one.right_value),
    "misled": ("diagnosed", lambda one: one.misled),
    "stopped": ("diagnosed", lambda one: one.stopped),
    "blamed": ("live", lambda one: one.blamed),
}
# The counts that ``shares`` gives, and the parts of which it gives a share.
_COUNTS = ("planted", *(name for name in _PARTS if name != "blamed"))
_SHARES = _COUNTS[_COUNTS.index("caught") :]


def by_kind(faults: Iterable[Fault]) -> list[KindOfFault]:
    """The faults kind by kind, kinds in alphabetical order."""
    kind = operator.attrgetter("kind")
    return [_kind(name, list(own)) for name, own in itertools.groupby(sorted(faults, key=kind), key=kind)]


def _kind(kind: str, faults: Sequence[Fault]) -> KindOfFault:
    parts = {"planted": faults}
    for name, (whole, is_part) in _PARTS.items():
        parts[name] = [fault for fault in parts[whole] if is_part(fault)]
    sized = [(one.smallest, one.theory) for one in parts["live"] if one.smallest is not None and one.theory is not None and one.order == 1]
    smallest, theory = (statistics.median(sizes) for sizes in zip(*sized, strict=True)) if sized else (None, None)
    seconds = [fault.seconds for fault in parts["diagnosed"]]
    counts: dict[str, Any] = {name: len(own) for name, own in parts.items()}
    return KindOfFault(
        kind=kind,
        **counts,
        smallest=smallest,
        theory=theory,
        seconds=statistics.median(seconds) if seconds else None,
        longest=max(seconds, default=None),
        known=all(fault.known for fault in faults),
    )


def shares(kinds: Sequence[KindOfFault]) -> dict[str, dict[str, float | int]]:
    """Counts and shares of what was diagnosed of the kinds that the diagnosis knows, and of the others, "known" and "unknown".

    "named" and "in_class" count refusals by name; "found" and "found_in_class" are without them. A share of nothing is left out.
    """
    found: dict[str, dict[str, float | int]] = {}
    for name, known in (("known", True), ("unknown", False)):
        of_all = {part: sum(getattr(kind, part) for kind in kinds if kind.known == known) for part in _COUNTS}
        if of_all["live"]:
            wholes = {part: of_all[_PARTS[part][0]] for part in _SHARES}
            found[name] = {**of_all, **{f"share_{part}": of_all[part] / whole for part, whole in wholes.items() if whole}}
    return found


def broken_bars(faults: Sequence[Fault]) -> list[str]:
    """The bars that a campaign breaks, one sentence each."""
    every, known = _kind("", faults), _kind("", [fault for fault in faults if fault.known])
    missed, above = every.live - every.caught, sum(not fault.as_in_theory for fault in faults if fault.live)
    in_class = f"{known.in_class} of {known.judged} diagnosed faults were named first or in their class"
    bars = [
        (missed, f"{missed} of {every.live} faults that change the dynamics were not caught"),
        (every.blamed, f"{every.blamed} faults were blamed on somebody sound"),
        (above, f"{above} numbers are caught only beyond {MOST_ABOVE_THEORY:g} times what theory promises"),
        (known.in_class < MUST_BE_NAMED * known.judged, f"{in_class}, fewer than {MUST_BE_NAMED:.0%}"),
    ]
    return [sentence for broken, sentence in bars if broken]
