"""What to do with a model file that is given without the mechanism it is a model of."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from harness.commands._bracket import Bracket
from harness.errors import InvalidModel, InvalidRequest
from harness.library import MODEL_SUFFIXES, Library

_FORMATS = {suffix: model_format for model_format, suffix in MODEL_SUFFIXES.items()}


def refuse_alone(bracket: Bracket, command: str, names: Sequence[str], stand_ins: Mapping[str, Path] = MappingProxyType({})) -> None:
    """Refuse a model file among the names of mechanisms, or one that stands in for no name, with what to do instead.

    ``command`` is the one that takes a name with such a file.

    Raises:
        InvalidRequest: there is such a file; the message gives the mechanisms whose joints have its names.
    """
    given = [(_FORMATS[Path(name).suffix], Path(name)) for name in names if Path(name).suffix in _FORMATS]
    files = dict(given) or ({} if names else stand_ins)
    if not files:
        return
    from harness.models.joint_table import moving_joints

    model_format, path = next(iter(files.items()))
    problem, joints = f"{path} is a model file, and a check holds a model against the energies of a mechanism", frozenset[str]()
    try:
        joints = moving_joints(path, model_format)
    except InvalidModel as error:
        problem = str(error)
    library = bracket.library
    similar = [name for name in library.system_names() if joints and joints == _joints_of(library, name, model_format)]
    which = f"its joints are named like those of {', '.join(similar)}" if similar else "if its mechanism is one of harness list"
    options = [word for name, file in files.items() for word in (f"--{name}", str(file))]
    words = ["harness", command, similar[0] if similar else "NAME", *bracket.replay_options, *options]
    raise InvalidRequest(f"{problem}\n{which}: {shlex.join(words)}\nto write a mechanism of your own: harness new NAME")


def _joints_of(library: Library, name: str, model_format: str) -> frozenset[str]:
    """The moving joints of a system's own model; none where it has no file that can be read."""
    from harness.models.joint_table import moving_joints

    path = library.model_path(name, model_format)
    with contextlib.suppress(InvalidModel):
        if path.is_file():
            return moving_joints(path, model_format)
    return frozenset()
