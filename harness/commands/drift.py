"""``harness drift``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import click

from harness.commands import ROBOT
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.options import takes
from harness.commands.frame.pages import tell

SECTION = ROBOT


@dataclass(frozen=True, kw_only=True)
class DriftOptions:
    """Drift that is asked for."""

    first: Annotated[Path, click.argument("first", metavar="A", type=click.Path(path_type=Path))]
    second: Annotated[Path | None, click.argument("second", required=False, metavar="[B]", type=click.Path(path_type=Path))]
    by: Annotated[
        tuple[str, ...],
        click.option(
            "--by",
            multiple=True,
            metavar="ENGINE[@VERSION][/INTEGRATOR[@SECONDS]]",
            help="What moves A, and what B; once for both, or twice. SECONDS is the step length. By default mujoco, as the file says.",
        ),
    ]
    seconds: Annotated[
        float | None,
        click.option(
            "--seconds", type=click.FloatRange(min=0, min_open=True), help="How long they move; by default 1 s, or as long as a log."
        ),
    ]
    control: Annotated[
        Path | None,
        click.option(
            "--control",
            type=click.Path(path_type=Path),
            help="Table of controls, CSV, npz or Parquet: a column time [s], and one for each actuator; or a policy, ONNX, of q and v. "
            "By default those of A's keyframe.",
        ),
    ]
    start: Annotated[
        str,
        click.option(
            "--start", default="", metavar="JSON", help="{JOINT: [positions, velocities], ...} of joints that start elsewhere than in A."
        ),
    ]
    delay: Annotated[
        tuple[float, float],
        click.option(
            "--delay", nargs=2, type=click.FloatRange(min=0), default=(0.0, 0.0), help="Seconds until a control acts, in A and in B."
        ),
    ]
    decimation: Annotated[
        tuple[int, int],
        click.option(
            "--decimation", nargs=2, type=click.IntRange(min=1), default=(1, 1), help="Steps from one control to the next, in A and B."
        ),
    ]
    picture: Annotated[
        str | None,
        click.option("--picture", type=click.Path(dir_okay=False), help="Draw the gap over time, stacked by cause, to this SVG file."),
    ]


@click.command("drift")
@takes(DriftOptions)
@computing(time_limit=600.0, library=False, detail=True)
def command(bracket: Bracket, asked: DriftOptions) -> None:
    """Say why a robot moves differently in B than in A.

    A and B are MJCF or URDF files. Without B, A is moved by two engines, versions, integrators or step
    lengths, or with two delays of its controls. Both sides move from the same start under the same control,
    with contacts, limits, friction and actuators on.
    The output begins with the cause of the gap, its lines, and what to set so that B moves as A does. Each
    cause is exchanged between A and B in every subset of the others. Its share is the mean effect of that,
    so that all shares sum to the gap. If rounding alone would make such a gap, no share is claimed.
    B may be a table of measured positions, with a column time [s] and one for each joint. The output then
    says which numbers of A, changed at once or alone, explain the gap, and which of them the log cannot tell apart.
    The exit status is 0 if a drift was found and explained, or if both move alike.

    \b
    Examples:
      harness drift isaac.xml mine.xml
      harness drift a.xml b.xml --control policy.csv --seconds 0.5
      harness drift robot.xml --by mujoco/Euler --by mujoco/implicitfast
      harness drift robot.xml --by mujoco@3.13.0 --by mujoco@4.0.0
      harness drift robot.xml --delay 0 0.002 --control policy.csv
      harness drift robot.xml measured.csv --control sent.csv
      harness drift a.xml b.xml --picture drift.svg --json drift.json
    """
    from harness.drifts.control import is_table, read_control
    from harness.drifts.log import MeasuredSettings
    from harness.drifts.plan import DriftSettings, sides_of
    from harness.drifts.study import DriftStudy, MeasuredStudy
    from harness.report.drift import drift_sections

    if is_table(asked.first):
        raise click.UsageError(f"{asked.first} is a table; give the model first, and the log as B")
    if len(asked.by) > 2:
        raise click.UsageError("--by is given once for both sides, or twice")
    first, second = sides_of((asked.first, asked.second), asked.by or ("mujoco",), asked.delay, asked.decimation)
    control = None if asked.control is None else read_control(asked.control)
    study: DriftStudy | MeasuredStudy
    if asked.second is not None and is_table(asked.second):
        if len(asked.by) > 1 or asked.start or asked.delay[1] or asked.decimation[1] > 1 or asked.picture:
            raise click.UsageError("a measured log has no engine, start, delay, decimation or picture of its own; leave them out for B")
        study = MeasuredStudy(MeasuredSettings(first, asked.second, control, asked.seconds))
    else:
        study = DriftStudy(
            DriftSettings((first, second), 1.0 if asked.seconds is None else asked.seconds, control, _start(asked.start), bracket.seed)
        )
    bracket.begin(1, "drift")
    found = tell(bracket, study, drift_sections, lambda found: found.summary)
    if asked.picture is not None and found.drifts:
        from harness.commands.frame.terminal import say
        from harness.show.drift import draw_drift

        draw_drift(found.drifts[0]).save(asked.picture)
        say("", f"picture: {asked.picture}")
    bracket.finish(study.problems, study.crashed, bool(found.drifts or found.measured))


def _start(text: str) -> dict[str, tuple[list[float], list[float]]]:
    """Raises click.BadParameter where a text is none."""
    if not text:
        return {}
    try:
        found = json.loads(text)
        return {name: (_listed(q), _listed(v)) for name, (q, v) in found.items()}
    except (ValueError, TypeError, AttributeError) as error:
        expected = 'expected {joint: [positions, velocities]}, as {"elbow": [0.5, 0], "ball": [[1, 0, 0, 0], [0, 0, 0]]}'
        raise click.BadParameter(f"{text!r}: {expected}", param_hint="--start") from error


def _listed(part: Any) -> list[float]:
    return [float(number) for number in (part if isinstance(part, list) else [part])]
