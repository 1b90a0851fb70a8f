"""Libraries: folders with ``systems/``, ``mjcf/`` and ``urdf/`` in which mechanisms are found by file name.

The built-in library keeps its systems inside the package and its models at the top level of the
repository; in an installed wheel the models lie inside the package too. A library may also hold
``engines/`` of its own, an ``expected_verdicts.toml``, and ``robots/``: robots' files, which stand in its report. An installed
distribution offers a library under a name by an entry point of the group ``harness.libraries``, whose value is the package that holds it.

A system file that defines ``SIZES`` and ``system(n)`` is a family; ``mjcf/<family>.py`` and
``urdf/<family>.py`` define ``model(n)``, which returns the text of the model. A member's own path, as
``systems/chain_12.py``, does not exist; it stands for the family's file and the size.

A model file ``<system>.<variant>.xml`` or ``<system>.<variant>.urdf`` is a *variant*: the same mechanism, written with other
elements of the format. Its system is the one whose equations it must agree with; it may stand in one format alone.
"""

from __future__ import annotations

import ast
import difflib
import fnmatch
import functools
import importlib.util
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import Any

from harness.errors import InvalidInput, InvalidRequest


class Stance(StrEnum):
    """A way of asking an engine about a user's file: as its user calls it, or supplied with what it leaves out of the file."""

    PLAIN = "plain"
    AIDED = "aided"


# Formats of models of mechanisms, and of all files that engines read.
MODEL_SUFFIXES = {"mjcf": ".xml", "urdf": ".urdf"}
FILE_FORMATS = (*MODEL_SUFFIXES, "usd")
# Endings by which a name is that of a file, be it there or not.
STAGE_SUFFIXES = (".usda", ".usd", ".usdc", ".usdz")
FILE_SUFFIXES = (*MODEL_SUFFIXES.values(), ".mjcf", *STAGE_SUFFIXES)
# Of a file that xacro makes a URDF of.
TEMPLATE_SUFFIX = ".xacro"
# Kinds of mechanism: of energies, the same under constraints, and of a file, which has no energies.
MECHANISMS, CONSTRAINED, ROBOTS = "mechanisms", "mechanisms with constraints", "robots"
BUILT_IN_NAME = "built-in"
ENTRY_POINTS = "harness.libraries"
_PACKAGE = Path(__file__).resolve().parent
_MEMBER = re.compile(r"(?P<family>.+)_(?P<size>[1-9]\d{0,3})")


@dataclass(frozen=True)
class Library:
    """The places of one library's files. Picklable; reads nothing until asked.

    Attributes:
        kinds: of mechanism that it can hold, by which methods and integrators say what they are for.
        reads_files: whether engines are handed files as their users do, and not models of mechanisms.
        stance: of the engines; those of mechanisms get all that a model says.
        acts: whether of a user's file all acts with which answers are judged: actuators, dry friction, limits, equalities.
        touches: whether its contacts act, too.
        calls_engines_here: whether the harness's own engines are called in the process that asks them, as where programs are written
            against them and timed, and not in processes of their own.
    """

    name: str
    systems: Path
    models: Path
    engines: Path
    expected_verdicts: Path
    hard_states: Path
    kinds: tuple[str, ...] = (MECHANISMS, CONSTRAINED)
    reads_files: bool = False
    stance: Stance = Stance.AIDED
    acts: bool = False
    touches: bool = False
    calls_engines_here: bool = False

    @classmethod
    @functools.cache
    def built_in(cls) -> Library:
        """The textbook mechanisms that come with the harness."""
        models = _PACKAGE if (_PACKAGE / "mjcf").is_dir() else _PACKAGE.parent
        return cls(
            BUILT_IN_NAME,
            _PACKAGE / "systems",
            models,
            _PACKAGE / "engines" / "adapters",
            _PACKAGE / "crosscheck" / "expected_verdicts.toml",
            _PACKAGE / "hard" / "states",
        )

    @classmethod
    def at(cls, directory: Path | str | None) -> Library:
        """The library in ``directory``, or installed under that name, or the built-in one for None.

        Raises:
            InvalidInput: there is no such directory or name, or it has no ``systems`` folder.
        """
        if directory is None:
            return cls.built_in()
        root = Path(directory).resolve()
        if not root.exists():
            return replace(cls.at(_installed_directory(str(directory))), name=str(directory))
        if not root.is_dir():
            raise InvalidInput(directory, None, "no such directory; expected a library with systems/, mjcf/ and urdf/")
        if not (root / "systems").is_dir():
            raise InvalidInput(directory, None, "holds no systems/ folder; expected a library with systems/, mjcf/ and urdf/")
        return cls(root.name, root / "systems", root, root / "engines", root / "expected_verdicts.toml", root / "hard_states")

    def system_names(self) -> list[str]:
        """Names of all systems, in the order of their files; those that begin with an underscore are helpers."""
        return [name for path in sorted(self.systems.glob("*.py")) for name in names_in(path)]

    def select(self, names: Iterable[str], with_variants: bool = False) -> list[str]:
        """``names`` as given, or every system for none; ``with_variants`` the variants of models too.

        Raises:
            InvalidRequest: a name no system has; the message gives the nearest one.
            InvalidInput: the library holds no system at all.
        """
        known = self.system_names()
        if not known:
            raise InvalidInput(self.systems, None, "holds no system file; expected systems/<name>.py")
        variants = self.variant_names() if with_variants else []
        chosen = list(dict.fromkeys(names))
        for name in chosen:
            if name not in known and name not in variants and not _is_member(self, name):
                if not with_variants and name in self.variant_names():
                    raise InvalidRequest(
                        f"{name!r} is a variant of models, which only check, diagnose and show take; name {self.system_of(name)}"
                    )
                no_file = " (there is no file of this name either)" if with_variants else ""
                raise InvalidRequest(f"no system is called {name!r}; {nearest(name, [*known, *variants])}{no_file}")
        return chosen or [*known, *variants]

    def variant_names(self) -> list[str]:
        """Names ``<system>.<variant>`` of all variants, sorted; each has a model file in one format at least."""
        systems = self.system_names()
        variants = {(path.stem, self.system_of(path.stem)) for path in _model_files(self) if self.is_variant(path.stem)}
        return sorted(variant for variant, system in variants if system in systems or _is_member(self, system))

    def is_variant(self, name: str) -> bool:
        """True for the name of a variant: it has a dot, and is not that of a system file."""
        return self.system_of(name) != name

    def system_of(self, name: str) -> str:
        """The system of a variant, whose equations it has; the name itself for a system's own."""
        return name if (self.systems / f"{name}.py").is_file() else name.partition(".")[0]

    def remarks(self) -> list[str]:
        """Remarks on all of its records, a sentence each."""
        return []

    def system_path(self, name: str) -> Path:
        """The file of a system, or of a variant's system; a family's member has a path of its own, which does not exist."""
        return self.systems / f"{self.system_of(name)}.py"

    def model_path(self, name: str, model_format: str) -> Path:
        return self.models / model_format / f"{name}{MODEL_SUFFIXES[model_format]}"

    def formats_of(self, name: str) -> list[str]:
        """The model formats of a system, which is to have all of them, or those that a variant has a file in."""
        return [form for form in MODEL_SUFFIXES if not self.is_variant(name) or self.has_model(name, form)]

    def has_model(self, name: str, model_format: str) -> bool:
        """True where the system has a model of its own or one that its family writes, readable or not."""
        path = self.model_path(name, model_format)
        return os.path.lexists(path) or member_of(path) is not None

    def label(self, name: str) -> str:
        """The name of a system as that of a file in which something of it is kept."""
        return name

    def validated_models(self, name: str) -> dict[str, Path]:
        """{model format: path} of the files that are validated as models of a system; those that are missing too."""
        return {model_format: self.model_path(name, model_format) for model_format in self.formats_of(name)}

    def own_mechanism(self, name: str) -> Any:
        """The mechanism of a system that no system file declares; None where one does, from which it is derived."""
        return None


def robots_folder(library: Library) -> Path:
    """The folder of robots' files that stand in a library's report, be it there or not."""
    return library.systems.parent / "robots"


def names_in(path: Path) -> list[str]:
    """Names of the systems in one file: its stem, or a family's members in the sizes it lists."""
    if path.stem.startswith("_"):
        return []
    return [f"{path.stem}_{size}" for size in sizes(path)] or [path.stem]


def matching(library: Library, names: Iterable[str]) -> list[str]:
    """``names`` with each pattern, as ``double_pendulum.*``, replaced by the systems and variants that it fits.

    Raises:
        InvalidRequest: a pattern fits none.
    """
    found, systems = list[str](), library.system_names()
    for name in names:
        is_pattern = name not in systems and any(sign in name for sign in "*?[")
        known = [*systems, *library.variant_names()] if is_pattern else [name]
        fitting = fnmatch.filter(known, name) if is_pattern else known
        if not fitting:
            raise InvalidRequest(f"no system and no variant of models fits {name!r}; {nearest(name, known)}")
        found += fitting
    return found


def is_file(library: Library, name: str) -> bool:
    """True if ``name`` is that of a robot's file, be it there or not, and of no system or variant of a library."""
    is_path = any(sign in name for sign in {"/", os.sep})
    # Names of systems and variants, for which the folders are read, are those of files without their folders.
    if (library.reads_files or not is_path) and (name in library.system_names() or name in library.variant_names()):
        return False
    return is_path or Path(name).suffix in (*FILE_SUFFIXES, TEMPLATE_SUFFIX) or Path(name).exists()


def orphaned_models(library: Library) -> list[Path]:
    """Model files of a library that no system stands behind."""
    known = {path.stem for path in library.systems.glob("*.py")}.union(library.variant_names())
    return [path for path in _model_files(library) if path.stem not in known and not library.reads_files]


def _model_files(library: Library) -> list[Path]:
    return [path for name, suffix in MODEL_SUFFIXES.items() for path in sorted((library.models / name).glob(f"*{suffix}"))]


def _is_member(library: Library, name: str) -> bool:
    return not library.is_variant(name) and member_of(library.system_path(name)) is not None


def installed_libraries() -> dict[str, str]:
    """Names of the installed libraries and the packages that hold them, sorted by name; imports none of them.

    Where two distributions offer one name, the one that comes first on Python's path has it.
    """
    # Late, as in ``harness.version``.
    import importlib.metadata

    found: dict[str, str] = {}
    for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
        found.setdefault(entry.name, entry.value)
    return dict(sorted(found.items()))


def _installed_directory(name: str) -> Path:
    """The folder of the installed library ``name``, found without importing it."""
    installed = installed_libraries()
    if name not in installed:
        expected = "expected a library with systems/, mjcf/ and urdf/"
        if installed:
            expected += f", or one of the installed ones, {', '.join(installed)}; {nearest(name, installed)}"
        raise InvalidInput(name, None, f"no such directory; {expected}")
    module = installed[name].partition(":")[0].strip()
    top, *inner = module.split(".")
    try:
        specification: ModuleSpec | None = importlib.util.find_spec(top)
        for depth in range(len(inner)):
            if specification is None:
                break
            # The general finder would import the packages above.
            specification = PathFinder.find_spec(".".join([top, *inner[: depth + 1]]), specification.submodule_search_locations)
    except (ImportError, ValueError):
        specification = None
    folders = list(specification.submodule_search_locations or ()) if specification is not None else []
    if specification is not None and specification.submodule_search_locations is None and specification.origin:
        folders = [str(Path(specification.origin).parent)]
    for folder in folders:
        if (Path(folder) / "systems").is_dir():
            return Path(folder)
    found = f"lies in {', '.join(folders)}, where there is no systems/ folder" if folders else "cannot be found by Python"
    raise InvalidInput(name, None, f"is an installed library whose package {module!r} {found}; install it anew, or ask its authors")


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint that names the valid names nearest to a mistyped one."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}?" if close else f"expected one of {', '.join(map(repr, known))}"


def member_of(path: Path) -> tuple[Path, int] | None:
    """The family's file and the size that a member's path stands for; None for a path of its own."""
    match = _MEMBER.fullmatch(path.stem)
    if match is None or path.exists():
        return None
    writer = path.with_name(match["family"] + ".py")
    return (writer, int(match["size"])) if writer.is_file() else None


def sizes(path: Path) -> tuple[int, ...]:
    """The sizes a family's system file lists in ``SIZES``, read without running it; () for a single system."""
    try:
        source = path.read_bytes()
    except OSError:
        return ()
    return _listed_sizes(source) if b"SIZES" in source else ()


@functools.lru_cache(maxsize=64)
def _listed_sizes(source: bytes) -> tuple[int, ...]:
    try:
        for node in ast.parse(source).body:
            if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["SIZES"]:
                return tuple(int(size) for size in ast.literal_eval(node.value) if int(size) > 0)
    except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
        return ()
    return ()
