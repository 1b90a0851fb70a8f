"""What to do with a model file that is to stand in for one of a mechanism that was not named."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from harness.commands.frame.bracket import Bracket
from harness.errors import InvalidModel, InvalidRequest


def refuse_alone(bracket: Bracket, command: str, names: Sequence[str], stand_ins: Mapping[str, Path]) -> None:
    """Refuse files that stand in for no name, with what to do instead.

    ``command`` is the one that takes a name with such a file.

    Raises:
        InvalidRequest: there is such a file; the message gives the mechanisms whose joints have its names.
    """
    if names or not stand_ins:
        return
    from harness.models.joint_table import systems_with_joints_of

    model_format, path = next(iter(stand_ins.items()))
    problem, similar = f"{path} is a model file, and stands in for that of a mechanism, which is not named", list[str]()
    try:
        similar = systems_with_joints_of(bracket.library, path, model_format)
    except InvalidModel as error:
        problem = str(error)
    which = f"its joints are named like those of {', '.join(similar)}" if similar else "if its mechanism is one of harness list"
    options = [word for name, file in stand_ins.items() for word in (f"--{name}", str(file))]
    words = ["harness", command, similar[0] if similar else "NAME", *bracket.replay_options, *options]
    alone = f"to check engines on the file by itself: {shlex.join(['harness', command, str(path)])}"
    raise InvalidRequest(f"{problem}\n{which}: {shlex.join(words)}\n{alone}\nto write a mechanism of your own: harness new NAME")
