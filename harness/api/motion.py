"""A motion over time as scripts and notebooks get it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.table import error_text, grouped

if TYPE_CHECKING:
    from harness.show.drawing import Drawing


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedMotion:
    """A computed motion at k + 1 times; ``harness.load(NAME).simulate`` makes it.

    Attributes:
        mechanism: what moves. times: (k + 1,) [s], from 0.
        q, v: (k + 1, nq) and (k + 1, nv); a rotation as (w, x, y, z), a free joint's linear velocity in the joint's frame.
        energy_drift: (k + 1,) energy gained without work, in the largest kinetic energy of the motion; None where it is not known: of
            a robot's file, which has no energies, and where the energies depend on time.
    """

    mechanism: Mechanism
    times: Array
    q: Array
    v: Array
    energy_drift: Array | None

    def plot(self) -> Drawing:
        """The positions over time, an axis for each unit.

        Examples:
            >>> import harness
            >>> motion = harness.load("cart_pendulum").simulate(q=[0.0, 0.5], v=[0.0, 0.0], seconds=5.0)
            >>> motion.plot().save("cart_pendulum.svg")
        """
        from harness.show.line_chart import draw_lines

        lines = zip(self._positions(), self.q.T, strict=True)
        panels = grouped((unit, (name, line)) for (name, unit), line in lines)
        return draw_lines(self.times, [(unit, dict(own)) for unit, own in panels.items()], "time [s]", f"motion of {self.mechanism.name}")

    def _positions(self) -> Iterator[tuple[str, str]]:
        """Name and unit of each column of q."""
        mechanism, place = self.mechanism, 0
        while place < mechanism.nv:
            if place in mechanism.attitudes:
                yield from ((f"{mechanism.joints[place]} {component}", "rotation") for component in "wxyz")
                place += 3
            else:
                yield mechanism.coordinates[place], "angle [rad]" if mechanism.rotating[place] else "position [m]"
                place += 1

    def __repr__(self) -> str:
        motion = f"{self.mechanism.name}: {self.times[-1]:g} s of motion at {len(self.times):,} times"
        if self.energy_drift is None:
            return motion
        return f"{motion}; energy drift at most {error_text(float(np.abs(self.energy_drift).max()))} of the largest kinetic energy"

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>{self.plot().svg}"
