"""Distances of motions with contacts from rigid ones: plain data, their laws of growth, and who breaks first."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

from harness.results.table import Column, grouped

# Of the scale of a case: an engine that is further from rigid has broken.
BROKEN = 0.1
# Values that a law is fitted to, at least, the distance that is not told from none, and the share of the largest where growth ends.
FEWEST_FITTED, NONE, GROWN = 3, 1e-9, 0.9


@dataclass(frozen=True, kw_only=True)
class RigidDistance:
    """One number of a motion with contacts, beside those of rigid motions.

    Attributes:
        case, system, engine, setting: names; the setting is how contacts of the engine were asked for.
        knob, unit: what is turned; value: of it. measured, measured_unit: the number.
        gentle_first: whether values of the case come in the order from gentle to hard.
        rigid: intervals in which rigid motions have it; none where no rigid motion is consistent.
        found: by the engine; None where it gives none. distance: to the nearest interval, relative to the scale of the case.
        reason: why there is no number. is_refused: whether that is that the engine was not asked for it.
    """

    case: Annotated[str, Column("mechanism")]
    system: str
    engine: Annotated[str, Column("engine")]
    setting: Annotated[str, Column("contacts")]
    knob: str
    unit: str
    value: float
    measured: str
    measured_unit: str
    rigid: list[tuple[float, float]]
    found: Annotated[float | None, Column("found", "given")]
    distance: Annotated[float | None, Column("distance from rigid", "error")]
    reason: str = ""
    gentle_first: bool = False
    is_refused: bool = False

    @property
    def at(self) -> Annotated[str, Column("at")]:
        """The knob with its value."""
        return f"{self.knob} {self.value:g}{_unit(self.unit)}"

    @property
    def number(self) -> Annotated[str, Column("measured")]:
        """The measured number with its unit."""
        return f"{self.measured}{f' [{self.measured_unit}]' if self.measured_unit != '1' else ''}"

    @property
    def answers(self) -> Annotated[str, Column("rigid")]:
        """All rigid answers."""
        told = [f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}" for low, high in self.rigid]
        return " or ".join(told) or "none is consistent"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


@dataclass(frozen=True, kw_only=True)
class RigidLaw:
    """The distances of one engine and setting along a case whose values go from gentle to hard.

    Attributes:
        case, engine, setting, knob, unit: as of ``RigidDistance``.
        growth: slope of log distance over log knob, up to where the distance grows no more; None for fewer values than ``FEWEST_FITTED``.
        largest: distance along the case.
        breaks: the first value with a distance of more than ``BROKEN``, or without a number; None where none is.
        step: the place of that value in the case, its number of values where none is.
    """

    case: Annotated[str, Column("mechanism")]
    engine: Annotated[str, Column("engine")]
    setting: Annotated[str, Column("contacts")]
    knob: Annotated[str, Column("over")]
    unit: str
    growth: Annotated[float | None, Column("slope", "rounded")]
    largest: Annotated[float | None, Column("largest distance from rigid", "error")]
    breaks: float | None
    step: int

    @property
    def breaking(self) -> Annotated[str, Column("10 % from rigid at")]:
        """The value that breaks it."""
        return "none" if self.breaks is None else f"{self.breaks:g}{_unit(self.unit)}"


def rigid_laws(distances: Iterable[RigidDistance]) -> list[RigidLaw]:
    """One law for each case whose values go from gentle to hard, engine and setting, in the order of the distances."""
    graded = grouped(
        ((one.case, one.engine, one.setting), one) for one in distances if one.gentle_first and one.rigid and not one.is_refused
    )
    return [_law(own) for own in graded.values()]


def _law(found: Sequence[RigidDistance]) -> RigidLaw:
    broken = [one.distance is None or one.distance > BROKEN for one in found]
    step = broken.index(True) if any(broken) else len(found)
    # A knob at zero, and a distance without an end, have no place on logarithmic axes.
    numbers = ((one.value, one.distance) for one in found if one.distance is not None)
    measured = [(value, distance) for value, distance in numbers if 0 < value < math.inf and NONE < distance < math.inf]
    largest = max((distance for _, distance in measured), default=0.0)
    grown = next((place for place, (_, distance) in enumerate(measured) if distance >= GROWN * largest), 0)
    fitted = [(math.log(value), math.log(distance)) for value, distance in measured[: grown + 1]]
    first = found[0]
    return RigidLaw(
        case=first.case,
        engine=first.engine,
        setting=first.setting,
        knob=first.knob,
        unit=first.unit,
        growth=statistics.linear_regression(*zip(*fitted, strict=True)).slope if len(dict(fitted)) >= FEWEST_FITTED else None,
        largest=max((one.distance for one in found if one.distance is not None), default=None),
        breaks=found[step].value if step < len(found) else None,
        step=step,
    )


def first_broken(laws: Iterable[RigidLaw]) -> str:
    """A sentence that names for each case who breaks first, and at which value; "" without laws."""
    told = []
    for case, own in grouped((law.case, law) for law in laws).items():
        soonest = min(own, key=lambda law: law.step)
        if soonest.breaks is None:
            told.append(f"{case}: none")
            continue
        settings = grouped((law.engine, law.setting) for law in own if law.step == soonest.step)
        who = [_who(engine, first, sum(law.engine == engine for law in own)) for engine, first in settings.items()]
        told.append(f"{case}: {' and '.join(who)} at {soonest.knob} {soonest.breaking}")
    return f"First to be {100 * BROKEN:.0f} % from rigid contact: {'; '.join(told)}." if told else ""


def _who(engine: str, settings: Sequence[str], asked: int) -> str:
    """An engine with the settings by which it breaks first, where those are not all that it was asked with."""
    if len(settings) == asked:
        return engine
    return f"{engine} ({settings[0]})" if len(settings) == 1 else f"{engine} in {len(settings)} of {asked} settings"
