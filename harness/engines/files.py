"""Engine files: found by name, described as plain data, and loaded."""

from __future__ import annotations

import ast
import contextlib
import copy
import functools
import importlib
import importlib.util
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from importlib.machinery import PathFinder
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import msgspec

from harness.engines.engine import (
    EQUATIONS,
    FOLDER,
    FORMATS,
    Engine,
    Subject,
    for_files,
    is_own_file,
    load_keeping_arithmetic,
    run_engine_file,
)
from harness.environments import NEWEST, Environment, environment_of, find_environments, split_name
from harness.errors import InvalidModel, InvalidRequest
from harness.files.model_file import ModelFile
from harness.library import MODEL_SUFFIXES, Library, nearest
from harness.storage import cache_directory, read_entry, sources_digest, write_entry
from harness.version import version_of
from harness.workers import Outcome, Task, Workers

if TYPE_CHECKING:
    from harness.engines import Model
    from harness.programs.mechanisms.mechanism import Mechanism

# Longest that an engine file may take to be loaded, which is an import and no more, where a command's tasks may take hours.
LOADING_SECONDS = 600.0


@dataclass(frozen=True, kw_only=True)
class Description:
    """Declarations of an engine file, as plain data.

    Attributes:
        requires, formats: as of ``Engine``; of a file that cannot be loaded, the formats that its text spells out, else all.
        of_users: the formats in which files of users are handed to it.
        oldest, companions, optional, is_asked_by_name, title: as of ``Engine``.
    """

    requires: tuple[str, str] = ("", "")
    formats: tuple[str, ...]
    of_users: tuple[str, ...] = ()
    oldest: Mapping[str, str] = field(default_factory=dict)
    companions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    optional: bool = False
    is_asked_by_name: bool = False
    title: str = ""


@dataclass(frozen=True, kw_only=True)
class EngineFile(Description):
    """An engine as plain data: what its file says, and where its program is.

    Attributes:
        version: of the program behind it; None where it is neither installed beside the harness nor in an environment.
        elsewhere: whether it is run in an environment of its own. is_own: whether it is the harness's, and not a library's.
        outcome: of loading it: the exception it raises, or the crash of its process, where there is one. Neither, and no value, of a
            library's file that nobody asks for, which is not run.
    """

    version: str | None = None
    elsewhere: bool = False
    is_own: bool = True
    outcome: Outcome

    def too_old(self, version: str, model_format: str = "") -> str:
        """Why a version of the program cannot be asked about a format, or about any; "" where it can, as the newest, "", can."""
        from packaging.version import Version

        known = [Version(oldest) for name, oldest in self.oldest.items() if model_format in ("", name)]
        if not version or not known or Version(version) >= min(known):
            return ""
        return f"{self.requires[1]} {version} is older than {min(known)}, the oldest whose {model_format or 'readers'} the harness knows"

    def requirements(self, version: str) -> list[str]:
        """Packages that a version of the program needs beside those that it requires itself; "" is the newest."""
        # Imported late: an environment's interpreter imports this module and has no such package.
        from packaging.specifiers import SpecifierSet

        return [one for versions, those in self.companions.items() if (version or NEWEST) in SpecifierSet(versions) for one in those]


def _folders_of(library: Library) -> list[Path]:
    """The folders of the engines that can be asked; of two engines with one name the later one's is taken."""
    return [Library.built_in().engines, library.engines]


def engine_paths(library: Library) -> dict[str, Path]:
    """Every engine file by name, sorted: those of the harness and those of the library, which win."""
    found: dict[str, Path] = {}
    for folder in _folders_of(library):
        found |= {path.stem: path for path in folder.glob("*.py") if not path.stem.startswith("_")}
        found |= {path.parent.name: path for path in folder.glob(f"*/{FOLDER}")}
    return dict(sorted(found.items()))


def describe_engines(library: Library, workers: Callable[[], Workers], asked: Collection[str] = ()) -> Mapping[str, EngineFile]:
    """Every engine by name, sorted, those of other versions as ``engine@version``; ``engine_files`` returns the same from then on.

    A file of the library is loaded by a process of what ``workers`` makes: it may end, hang or print there. Where subjects are named,
    ``asked``, those of other engines are not loaded at all.
    """
    _is_importable.cache_clear()
    paths, engines = engine_paths(library), {split_name(name.partition("/")[0])[0] for name in asked}
    tasks = {name: Task(name, _describe, (library, name)) for name in paths}
    own = _own_descriptions()
    outcomes = {name: Outcome(task, own[name] if is_own_file(paths[name]) else None) for name, task in tasks.items()}
    if foreign := [task for name, task in tasks.items() if not is_own_file(paths[name]) and (not asked or name in engines)]:
        made = workers()
        with replace(made, time_limit=min(made.time_limit, LOADING_SECONDS)) as loading:
            outcomes |= {outcome.task.key: outcome for outcome in loading.run(foreign)}
    files = {}
    for name, path in paths.items():
        described = outcomes[name].value or Description(formats=_spelt_formats(path))
        files[name] = EngineFile(
            **vars(described), version=_version_beside(*described.requires), is_own=is_own_file(path), outcome=outcomes[name]
        )
    for environment in find_environments():
        # The newest comes last.
        if (file := files.get(environment.engine)) is not None and file.requires[1] == environment.distribution:
            files[environment.name] = replace(file, version=environment.version, elsewhere=True)
            if file.version is None or file.elsewhere:
                files[environment.engine] = files[environment.name]
    _DESCRIBED[library.engines] = dict(sorted(files.items()))
    return _DESCRIBED[library.engines]


_DESCRIBED: dict[Path, Mapping[str, EngineFile]] = {}


def engine_files(library: Library) -> Mapping[str, EngineFile]:
    """Every engine of a library by name, as ``describe_engines`` found it in this process."""
    if library.engines not in _DESCRIBED:
        describe_engines(library, Workers)
    return _DESCRIBED[library.engines]


def _own_descriptions() -> dict[str, Description]:
    """Those of the harness's own engines, kept by the text of their files: a check imports the engines that it asks, and no others."""
    entry, library = cache_directory() / "engines" / f"{sources_digest('engines').hex()}.json", Library.built_in()
    if (text := read_entry(entry)) is not None:
        return msgspec.json.decode(text, type=dict[str, Description])
    found = {name: _describe(library, name) for name in engine_paths(library)}
    write_entry(entry, msgspec.json.encode(found).decode())
    return found


def _describe(library: Library, name: str, note: object = None) -> Description:
    """The description of an engine by its file, as a task for ``harness.workers``; raises as ``load_engine``."""
    engine = run_engine_file(_path_of(library, name), name)
    return Description(
        requires=(engine.requires[0], engine.requires[1]),
        formats=tuple(dict.fromkeys(engine.formats)),
        of_users=tuple(engine.call),
        optional=engine.optional,
        is_asked_by_name=engine.is_asked_by_name,
        title=engine.title,
        oldest=dict(engine.oldest),
        companions={versions: tuple(those) for versions, those in engine.companions.items()},
    )


def _spelt_formats(path: Path) -> tuple[str, ...]:
    """The formats that an engine file spells out, read without running it; those of all model files where it spells out none."""
    with contextlib.suppress(OSError, ValueError, TypeError, SyntaxError):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "formats":
                return tuple(name for name in FORMATS if name in ast.literal_eval(node.value)) or tuple(MODEL_SUFFIXES)
    return tuple(MODEL_SUFFIXES)


def load_engine(library: Library, name: str) -> Engine:
    """The engine called ``name``; a library's own engine wins over the harness's. Its program is run by a process of its own.

    ``engine@version`` is run by the environment of that version, and so is an engine that is not installed beside the harness, by that
    of the newest.

    Raises:
        InvalidEngine: the engine file raises, defines no ``ENGINE``, or one that is no ``Engine``.
        InvalidRequest: there is no such engine, or no environment of that version.
    """
    name, version = split_name(name)
    engine = _engine_of(library, name)
    if library.reads_files:
        engine = for_files(engine)
    if version or (installed_version(engine) is None and find_environments(name)):
        return _elsewhere(engine, _path_of(library, name), environment_of(name, version))
    return engine


def _elsewhere(engine: Any, path: Path, environment: Environment) -> Engine:
    # Imported late: where engines are described none is asked.
    from harness.engines.elsewhere.interpreter import EngineElsewhere

    if isinstance(engine, EngineElsewhere):
        return cast("Engine", engine.elsewhere(environment))
    return cast("Engine", EngineElsewhere(engine, (), path, environment))


def _engine_of(library: Library, name: str) -> Engine:
    """The engine of a file, whose program is run by a process of its own; equations are the harness's own, and are evaluated here."""
    from harness.engines.elsewhere.interpreter import EngineElsewhere, engine_in_a_process_of_its_own

    path = _path_of(library, name)
    if not is_own_file(path):
        return cast("Engine", engine_in_a_process_of_its_own(path, name))
    engine = run_engine_file(path, name)
    if library.calls_engines_here or EQUATIONS in engine.formats:
        return engine
    return cast("Engine", EngineElsewhere(engine, (), path, None))


def load_model(library: Library, subject: Subject, mechanism: Mechanism, model: ModelFile | None) -> Model:
    """The mechanism as the subject's engine loads it, from ``model`` or, for equations, as it is.

    Raises:
        InvalidModel: the engine refuses the model.
        Unsupported: the engine cannot express the mechanism.
        InvalidAnswer: its file, or loading, leaves other arithmetic behind, or has done so before in this process.
    """
    source, engine = mechanism if model is None else model, load_engine(library, subject.engine)
    try:
        loaded: Model = load_keeping_arithmetic(engine, source, mechanism.joints, mechanism.gravity)
    except ValueError as error:
        if model is None:
            raise
        raise InvalidModel(model.path, None, f"{subject.engine} refuses it: {error}") from error
    return loaded


def file_engines(library: Library) -> dict[str, Engine]:
    """The engines that files of users are handed to, by name, sorted."""
    engines = {name: _engine_of(library, name) for name in engine_paths(library)}
    return {name: engine for name, engine in engines.items() if engine.call}


def file_engine(library: Library, name: str) -> Engine:
    """Such an engine, or a version of it, ``engine@version``, by whose name it goes then; what it says of itself needs no environment."""
    engine = copy.copy(_engine_of(library, split_name(name)[0]))
    engine.name = name
    return engine


def _path_of(library: Library, name: str) -> Path:
    """The file of the engine called ``name``, without a look at the others: each question to an engine comes here.

    Raises:
        InvalidRequest: there is none.
    """
    if name.isidentifier() and not name.startswith("_"):
        for folder in reversed(_folders_of(library)):
            for path in (folder / f"{name}.py", folder / name / FOLDER):
                if path.is_file():
                    return path
    paths = engine_paths(library)
    if name not in paths:
        raise InvalidRequest(f"no engine is called {name!r}; {nearest(name, paths)}")
    return paths[name]


def runs_elsewhere(engine: Engine) -> bool:
    """True where the engine's models are loaded by the interpreter of an environment."""
    return engine.environment is not None


def installed_version(engine: Engine) -> str | None:
    """Version of the program behind an engine, without importing it; None where it is not installed."""
    if engine.environment is not None:
        return engine.environment.version
    return _version_beside(*engine.requires)


def _version_beside(module: str, distribution: str) -> str | None:
    """Version of the program of that module that is installed beside the harness; None without."""
    try:
        return version_of(distribution) if module and _is_importable(module) else None
    except ModuleNotFoundError:
        return None


@functools.cache
def _is_importable(module: str) -> bool:
    """True where the search path holds a module, as when engines were last described; no package is imported for what is in it."""
    package, *parts = module.split(".")
    found = importlib.util.find_spec(package)
    for part in parts:
        places = found and found.submodule_search_locations
        found = PathFinder.find_spec(f"{package}.{part}", places) if places else None
        package = f"{package}.{part}"
    return found is not None
