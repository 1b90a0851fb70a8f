"""The disk cache may be cold, damaged, foreign or unwritable, and system files broken in any way."""

from __future__ import annotations

import base64
import dataclasses
import errno
import hashlib
import json
import os
import pickle
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.errors import InvalidSystem
from harness.lagrange import derivation
from harness.lagrange.derivation import degrees_of_freedom, derive_mechanism, load_mechanism, load_system
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import DEFAULT_RATES
from harness.storage import cache_directory, read_entry

NAME = "spring_damper"
SOURCE = (Library.built_in().systems / f"{NAME}.py").read_text(encoding="utf-8")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of this test's own."""
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def derivations(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the systems that were derived, not read from the cache."""
    names: list[str] = []
    original = derivation.derive_mechanism

    def derive(path: Path, name: str) -> Mechanism:
        names.append(name)
        return original(path, name)

    monkeypatch.setattr(derivation, "derive_mechanism", derive)
    return names


def library_of(directory: Path, **files: str | bytes) -> Library:
    """A library with the given system files."""
    (directory / "systems").mkdir(parents=True)
    for name, text in files.items():
        (directory / "systems" / f"{name}.py").write_bytes(text if isinstance(text, bytes) else text.encode())
    return Library.at(directory)


def entries(cache: Path) -> list[Path]:
    return sorted((cache / "mechanisms").iterdir())


def essence(mechanism: Mechanism) -> Mechanism:
    """The mechanism but for what its derivation happened to cost."""
    return dataclasses.replace(mechanism, derivation_seconds=0.0)


def test_the_second_load_hits_the_cache(cache: Path, derivations: list[str]) -> None:
    first = load_mechanism(Library.built_in(), NAME)
    assert derivations == [NAME]
    assert len(entries(cache)) == 1
    # Equal in every part, what the derivation cost included.
    assert load_mechanism(Library.built_in(), NAME) == first
    assert derivations == [NAME]


@pytest.mark.ci
def test_a_warm_load_imports_no_heavy_library(cache: Path) -> None:
    program = (
        "import sys; from harness.lagrange.derivation import load_mechanism; from harness.library import Library;"
        f"load_mechanism(Library.built_in(), {NAME!r}); print([m for m in ('sympy', 'heyoka', 'flint', 'mujoco') if m in sys.modules])"
    )

    def modules() -> str:
        return subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=120).stdout.strip()

    assert "'sympy'" in modules()
    assert modules() == "[]"


def test_mechanisms_survive_json(built_in_mechanism: Mechanism) -> None:
    again = Mechanism.from_json(built_in_mechanism.to_json())
    assert again == built_in_mechanism
    assert again.key == built_in_mechanism.key
    assert hash(again.key) == hash(built_in_mechanism.key)


def test_a_mechanism_says_what_its_system_file_says() -> None:
    mechanism = load_mechanism(Library.built_in(), "cart_pendulum")
    assert mechanism.coordinates == ("x", "theta")
    assert mechanism.joints == ("slide", "pin")
    assert ("k", 270.0, "N/m") in mechanism.parameters
    assert mechanism.gravity == 9.81
    assert mechanism.total_mass == 11.0
    assert mechanism.position_ranges == ((-0.1, 0.1), None)
    assert mechanism.rate_ranges == (DEFAULT_RATES, DEFAULT_RATES)
    assert mechanism.description.startswith("Pendulum on a sprung sliding cart")
    assert mechanism.source == "The Euler-Lagrange equations (chapter 7.9), example 4."
    assert mechanism.nv == 2


class Intruder:
    """Creates a file when it is unpickled."""

    def __init__(self, witness: Path) -> None:
        self.witness = witness

    def __reduce__(self) -> Any:
        return Path.touch, (self.witness,)


def sealed(payload: str) -> bytes:
    """A payload under its right digest, as somebody who knows the format would write it."""
    return f"{hashlib.sha256(payload.encode()).hexdigest()}\n{payload}".encode()


def changed(make: Callable[[dict[str, Any]], dict[str, Any]]) -> Callable[[bytes], bytes]:
    """A sound entry with other parts, which ``make`` gives from its own, under its right digest."""

    def change(sound: bytes) -> bytes:
        parts = json.loads(sound.partition(b"\n")[2])
        return sealed(json.dumps(parts | make(parts)))

    return change


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda sound: b"",
    "half": lambda sound: sound[: len(sound) // 2],
    "last byte lost": lambda sound: sound[:-1],
    "first byte lost": lambda sound: sound[1:],
    "one bit of the payload": lambda sound: sound[:200] + bytes([sound[200] ^ 1]) + sound[201:],
    "one bit of the digest": lambda sound: bytes([sound[0] ^ 1]) + sound[1:],
    "bytes that are no text": lambda sound: b"\xff\xfe" + sound,
    "foreign object": lambda sound: sealed('{"hello": "world"}'),
    "foreign list": lambda sound: sealed("[1, 2, 3]"),
    "foreign number": lambda sound: sealed("12"),
    "no JSON": lambda sound: sealed("import os"),
    "deeply nested": lambda sound: sealed("[" * 100_000),
    "part missing": lambda sound: sealed(json.dumps({k: v for k, v in json.loads(sound.partition(b"\n")[2]).items() if k != "joints"})),
    "another name": changed(lambda parts: {"name": "collar"}),
    "number beyond float64": changed(lambda parts: {"parameters": [["m", 10**400, "kg"]]}),
    "number as text": changed(lambda parts: {"gravity": "9.81"}),
    "joint too many": changed(lambda parts: {"joints": ["slide", "pin"]}),
    "attitude that does not fit": changed(lambda parts: {"attitudes": [0]}),
    "start too long": changed(lambda parts: {"start": [[0.0, 0.0], [0.0, 0.0]]}),
    "start that is no number": changed(lambda parts: {"start": [[float("nan"), 0.0]]}),
    "load too many": changed(lambda parts: {"static_loads": [0.0, 0.0]}),
    "energies missing": changed(lambda parts: {"energy_programs": []}),
    "equations for energies": changed(lambda parts: {"energy_programs": [parts["program"]]}),
    "program of another system": changed(
        lambda parts: {"program": msgspec.to_builtins(load_mechanism(Library.built_in(), "arm_2r").program)}
    ),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_entry_is_derived_again_and_replaced(cache: Path, derivations: list[str], damage: str) -> None:
    sound = load_mechanism(Library.built_in(), NAME)
    (entry,) = entries(cache)
    damaged = DAMAGE[damage](entry.read_bytes())
    entry.write_bytes(damaged)
    derivations.clear()
    assert essence(load_mechanism(Library.built_in(), NAME)) == essence(sound)
    assert derivations == [NAME]
    assert entry.read_bytes() != damaged
    load_mechanism(Library.built_in(), NAME)
    assert derivations == [NAME]


@pytest.mark.parametrize("wrap", [lambda data: data, base64.b64encode, lambda data: sealed(data.decode("latin-1"))])
def test_a_pickle_in_the_cache_is_never_run(cache: Path, tmp_path: Path, wrap: Any) -> None:
    sound = load_mechanism(Library.built_in(), NAME)
    (entry,) = entries(cache)
    witness = tmp_path / "witness"
    entry.write_bytes(wrap(pickle.dumps(Intruder(witness))))
    assert essence(load_mechanism(Library.built_in(), NAME)) == essence(sound)
    assert not witness.exists()


@given(st.data())
@settings(max_examples=100)
def test_any_flipped_bit_is_noticed(data: st.DataObject) -> None:
    entries = list((cache_directory() / "mechanisms").glob(f"{NAME}-*.json"))
    if len(entries) != 1:
        # Other tests leave entries of other libraries' systems of this name.
        for left in entries:
            left.unlink()
        load_mechanism(Library.built_in(), NAME)
    (entry,) = (cache_directory() / "mechanisms").glob(f"{NAME}-*.json")
    sound = bytearray(entry.read_bytes())
    place = data.draw(st.integers(0, len(sound) - 1))
    damaged = bytearray(sound)
    damaged[place] ^= 1 << data.draw(st.integers(0, 7))
    try:
        entry.write_bytes(damaged)
        assert read_entry(entry) is None
    finally:
        entry.write_bytes(sound)
    assert read_entry(entry) is not None


def is_a_file(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.write_text("not a folder")


def is_read_only(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No mode bit stops root, who runs tests in containers; so what a read-only folder does is done by hand."""

    def refuse(*arguments: object, **options: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    cache.mkdir()
    monkeypatch.setattr(Path, "replace", refuse)


def has_a_folder_for_an_entry(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_mechanism(Library.built_in(), NAME)
    (entry,) = entries(cache)
    entry.unlink()
    entry.mkdir()


@pytest.mark.parametrize("spoil", [is_a_file, is_read_only, has_a_folder_for_an_entry])
def test_a_cache_that_cannot_be_written_costs_time_only(
    cache: Path, monkeypatch: pytest.MonkeyPatch, derivations: list[str], spoil: Callable[[Path, pytest.MonkeyPatch], None]
) -> None:
    spoil(cache, monkeypatch)
    derivations.clear()
    first, second = (load_mechanism(Library.built_in(), NAME) for _ in range(2))
    assert derivations == [NAME, NAME]
    assert essence(first) == essence(second)
    assert not cache.is_file() or cache.read_text() == "not a folder"


def test_the_cache_is_where_the_environment_says(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path / "own"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "shared"))
    assert cache_directory() == tmp_path / "own"
    monkeypatch.delenv("HARNESS_CACHE")
    assert cache_directory() == tmp_path / "shared" / "harness"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_directory() == tmp_path / "home" / ".cache" / "harness"


def test_an_edited_system_is_another_entry(cache: Path, tmp_path: Path, derivations: list[str]) -> None:
    library = library_of(tmp_path / "library", own=SOURCE)
    assert load_mechanism(library, "own").total_mass == 1.5
    library.system_path("own").write_text(SOURCE.replace("m: (1.5,", "m: (2.5,"))
    assert load_mechanism(library, "own").total_mass == 2.5
    library.system_path("own").write_text(SOURCE)
    assert load_mechanism(library, "own").total_mass == 1.5
    assert derivations == ["own", "own"]
    assert len(entries(cache)) == 2


WITH_HELPER = SOURCE.replace("from harness import", "from _values import MASS\nfrom harness import").replace("m: (1.5,", "m: (MASS,")


def test_an_edited_helper_is_another_entry(cache: Path, tmp_path: Path) -> None:
    library = library_of(tmp_path / "library", own=WITH_HELPER, _values="MASS = 3.0\n")
    assert load_mechanism(library, "own").total_mass == 3.0
    (library.systems / "_values.py").write_text("MASS = 40.0\n")
    assert load_mechanism(library, "own").total_mass == 40.0


def test_libraries_do_not_share_their_helpers(cache: Path, tmp_path: Path) -> None:
    """Two helpers of one name, in one process: each system gets the one beside it."""
    first, second = (library_of(tmp_path / str(mass), own=WITH_HELPER, _values=f"MASS = {mass}.0\n") for mass in (3, 4))
    assert load_mechanism(first, "own").total_mass == 3.0
    assert load_mechanism(second, "own").total_mass == 4.0
    assert "_values" not in sys.modules
    assert str(first.systems) not in sys.path


def test_loading_leaves_no_bytecode(tmp_path: Path) -> None:
    library = library_of(tmp_path / "library", own=WITH_HELPER, _values="MASS = 3.0\n")
    before = sys.dont_write_bytecode
    load_system(library.system_path("own"))
    assert sorted(path.name for path in library.systems.iterdir()) == ["_values.py", "own.py"]
    assert sys.dont_write_bytecode == before


def test_numbers_of_a_system_file_are_exact(tmp_path: Path) -> None:
    """In 53 bits the product ends one ulp off."""
    library = library_of(tmp_path / "library", own=SOURCE.replace("k * x**2 / 2", "k * 0.1 * 3.0 * 2 * x**2"))
    system, _ = load_system(library.system_path("own"))
    [k] = [symbol for symbol in system.parameters if symbol.name == "k"]
    [x] = system.coordinates
    assert system.potential.coeff(k * x**2) == sp.Rational(0.1) * 6 != sp.Rational(0.1 * 3.0 * 2)
    assert (k * 0.1).atoms(sp.Float), "SymPy is as it was"


def line_of(text: str, fragment: str) -> int:
    return text[: text.index(fragment)].count("\n") + 1


DECLARED = line_of(SOURCE, "SYSTEM = System(")
BROKEN: dict[str, tuple[str | bytes, int | None, str]] = {
    "syntax": (SOURCE.replace("x = dynamic", "x = = dynamic"), line_of(SOURCE, "x = dynamic"), "is not Python"),
    "unclosed bracket": (SOURCE.rstrip().removesuffix(")"), DECLARED, "is not Python.*never closed"),
    "no text": (b"\xff\xfe\x00", None, "is not Python"),
    "null byte": ('"""Source: x"""\0', None, "is not Python.*null byte"),
    "unknown encoding": ("# coding: nonsense\n", None, "is not Python"),
    "raises": (SOURCE.replace("SYSTEM =", "1 / 0\nSYSTEM ="), DECLARED, "raises ZeroDivisionError: division by zero"),
    "raises without a word": (SOURCE.replace("SYSTEM =", "assert False\nSYSTEM ="), DECLARED, "raises AssertionError: no message"),
    "leaves": (SOURCE.replace("SYSTEM =", "raise SystemExit(0)\nSYSTEM ="), DECLARED, "raises SystemExit"),
    "recurses": (SOURCE + "\ndef f():\n    return f()\nf()\n", SOURCE.count("\n") + 3, "raises RecursionError"),
    "imports nothing that exists": ("import no_such_module\n", 1, "raises ModuleNotFoundError: No module named 'no_such_module'"),
    "parses a bad string": (SOURCE.replace("SYSTEM =", "compile('1 +', '<string>', 'eval')\nSYSTEM ="), DECLARED, "raises SyntaxError"),
    "empty": ("", None, "defines no SYSTEM"),
    "no declaration": (SOURCE.replace("SYSTEM =", "system ="), None, "defines no SYSTEM"),
    "none": (SOURCE + "\nSYSTEM = None\n", None, "defines no SYSTEM"),
    "dictionary": (SOURCE.replace("SYSTEM = System(", "SYSTEM = dict("), DECLARED, "SYSTEM is a dict; expected a harness.System"),
    "class": ('"""Source: x"""\nSYSTEM = object\n', 2, "SYSTEM is a type"),
    "no docstring": (SOURCE.split('"""')[2], 1, "has no docstring with a 'Source:' line"),
    "docstring without source": (SOURCE.replace("Source:", "From:"), 1, "has no docstring with a 'Source:' line"),
    "contradiction": (SOURCE.replace("c: (0.7", "sp.Symbol('d'): (0.7"), DECLARED, "raises ValueError: generalised force on .* contains c"),
    "no such argument": (SOURCE.replace("total_mass=m", "mass=m"), DECLARED, "raises TypeError.*'mass'"),
    "range of texts": (SOURCE.replace("(-0.5, 0.5)", "(-0.5, '0.5')"), DECLARED, "raises"),
    "number beyond float64": (SOURCE.replace("(1.5,", "(10**400,"), DECLARED, "raises OverflowError"),
    "cubic kinetic energy": (SOURCE.replace("** 2 / 2", "** 3 / 2"), DECLARED, "cannot be derived: kinetic is not of second degree"),
    "cubic, with a type": (
        SOURCE.replace("** 2 / 2", "** 3 / 2").replace("SYSTEM =", "SYSTEM: System ="),
        DECLARED,
        "cannot be derived: kinetic is not of second degree",
    ),
    "no kernel": (SOURCE.replace("k * x**2 / 2", "k * sp.besselj(0, x)"), DECLARED, "cannot be derived: no kernel can evaluate besselj"),
    "value against its symbol": (SOURCE.replace("(1.5,", "(-1.5,"), DECLARED, "parameter m holds -1.5, and m is declared positive"),
    "complex": (SOURCE.replace("k * x**2 / 2", "sp.I * k * x"), DECLARED, "cannot be derived: no kernel can evaluate I"),
    "mass that grows": (SOURCE.replace("total_mass=m", "total_mass=m * TIME"), DECLARED, "cannot be derived"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_system_file_is_refused_at_its_line(cache: Path, tmp_path: Path, case: str) -> None:
    text, line, problem = BROKEN[case]
    library = library_of(tmp_path / "library", own=text)
    with pytest.raises(InvalidSystem, match=f"(?s){problem}") as caught:
        load_mechanism(library, "own")
    assert caught.value.path == library.system_path("own")
    assert caught.value.line == line
    assert not (cache / "mechanisms").exists()
    assert str(library.systems) not in sys.path


@pytest.mark.parametrize(
    ("helper", "problem", "file", "line"),
    [
        ("\n\nMASS = (\n", "is not Python", "_values", 3),
        ("\n" * 11 + "MASS = 1 / 0\n", "raises ZeroDivisionError", "own", line_of(WITH_HELPER, "from _values")),
    ],
    ids=["syntax", "exception"],
)
def test_a_helper_has_its_syntax_errors_and_who_calls_it_its_exceptions(
    tmp_path: Path, helper: str, problem: str, file: str, line: int
) -> None:
    library = library_of(tmp_path / "library", own=WITH_HELPER, _values=helper)
    with pytest.raises(InvalidSystem, match=problem) as caught:
        load_system(library.system_path("own"))
    assert (caught.value.path, caught.value.line) == (library.systems / f"{file}.py", line)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    library = library_of(tmp_path / "library")
    with pytest.raises(InvalidSystem, match="cannot be read: No such file") as caught:
        load_mechanism(library, "own")
    assert caught.value.path == library.system_path("own")


@pytest.mark.ci
def test_a_derivation_is_the_same_in_another_process(tmp_path: Path) -> None:
    """Hash randomisation must not reach the program, or cached and fresh results would round differently."""
    name = "cylindrical_arm"
    program = (
        "from harness.lagrange.derivation import derive_mechanism; from harness.library import Library; import json, msgspec;"
        f"print(json.dumps(msgspec.to_builtins(derive_mechanism(Library.built_in().system_path({name!r}), {name!r}).program)))"
    )

    seed = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    environment = os.environ | {"PYTHONHASHSEED": seed}
    process = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=120, env=environment)
    here = derive_mechanism(Library.built_in().system_path(name), name).program
    assert json.loads(process.stdout) == json.loads(json.dumps(msgspec.to_builtins(here)))


@pytest.mark.ci
def test_listing_derives_nothing(cache: Path, derivations: list[str]) -> None:
    library = Library.built_in()
    listed = {name: degrees_of_freedom(library, name) for name in library.system_names()}
    assert derivations == []
    mechanism = load_mechanism(library, NAME)
    assert listed[NAME] == (mechanism.nv, mechanism.description.splitlines()[0]) == degrees_of_freedom(library, NAME)


@pytest.mark.ci
def test_listing_costs_at_most_an_import_of_sympy_for_six_mechanisms(tmp_path: Path) -> None:
    """CPU seconds of processes on one machine, the library from an empty cache."""

    def cpu_seconds(*arguments: str) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        environment = {**os.environ, "HARNESS_CACHE": str(tmp_path)}
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True, env=environment, cwd=tmp_path)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    most = len(Library.built_in().system_names()) / 6 * cpu_seconds("-c", "import sympy.physics.mechanics")
    assert cpu_seconds("-m", "harness", "list") <= most
