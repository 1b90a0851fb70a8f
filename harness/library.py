"""Libraries: folders with ``systems/``, ``mjcf/`` and ``urdf/`` in which mechanisms are found by file name.

The built-in library keeps its systems inside the package and its models at the top level of the
repository; in an installed wheel the models lie inside the package too. A library may also hold
``engines/`` of its own and an ``expected_verdicts.toml``.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from harness.errors import InvalidInput, InvalidRequest

MODEL_SUFFIXES = {"mjcf": ".xml", "urdf": ".urdf"}
BUILT_IN_NAME = "built-in"
_PACKAGE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Library:
    """Where the files of one library are. Picklable; reads nothing until asked."""

    name: str
    systems: Path
    models: Path
    engines: Path
    expected_verdicts: Path

    @classmethod
    def built_in(cls) -> Library:
        """The textbook mechanisms that come with the harness."""
        models = _PACKAGE if (_PACKAGE / "mjcf").is_dir() else _PACKAGE.parent
        return cls(BUILT_IN_NAME, _PACKAGE / "systems", models, _PACKAGE / "engines", _PACKAGE / "expected_verdicts.toml")

    @classmethod
    def at(cls, directory: Path | str | None) -> Library:
        """The library in ``directory``, or the built-in one for None.

        Raises:
            InvalidInput: there is no such directory, or it has no ``systems`` folder.
        """
        if directory is None:
            return cls.built_in()
        root = Path(directory).resolve()
        if not root.is_dir():
            raise InvalidInput(directory, None, "no such directory; expected a library with systems/, mjcf/ and urdf/")
        if not (root / "systems").is_dir():
            raise InvalidInput(directory, None, "holds no systems/ folder; expected a library with systems/, mjcf/ and urdf/")
        return cls(root.name, root / "systems", root, root / "engines", root / "expected_verdicts.toml")

    def system_names(self) -> list[str]:
        """Names of all systems, sorted; files that begin with an underscore are helpers, not systems."""
        return sorted(path.stem for path in self.systems.glob("*.py") if not path.stem.startswith("_"))

    def select(self, names: Iterable[str]) -> list[str]:
        """``names`` as given, or every system for none.

        Raises:
            InvalidRequest: a name no system has; the message gives the nearest one.
            InvalidInput: the library holds no system at all.
        """
        known = self.system_names()
        if not known:
            raise InvalidInput(self.systems, None, "holds no system file; expected systems/<name>.py")
        chosen = list(dict.fromkeys(names))
        for name in chosen:
            if name not in known:
                raise InvalidRequest(f"no system is called {name!r}; {nearest(name, known)}")
        return chosen or known

    def system_path(self, name: str) -> Path:
        return self.systems / f"{name}.py"

    def model_path(self, name: str, model_format: str) -> Path:
        return self.models / model_format / f"{name}{MODEL_SUFFIXES[model_format]}"

    def orphaned_models(self) -> list[Path]:
        """Model files that no system stands behind."""
        systems = set(self.system_names())
        files = [path for name, suffix in MODEL_SUFFIXES.items() for path in sorted((self.models / name).glob(f"*{suffix}"))]
        return [path for path in files if path.stem not in systems]


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint that names the valid names nearest to a mistyped one."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}?" if close else f"expected one of {', '.join(map(repr, known))}"
