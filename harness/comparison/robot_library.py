"""Robots' files as a library: what makes whatever works on a mechanism work on a robot.

A file is a system of this library under its path as it was given, so that what is printed can be typed again. Its mechanism is what the
harness reads in the file, and its engines are those that read it, aided; see ``harness.engines.engine``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from harness.engines import (
    Engine,
    Subject,
    Unsupported,
    file_engine,
    file_engines,
    installed_version,
    load_engine,
    select_subjects,
)
from harness.engines.request import EngineAnswers, EngineQuestion
from harness.errors import InvalidModel, InvalidRequest, not_installed
from harness.explain.changes.readings import element_at
from harness.explain.meant import joints_without_inertia, request_of, undetermined, why_unmoved
from harness.explain.switches import GROUPS
from harness.files.findings import ACTUATORS, CONTACTS
from harness.files.mjcf.inertias import CompiledMesh, Number
from harness.files.reading import format_of
from harness.library import ROBOTS, Library, Stance, is_file
from harness.programs.mechanisms.mechanism import Mechanism
from harness.registry import select
from harness.results.comparison import fixed_base, names_apart
from harness.results.switched_on import SwitchedOnPart, counted_parts, stays_off
from harness.results.table import grouped, joined
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import Robot, read_robot, with_actuators

if TYPE_CHECKING:
    from harness.truth.quantities import Quantity


def engine_of(name: str) -> Engine:
    """An engine that users' files are handed to, or a version of it, ``engine@version``, by whose name it goes then."""
    return file_engine(RobotLibrary.without_files(), name)


def engines_of_files() -> dict[str, Engine]:
    """All of them by name, sorted."""
    return file_engines(RobotLibrary.without_files())


def robot_subjects(names: Sequence[str] = ()) -> list[Subject]:
    """The subjects called ``names``, as ``mujoco/urdf`` or ``mujoco@3.13.0/urdf``; for none every one that is installed anywhere.

    Raises:
        InvalidRequest: a name no subject has, or whose version no environment holds.
    """
    return select_subjects(RobotLibrary.without_files(), names)


def ask_engine(engine: str, question: EngineQuestion) -> EngineAnswers:
    """Answers of an engine, or of a version of it: from this process, or from its environment if it is not installed beside the harness.

    What its version has no interface for is a refusal, and so is an engine that is installed nowhere.
    """
    found = load_engine(RobotLibrary.without_files(), engine)
    if installed_version(found) is None:
        return EngineAnswers(refusal=f"{not_installed(found.requires[1])}; harness engines add {engine}")
    try:
        return found.ask(question)
    except Unsupported as missing:
        return EngineAnswers(refusal=str(missing))


def robot_at(path: Path, floating_base: bool = False) -> Robot:
    """The robot in a file, in which meshes weigh what MuJoCo makes of them; raises as ``read_robot``."""
    return read_robot(path, floating_base=floating_base, compile_meshes=compiled_meshes)


def compiled_meshes(path: Path) -> Mapping[Number, CompiledMesh]:
    """The geoms of meshes by body and geom, as MuJoCo weighs them in a process of its own; raises as ``Engine.compiled_meshes``."""
    return load_engine(RobotLibrary.without_files(), "mujoco").compiled_meshes(path)


@dataclass(frozen=True)
class RobotLibrary(Library):
    """Robots' files, each a system with a model in one format, which engines read by themselves, as their users hand them over.

    Attributes:
        formats: {path as it was given: "urdf" or "mjcf"}. floating_base: whether a free joint is put under the roots of URDFs.
    """

    kinds: tuple[str, ...] = (ROBOTS,)
    reads_files: bool = True
    formats: Mapping[str, str] = field(default_factory=dict, hash=False)
    floating_base: bool = False
    stance: Stance = Stance.PLAIN

    @classmethod
    def without_files(cls) -> Self:
        """The engines alone."""
        folder = Library.built_in().engines
        return cls("robots", folder, folder, folder, folder / "expected_verdicts.toml", folder / "hard_states")

    @classmethod
    def of(cls, paths: Iterable[str], anywhere: bool = False, **about: Any) -> RobotLibrary:
        """The library of the files at ``paths``; of those ``anywhere`` nothing is expected, and no state is stored.

        ``about`` has other attributes: ``floating_base``, ``stance``, ``acts``.

        Raises:
            InvalidModel: a file cannot be read, or is no robot.
            InvalidRequest: they lie in several folders, and not anywhere.
        """
        formats = {path: format_of(Path(path)) for path in dict.fromkeys(paths)}
        folders = {Path(path).resolve().parent: Path(path).parent for path in formats}
        if anywhere:
            return replace(cls.without_files(), name=_title(formats), formats=formats, **about)
        if len(folders) > 1:
            where = ", ".join(str(folder) for folder in folders.values())
            raise InvalidRequest(
                f"the files lie in {where}; name those of one folder in a run, for what is expected of them stands beside them"
            )
        (folder,) = folders.values()
        return replace(
            cls.without_files(),
            name=_title(formats),
            systems=folder,
            models=folder,
            expected_verdicts=folder / "expected_verdicts.toml",
            hard_states=folder / "hard_states",
            formats=formats,
            **about,
        )

    def system_names(self) -> list[str]:
        return list(self.formats)

    def select(self, names: Iterable[str], with_variants: bool = False) -> list[str]:
        return select(names, {name: name for name in self.formats}, "file of this run")

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

    def variant_names(self) -> list[str]:
        return []

    def label(self, name: str) -> str:
        # Of a label, as mechanisms bear it, it is that.
        return names_apart(self.formats).get(name, name)

    def validated_models(self, name: str) -> dict[str, Path]:
        """None: a robot's file holds much that a model of a mechanism may not, and each engine reads it by itself."""
        return {}

    def remarks(self) -> list[str]:
        """The trunks that are fixed to the world, and what each aided subject is supplied with."""
        formats = dict.fromkeys(self.formats.values() if self.stance == Stance.AIDED else ())
        names = names_apart(self.formats)
        bases = {names[path]: fixed_base(self._trunk(path), model_format) for path, model_format in self.formats.items()}
        return [f"{name}: {base}" for name, base in bases.items() if base] + [
            f"{subject}, aided: {engine_of(subject.engine).supplied[subject.format]}"
            for model_format in formats
            for subject in robot_subjects()
            if subject.format == model_format
        ]

    def _trunk(self, path: str) -> str:
        """See ``Robot.trunk_on_the_world``."""
        robot = _read(path, self.floating_base)
        return "" if robot is None else robot.trunk_on_the_world

    def own_mechanism(self, name: str) -> Mechanism:
        """The mechanism of a robot's file.

        Raises:
            InvalidModel: the file has no meaning, or nothing in it has an acceleration.
        """
        robot = robot_at(Path(name), self.floating_base)
        if not robot.joints:
            raise InvalidModel(robot.path, None, why_unmoved(robot))
        if why := undetermined(robot):
            place = joints_without_inertia(robot.tree)[0].place
            raise InvalidModel(robot.path, place.line if place else None, f"{why}; give what it carries a mass, or fix the joint")
        if self.acts:
            robot = with_actuators(robot, (one.number for one in robot.actuators if not one.why_not))
        digest = hashlib.sha256(robot.path.read_bytes()).hexdigest()
        return replace(mechanism_of(robot), name=self.label(name), digest=digest, request=request_of(robot, self.stance))


def _read(path: str, floating_base: bool) -> Robot | None:
    """The robot in a file; None where it cannot be read, or not without its meshes."""
    try:
        return read_robot(Path(path), floating_base=floating_base)
    except (InvalidModel, OSError, ValueError):
        return None


def on_and_off(library: Library, quantities: Sequence[Quantity], engines: Iterable[str]) -> list[str]:
    """A sentence for each file on what of it acts in answers of engines about quantities, and what is off; none for mechanisms."""
    if not isinstance(library, RobotLibrary):
        return []
    without = [one.name for one in quantities if not one.is_default and not one.takes_all]
    acts, names, found = library.acts and len(without) < len(quantities), names_apart(library.formats), list[str]()
    callers = {name: load_engine(RobotLibrary.without_files(), name) for name in dict.fromkeys(engines)}
    left_out = {name: {*caller.why_off, *([] if caller.contacts else [CONTACTS])} for name, caller in callers.items()}
    for path in library.formats:
        if (robot := _read(path, library.floating_base)) is None:
            continue
        robot = with_actuators(robot, [one.number for one in robot.actuators if acts and not one.why_not])
        # One that is supplied with what it leaves out is asked about the tree and its actuators.
        plain = [one.what for one in GROUPS if library.touches or one.what != CONTACTS]
        kinds = [ACTUATORS] if library.stance == Stance.AIDED else plain
        parts = {
            group.what: [
                SwitchedOnPart(what=group.what, kind=one.kind, line=one.line, why_not=group.why_not(one, robot)) for one in group.of(robot)
            ]
            for group in GROUPS
            if acts and group.what in kinds
        }
        about = element_at(robot.tree.place), robot.format
        off_in = {name: {*left_out[name], *(one.unjudged(*about) if one.unjudged else ())} for name, one in callers.items()}
        nowhere = set.intersection(*off_in.values()) if off_in else set()
        counts = {what: 0 if what in nowhere else sum(not one.why_not for one in own) for what, own in parts.items()}
        on = joined([counted_parts(count, what) for what, count in counts.items() if count])
        not_in = _off_in(off_in, [what for what, count in counts.items() if count])
        off = joined(stays_off(robot.left_out, [one for what, own in parts.items() if counts[what] for one in own]))
        but_for = f", but for {joined(without)}" if without else ""
        said = "; ".join([*([f"{on} on{not_in}{but_for}"] if on else []), *([f"off: {off}"] if off else [])])
        found.append(f"{names[path]}: {said}" if said and len(library.formats) > 1 else said[:1].upper() + said[1:])
    return list(filter(None, found))


def _off_in(left_out: Mapping[str, Collection[str]], on: Sequence[str]) -> str:
    """In brackets, kinds of what is on that some engines apply none of, by what each leaves out; "" where all apply all."""
    missing = grouped((tuple(what for what in on if what in own), engine) for engine, own in left_out.items())
    said = [f"no {' or '.join(kinds)} in {joined(engines)}" for kinds, engines in missing.items() if kinds]
    return f" ({'; '.join(said)})" if said else ""


def _title(paths: Iterable[str]) -> str:
    return ", ".join(Path(path).name for path in paths)


def resolved(
    library: Library, names: Sequence[str], floating_base: bool = False, aided: bool = False, anywhere: bool = False, **about: bool
) -> Library:
    """The library that ``names`` are of: that of robots' files where they are files, else ``library``.

    ``about``: ``acts`` and ``touches`` as of ``Library``.

    Raises:
        InvalidModel: a file cannot be read, or is no robot.
        InvalidRequest: some names are of files and others are not, or the library is not the built-in one.
    """
    files = [name for name in names if is_file(library, name)]
    if not files and aided:
        raise InvalidRequest("by name engines get all that a model says; --aided is for a robot's file")
    if not files and floating_base:
        raise InvalidRequest("a floating base is put under the root of a robot's file; name a URDF")
    if not files and about.get("touches"):
        raise InvalidRequest("by name models have their contacts off; --contacts is for a robot's file")
    if not files:
        return library
    if aided and about.get("touches"):
        raise InvalidRequest("an aided engine is asked about the tree and its actuators; leave --aided or --contacts out")
    if others := [name for name in names if name not in files]:
        raise InvalidRequest(f"{files[0]} is a file and {others[0]} is not; name mechanisms or robots' files, in runs of their own")
    if library != Library.built_in():
        raise InvalidRequest(f"{files[0]} is a robot's file, which no library has to do with; leave --library {library.name} out")
    return RobotLibrary.of(files, anywhere, floating_base=floating_base, stance=Stance.AIDED if aided else Stance.PLAIN, **about)
