"""Shares of the gap between two computed motions, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from harness.results.detail import Detail, telling
from harness.results.readings import share_text
from harness.results.run import StudyResult
from harness.results.table import Column, Table

DYNAMICS, INTEGRATOR, STEP = "dynamics", "integrator", "step length"


@dataclass(frozen=True, kw_only=True)
class Mover:
    """Program of a motion: ``steps`` steps of ``length`` [s] on the file at ``path``; ``readings`` are what its reader makes of that."""

    path: str
    engine: str
    integrator: str
    length: float
    steps: int
    readings: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        return f"{self.engine}/{self.integrator}, {self.steps} steps of {self.length:g} s, {self.path}"


@dataclass(frozen=True, kw_only=True)
class Share:
    """A share of the gap: of each half the part of the whole that lies along it, which all sum to 1, and its own size.

    Attributes:
        name: what causes it. positions, velocities: the parts. of_positions, of_velocities: sizes in the kinetic-energy norm.
        by_order: the largest that a part changes by with the order in which the causes are exchanged.
    """

    name: str
    positions: float
    velocities: float
    of_positions: float
    of_velocities: float
    by_order: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Gap:
    """The difference of two motions at their end.

    Attributes:
        of_positions, of_velocities: its size in the kinetic-energy norm; moved, speed: of how far the first moved, and how fast it is.
        start: q and v, by the joints of the first file.
    """

    first: Mover
    second: Mover
    start: dict[str, list[float]]
    of_positions: float
    of_velocities: float
    moved: float
    speed: float
    shares: tuple[Share, ...]

    def table(self, detail: Detail = Detail.BRIEF) -> tuple[Table, str]:
        """A row for each share that matters, and their sum; and words that count the others."""
        kept, others = telling(self.shares, lambda one: max(abs(one.positions), abs(one.velocities)), detail)
        rows = [(one.name, one.positions, one.velocities) for one in kept]
        rows.append(("all", sum(one.positions for one in self.shares), sum(one.velocities for one in self.shares)))
        cells = [[name, _percent(positions), _percent(velocities)] for name, positions, velocities in rows]
        return Table(["share", Column("of the gap in positions", "plain"), Column("in velocities", "plain")], cells), others

    @property
    def sentence(self) -> str:
        """Distance at which the two motions end, and the parts of the gap."""
        movers = (self.first, self.second)
        files, (one, other) = dict.fromkeys(mover.path for mover in movers), (f"{mover.engine}/{mover.integrator}" for mover in movers)
        parts = ((self.of_positions, self.moved, "positions"), (self.of_velocities, self.speed, "velocities"))
        sizes = [f"{share_text(size / whole if whole else None)} of the motion in {name}" for size, whole, name in parts]
        largest = sorted((share for share in self.shares if share.positions >= 0.01), key=lambda share: -share.positions)
        due = [f"the {share.name} ({share_text(share.positions)}{self._read if share.name == DYNAMICS else ''})" for share in largest]
        end = f"{one} and {other} end {' and '.join(sizes)} apart after {self.first.steps * self.first.length:g} s"
        return f"{' and '.join(files)}: {end}{'; in positions that is due to ' if due else ''}{' and '.join(due)}."

    @property
    def _read(self) -> str:
        """Readings of the files, behind the share that they have."""
        sentences = dict.fromkeys(reading for mover in (self.first, self.second) for reading in mover.readings)
        return f": {'; '.join(sentences)}" if sentences else ""

    @property
    def remarks(self) -> list[str]:
        """Sentences on what the table leaves out."""
        varying = max(self.shares, key=lambda one: one.by_order, default=None)
        if varying is None or varying.by_order <= 0.01:
            return []
        return [f"causes act together: the share of {varying.name} differs by up to {_percent(varying.by_order)} with their order"]


def _percent(part: float) -> str:
    """In percent, to a hundredth of one; what is less, and not nothing, to two digits."""
    return f"{100 * part:.2f} %" if not part or abs(part) >= 5e-5 else f"{100 * part:.1e} %"


@dataclass(kw_only=True)
class Gaps(StudyResult):
    """The gap that a run found."""

    STUDY: ClassVar[str] = "gap"

    gaps: list[Gap] = field(default_factory=list)

    @property
    def summary(self) -> str:
        return " ".join(gap.sentence for gap in self.gaps)
