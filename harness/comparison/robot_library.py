"""Robots' files as a library: what makes whatever works on a mechanism work on a robot.

A file is a system of this library under its path as it was given, so that what is printed can be typed again. Its mechanism is what the
harness reads in the file, and its engines are those that read it, aided; see ``harness.comparison.callers``.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from harness.comparison.callers import find_callers
from harness.comparison.truth import joints_without_inertia
from harness.equations.derivation import load_mechanism
from harness.equations.mechanism import Mechanism
from harness.errors import InvalidModel, InvalidRequest
from harness.library import MODEL_SUFFIXES, Library, nearest
from harness.robots.mechanism import mechanism_of
from harness.robots.robot import format_of, read_robot

# Endings by which a name is that of a file, be it there or not.
SUFFIXES = (*MODEL_SUFFIXES.values(), ".mjcf")


@dataclass(frozen=True)
class RobotLibrary(Library):
    """Robots' files, each a system with a model in one format.

    Attributes:
        formats: {path as it was given: "urdf" or "mjcf"}. floating_base: whether a free joint is put under the roots of URDFs.
    """

    formats: Mapping[str, str] = field(default_factory=dict)
    floating_base: bool = False

    @classmethod
    def of(cls, paths: Iterable[str], floating_base: bool = False) -> RobotLibrary:
        """The library of the files at ``paths``.

        Raises:
            InvalidModel: a file cannot be read, or is no robot.
        """
        formats = {path: format_of(Path(path)) for path in dict.fromkeys(paths)}
        names = ", ".join(Path(path).name for path in formats)
        folder = Path(next(iter(formats))).parent
        callers = Path(__file__).parent / "callers"
        # No verdict of a robot is expected to be another than ``agrees``.
        return cls(names, folder, folder, callers, Path(os.devnull), folder / "hard_states", formats, floating_base)

    def __hash__(self) -> int:
        return hash((tuple(self.formats), self.floating_base))

    def system_names(self) -> list[str]:
        return list(self.formats)

    def select(self, names: Iterable[str], with_variants: bool = False) -> list[str]:
        chosen = list(dict.fromkeys(names))
        for name in chosen:
            if name not in self.formats:
                raise InvalidRequest(f"no file of this run is called {name!r}; {nearest(name, self.formats)}")
        return chosen or self.system_names()

    def variant_names(self) -> list[str]:
        return []

    def is_variant(self, name: str) -> bool:
        return False

    def system_of(self, name: str) -> str:
        return name

    def system_path(self, name: str) -> Path:
        return Path(name)

    def model_path(self, name: str, model_format: str) -> Path:
        return Path(name)

    def formats_of(self, name: str) -> list[str]:
        return [self.formats[name]]

    def has_model(self, name: str, model_format: str) -> bool:
        return self.formats[name] == model_format

    def label(self, name: str) -> str:
        return Path(name).name

    def validated_models(self, name: str) -> dict[str, Path]:
        """None: a robot's file holds much that a model of a mechanism may not, and each engine reads it by itself."""
        return {}

    @property
    def is_minimal(self) -> bool:
        return False

    def engine_folders(self) -> list[Path]:
        return [self.engines]

    def native(self, formats: Sequence[str]) -> Sequence[str]:
        """All: a user has one file, and asks about every engine that reads it."""
        return formats

    def orphaned_models(self) -> list[Path]:
        return []

    def supplied(self) -> list[str]:
        """A sentence for each subject on what it is aided with."""
        found = []
        for model_format in dict.fromkeys(self.formats.values()):
            for engine, caller in find_callers().items():
                if model_format in caller.formats:
                    added = caller.supplied[model_format]
                    what = f"aided: the harness supplies {added}, from the file, as far as it has any" if added else "as its reader takes the file"
                    found.append(f"{engine}/{model_format}: {what}")
        return found


@load_mechanism.register
def _(library: RobotLibrary, name: str) -> Mechanism:
    """The mechanism of a robot's file.

    Raises:
        InvalidModel: the file has no meaning, or nothing in it has an acceleration.
    """
    robot = read_robot(Path(name), floating_base=library.floating_base and library.formats[name] == "urdf")
    if not robot.joints:
        raise InvalidModel(robot.path, None, "no joint moves, so that there is no acceleration; expected a joint that moves by itself")
    if idle := joints_without_inertia(robot.tree):
        first = idle[0].place
        named = ", ".join(joint.name for joint in idle)
        what = f"no acceleration is determined, for nothing with mass or inertia moves with {named}"
        raise InvalidModel(robot.path, first.line if first else None, f"{what}; give what it carries a mass, or fix the joint")
    return replace(mechanism_of(robot), name=name)


def is_file(name: str, library: Library) -> bool:
    """True if ``name`` is that of a robot's file, be it there or not, and of no system of a library."""
    if name in library.system_names() or name in library.variant_names():
        return False
    return Path(name).suffix in SUFFIXES or any(sign in name for sign in ("/", os.sep)) or Path(name).is_file()


def resolved(library: Library, names: Sequence[str], floating_base: bool = False) -> Library:
    """The library that ``names`` are of: that of robots' files where they are files, else ``library``.

    Raises:
        InvalidModel: a file cannot be read, or is no robot.
        InvalidRequest: some names are of files and others are not, or a floating base is asked for where there is no file.
    """
    files = [name for name in names if is_file(name, library)]
    if not files:
        if floating_base:
            raise InvalidRequest("--floating-base is for robots' files; name a URDF")
        return library
    if others := [name for name in names if name not in files]:
        raise InvalidRequest(f"{files[0]} is a file and {others[0]} is not; name mechanisms or robots' files, in runs of their own")
    if library != Library.built_in():
        raise InvalidRequest(f"{files[0]} is a robot's file, which no library has to do with; leave --library {library.name} out")
    return RobotLibrary.of(files, floating_base)
