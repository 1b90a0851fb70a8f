"""Drift of two simulated motions, as scripts and notebooks get it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from harness import workers as processes
from harness.drifts.control import is_table, read_control
from harness.drifts.log import MeasuredSettings
from harness.drifts.plan import DriftSettings, MovingSide, sides_of
from harness.drifts.study import DriftStudy, drift_here, measured_from
from harness.engines.moving import Control
from harness.errors import InvalidRequest
from harness.results.drift import DriftRecord, Drifts
from harness.results.measured import MeasuredRecord
from harness.study import complete

if TYPE_CHECKING:
    from harness.arrays import Array
    from harness.show.drawing import Drawing

# (t, q, v) -> controls by the names of actuators, or in their order.
ControlFunction = Callable[[float, "Array", "Array"], Any]


@dataclass(frozen=True, kw_only=True, repr=False)
class FoundDrift(DriftRecord):
    """A drift that prints as ``harness drift`` does."""

    def plot(self) -> Drawing:
        """The gap over time, stacked by cause."""
        from harness.show.drift import draw_drift

        return draw_drift(self)

    def __repr__(self) -> str:
        return _printed(Drifts(drifts=[self]))

    def _repr_html_(self) -> str:
        return f"<p>{self.sentence}</p>{self.plot().svg}"


@dataclass(frozen=True, kw_only=True, repr=False)
class FoundLog(MeasuredRecord):
    """A log beside a model, which prints as ``harness drift`` does."""

    def __repr__(self) -> str:
        return _printed(Drifts(measured=[self]))


def _printed(found: Drifts) -> str:
    from harness.report.drift import drift_sections

    return "\n\n".join(map(str, drift_sections(found)))


class MovedAlike(TypedDict, total=False):
    """Settings by which both sides of a drift are moved.

    Attributes:
        seconds: how long, 1 by default. start: {joint: (positions, velocities)} of those that start elsewhere than in the first keyframe
            of the first file.
        delay: until a control acts, in both sides [s]. decimation: steps from one control to the next.
        seed: of sampled orders and of rounding. workers: processes; one per CPU for None.
    """

    seconds: float
    start: Mapping[str, tuple[Sequence[float], Sequence[float]]]
    delay: tuple[float, float]
    decimation: tuple[int, int]
    seed: int
    workers: int | None


def drift(
    first: str | Path,
    second: str | Path | None = None,
    *,
    by: str | Sequence[str] = "mujoco",
    control: ControlFunction | str | Path | None = None,
    **moved: Unpack[MovedAlike],
) -> FoundDrift:
    """Why a robot that is controlled alike moves otherwise in the second file, or by the second of ``by``, than in the first.

    Args:
        second: None for the first file again. by: as "mujoco@3.13.0/RK4@0.001", for both sides or one each.
        control: the path of a table or of a policy in ONNX, or a function (t, q, v) -> controls by the names of actuators, or in their
            order; q and v are over ``joints`` of what is returned, a rotation as (w, x, y, z). A function is called in this process,
            each ``decimation`` steps.
        moved: those of ``harness.api.drifting.MovedAlike``.

    Raises:
        harness.errors.InvalidInput: a file cannot be read.
        harness.errors.InvalidRequest: sides of other joints, no such engine, control or start, or a file that an engine refuses.
        TypeError: an argument that is none.

    Examples:
        >>> import harness
        >>> arm = harness.Library.built_in().model_path("servo_arm", "mjcf")
        >>> found = harness.drift(arm, by=("mujoco/Euler", "mujoco/implicitfast"), start={"elbow": ([0.5], [0.0])}, seconds=0.1)
        >>> found.ranked[0].name
        'integrator'
    """
    if unknown := moved.keys() - MovedAlike.__annotations__.keys():
        raise TypeError(f"drift has no argument {sorted(unknown)[0]!r}; expected some of {', '.join(MovedAlike.__annotations__)}")
    if second is not None and is_table(Path(second)):
        raise InvalidRequest(f"{second} is a table; a log is held against a model by harness.drift_from_log")
    timing = moved.get("delay", (0.0, 0.0)), moved.get("decimation", (1, 1))
    sides = sides_of((Path(first), None if second is None else Path(second)), (by,) if isinstance(by, str) else by, *timing)
    settings = DriftSettings(sides, moved.get("seconds", 1.0), None, moved.get("start", {}), moved.get("seed", 0))
    settings = replace(settings, control=_control(control))
    if callable(control):
        return _found(drift_here(settings))
    study = DriftStudy(settings)
    with processes.Workers(moved.get("workers"), time_limit=600.0) as pool:
        found: Drifts = complete(study, pool)
    for problem in study.problems:
        raise problem
    return _found(found.drifts[0])


def drift_from_log(
    model: str | Path,
    log: str | Path,
    *,
    by: str = "mujoco",
    control: ControlFunction | str | Path | None = None,
    seconds: float | None = None,
    delay: float = 0.0,
) -> FoundLog:
    """The numbers of a model, each alone and several at once, that would explain a log of measured joint positions, and those that it does
    not tell apart.

    Args:
        log: a table with a column ``time`` [s] and one for each hinge or slide that was measured. control: as of ``drift``; what was
            sent while it was measured, by the same clock. seconds: how long both are held against each other, None for all of the log.
        by: who moves the model, as of ``drift``. delay: until a control acts in it [s].

    Raises:
        harness.errors.InvalidInput: the model cannot be read.
        harness.errors.InvalidRequest: as ``drift``, or the log is none of this model.

    Example:
        >>> import harness
        >>> from pathlib import Path
        >>> lines = Path("log.csv").write_text("time,pin\\n0,1\\n0.01,0.9995\\n0.02,0.998\\n")
        >>> pendulum = harness.Library.built_in().model_path("simple_pendulum", "mjcf")
        >>> harness.drift_from_log(pendulum, "log.csv").joints
        ['pin']
    """
    side = replace(MovingSide(Path(model)).by(by), delay=delay)
    return FoundLog(**vars(measured_from(MeasuredSettings(side, Path(log), _control(control), seconds), here=callable(control))))


def _control(control: ControlFunction | str | Path | None) -> Control | None:
    return Control.calling(control) if callable(control) else None if control is None else read_control(Path(control))


def _found(drift: DriftRecord) -> FoundDrift:
    return FoundDrift(**vars(drift))
