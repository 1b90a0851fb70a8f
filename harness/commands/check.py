"""``harness check``."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

import click

from harness.commands import MECHANISM
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.cross_check import cross_check, finish
from harness.commands.frame.options import contacts_option, quantities_option, stand_in_options, states_option, subjects_option, takes
from harness.errors import InvalidModel, InvalidRequest
from harness.library import matching

SECTION = MECHANISM


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Cross-check that is asked for."""

    names: Annotated[tuple[str, ...], click.argument("names", nargs=-1, metavar="[NAME|FILE]...")]
    states: Annotated[int, states_option()]
    subjects: Annotated[tuple[str, ...], subjects_option]
    quantities: Annotated[tuple[str, ...], quantities_option("accelerations, and in a line for each subject the others at a few states")]
    stand_ins: Annotated[Mapping[str, Path], stand_in_options]
    worlds: Annotated[
        int, click.option("--worlds", type=click.IntRange(min=0), default=0, metavar="N", help="Say whether N equal worlds answer alike.")
    ]
    contacts: Annotated[bool, contacts_option]
    state: Annotated[str | None, click.option("--state", help='Replay one state: {"q": [...], "v": [...], "tau": [...]}.')]


@click.command("check")
@takes(CheckOptions)
@computing(time_limit=60.0, scheduler=True, floating_base=True, aided=True, detail=True)
def command(bracket: Bracket, asked: CheckOptions) -> None:
    """Check engines on NAMEs, or on a robot's FILE.

    NAME is a mechanism with its plain models, or a variant of these, MECHANISM.VARIANT;
    a pattern takes all names that it matches. Without NAMEs, all mechanisms and variants are checked.
    FILE is a robot, as URDF, MJCF or USD: what its numbers mean is the truth. The engines that read it are
    called as their users call them, with actuators, dry friction, limits and equalities on; contacts are on
    with --contacts. An answer is explained if it is right for what the engine's reader makes of the file;
    the output names that, with its effect.

    \b
    Examples:
      harness check
      harness check 'double_pendulum*'
      harness check double_pendulum arm_7r --states 10000
      harness check double_pendulum --mjcf edited.xml
      harness check double_pendulum --quantity reactions
      harness check double_pendulum --quantity accelerations
      harness check --library mine --subject mujoco/mjcf --json out.json
      harness check robot.urdf --floating-base
    """
    from harness.crosscheck.settings import Settings
    from harness.truth.quantities import select_quantities

    options = [word for name, path in asked.stand_ins.items() for word in (f"--{name}", str(path))]
    if options and not asked.names:
        _refuse_alone(bracket, options)
    bracket.choose_library(asked.names, acts=True, touches=asked.contacts)
    settings = Settings(
        library=bracket.library,
        names=matching(bracket.library, asked.names),
        subjects=asked.subjects,
        states=asked.states,
        seed=bracket.seed,
        stand_ins=asked.stand_ins,
        state=_parse_state(asked.state),
        componentwise=asked.state is not None,
        worlds=asked.worlds,
        replay_options=[*bracket.replay_options, *options],
    )
    bracket.begin(asked.states, "check")
    quantities = select_quantities(asked.quantities)
    finish(bracket, cross_check(bracket, settings, quantities, brief=not asked.quantities), quantities)


def _parse_state(text: str | None) -> Any:
    """One state from JSON.

    Raises:
        click.BadParameter: it is not {"q": numbers, "v": numbers, "tau": numbers} of one length, with "time": [number] or without, and with
            "control" and "activation" or without.
    """
    if text is None:
        return None
    from harness.programs.states import States

    try:
        data = json.loads(text)
        read = (data["q"], data["v"], data["tau"], data.get("time", [0.0]), data.get("control", []), data.get("activation", []))
        parts = [[float(value) for value in part] for part in read]
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        expected = 'expected {"q": [...], "v": [...], "tau": [...]} with numbers, and "control", "activation" where actuators act'
        raise click.BadParameter(expected, param_hint="--state") from error
    if not all(math.isfinite(value) for part in parts for value in part):
        raise click.BadParameter("every number must be finite", param_hint="--state")
    if len(parts[1]) != len(parts[2]) or len(parts[3]) != 1:
        raise click.BadParameter("v and tau must have the same length, and time, where it is given, one number", param_hint="--state")
    return States.at(*parts)


def _refuse_alone(bracket: Bracket, options: Sequence[str]) -> NoReturn:
    """Refuse the files of options as --urdf that stand in for no name, with what to do instead.

    Raises:
        InvalidRequest: always; the message gives the mechanisms whose joints have the names of the first file's.
    """
    from harness.files.text.joint_table import systems_with_joints_of

    model_format, path = options[0].removeprefix("--"), Path(options[1])
    problem, similar = f"{path} is a model file, and stands in for that of a mechanism, which is not named", list[str]()
    try:
        similar = systems_with_joints_of(bracket.library, path, model_format)
    except InvalidModel as error:
        problem = str(error)
    which = f"its joints are named like those of {', '.join(similar)}" if similar else "if its mechanism is one of harness list"
    words = ["harness", "check", similar[0] if similar else "NAME", *bracket.replay_options, *options]
    alone = f"to check engines on the file by itself: {shlex.join(['harness', 'check', str(path)])}"
    raise InvalidRequest(f"{problem}\n{which}: {shlex.join(words)}\n{alone}\nto write a mechanism of your own: harness new NAME")
