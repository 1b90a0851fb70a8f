"""Verdicts that are expected to be other than ``agrees``: one file, each entry with its reason.

``expected_verdicts.toml`` of a library holds ``[[expected]]`` tables with ``system``, ``subject``,
``verdict``, ``reason``, ``link`` and ``backward_error``, the largest that the reason explains. An entry with the verdict
``explained``, ``unstable``, ``misreads`` or ``disagrees`` also bounds what the reason explains of the sampled states: the
``median_backward_error``, and the ``share`` of them that do not agree. A second fault shows beside it.
An entry with the verdict ``unsupported`` has no backward error, and excuses the subject's model where that is missing. One with
``misreads`` has none where the reader leaves joints out, so that nothing can be compared.
An entry with a ``quantity`` is about that alone. One without is about accelerations, and where it says ``unsupported`` or ``misreads``
about all quantities: what cannot be asked for accelerations can seldom be asked for anything. One with ``versions``, a specifier as
"<3.7", is about those versions of the subject's engine alone, asked by name as ``engine@version``. A list in place of a system or subject
stands for a table for each of them.

``[[differs]]`` tables beside them are of what engines do not hold alike after loading (``held``), with ``system``, ``quantity``,
``joint``, ``ulps``, the largest difference that the reason explains, ``reason`` and ``link``.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

import msgspec
from msgspec import structs
from packaging.specifiers import InvalidSpecifier, SpecifierSet

from harness.engines import Subject, engine_files, known_subjects
from harness.environments import split_name
from harness.errors import InvalidInput
from harness.library import FILE_SUFFIXES, MODEL_SUFFIXES, Library, nearest
from harness.results.records import ACCELERATIONS, quantity_words
from harness.truth.quantities import find_quantities
from harness.verdict import SEVERITY, Verdict

Text = Annotated[str, msgspec.Meta(min_length=1)]


# Tables of a library's file.
TABLES = ("expected", "differs")
# Fields of an entry that are no texts.
_NUMBERS = ("backward_error", "median_backward_error", "share")
# Verdicts whose entries have all of them.
_BOUNDED = (Verdict.EXPLAINED, Verdict.UNSTABLE, Verdict.MISREADS, Verdict.DISAGREES)


class TableOfReasons(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One table of a file of expectations.

    Attributes:
        KEY: the fields that no two tables of a file share. FIELDS: what its fields must be, for the message where they are not.
    """

    KEY: ClassVar[tuple[str, ...]]
    FIELDS: ClassVar[str]

    @property
    def key(self) -> tuple[str, ...]:
        return tuple(getattr(self, name) for name in self.KEY)

    def __str__(self) -> str:
        return ", ".join(self.key)


class Entry(TableOfReasons, frozen=True, kw_only=True):
    """One ``[[expected]]`` table; those of a file say in further fields what they are about."""

    FIELDS = f"none empty, and {_NUMBERS[0]}"
    subject: Text
    verdict: Text
    reason: Text
    link: Text
    quantity: str = ""
    backward_error: float | None = None
    median_backward_error: float | None = None
    share: Annotated[float, msgspec.Meta(ge=0, le=1)] | None = None

    @property
    def about(self) -> str:
        """The quantity that it bounds."""
        return self.quantity or ACCELERATIONS

    @property
    def key(self) -> tuple[str, ...]:
        """See ``TableOfReasons``; an entry without a quantity and one about accelerations are about the same answers."""
        return tuple(self.about if name == "quantity" else getattr(self, name) for name in self.KEY)

    @property
    def limit(self) -> float:
        """The largest backward error that the reason explains; infinite where answers are not compared, none where joints are missing."""
        if self.backward_error is None:
            return 0.0 if self.verdict == Verdict.MISREADS else math.inf
        return self.backward_error

    @property
    def median_limit(self) -> float:
        """The largest median backward error that the reason explains."""
        return math.inf if self.median_backward_error is None else self.median_backward_error

    @property
    def share_limit(self) -> float:
        """The largest share of states that do not agree that the reason explains."""
        return 1.0 if self.share is None else self.share


class Expectation(Entry, frozen=True, kw_only=True):
    """A table about a system; its verdict holds up to ``limit``, so that a fault still shows beside it."""

    KEY = ("system", "subject", "quantity", "versions")
    system: Text
    versions: str = ""


class ExpectedDifference(TableOfReasons, frozen=True, kw_only=True):
    """One ``[[differs]]`` table: what subjects of a system do not hold alike after loading, up to ``ulps``."""

    KEY = ("system", "quantity", "joint")
    FIELDS = "and ulps"
    system: Text
    quantity: Text
    joint: str
    ulps: Annotated[float, msgspec.Meta(gt=0)]
    reason: Text
    link: Text

    def __str__(self) -> str:
        return f"{self.system}, {self.quantity} of {self.joint!r}"


# Of a pair without an entry.
AGREES = Expectation(system="", subject="", verdict=Verdict.AGREES.value, reason="", link="")
# Verdicts on a user's file that need no entry, with the reason: the file is the truth itself, of which these are an explanation.
_ON_FILES = {
    Verdict.MISREADS.value: "it is the answer for what the engine's reader, as one of its readings says, makes of the file",
    Verdict.EXPLAINED.value: "it is the answer for what the engine's readings make of the file",
    Verdict.UNSTABLE.value: "digits are lost as the condition of M, or the distance of its links, explains, and no number of the file does",
}


def on_file(expectation: Expectation, verdict: str) -> Expectation:
    """The expectation of an answer on a user's file."""
    if expectation is AGREES and verdict in _ON_FILES:
        return structs.replace(AGREES, verdict=verdict, reason=_ON_FILES[verdict], backward_error=math.inf)
    return expectation


_Table = TypeVar("_Table", bound=TableOfReasons)
_Entry = TypeVar("_Entry", bound=Entry)


def _read_tables(
    path: Path, kind: type[_Table], known: Mapping[str, Collection[str]], tables: Sequence[str], name: str
) -> Iterator[tuple[str, _Table]]:
    """The tables ``[[name]]`` of a file, which may have ``tables``, each with its place in words; raises as ``read_entries``."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidInput(path, None, f"cannot be read as TOML: {error}") from error
    written = {one: data.pop(one, []) for one in tables}
    if data or not all(isinstance(one, list) for one in written.values()):
        raise InvalidInput(path, None, f"holds something other than {' and '.join(f'[[{one}]]' for one in tables)} tables")
    keys = set()
    # A list stands for several entries of verdicts alone.
    listed = kind.KEY if issubclass(kind, Entry) else ()
    for number, table in [(number, one) for number, several in enumerate(written[name], start=1) for one in _each(several, listed)]:
        where = f"[[{name}]] number {number}"
        try:
            entry = msgspec.convert(table, kind)
        except msgspec.ValidationError as error:
            texts = ", ".join(one for one in kind.__struct_fields__ if one not in (*_NUMBERS, "ulps"))
            raise InvalidInput(path, None, f"{where}: {error}; expected the texts {texts}, {kind.FIELDS}") from error
        for field_name, values in known.items():
            if (value := getattr(entry, field_name)) not in values:
                raise InvalidInput(path, None, f"{where} names {field_name} {value!r}, which does not exist; {nearest(value, values)}")
        if entry.key in keys:
            raise InvalidInput(path, None, f"{where} repeats {entry}")
        keys.add(entry.key)
        yield where, entry


def read_entries(
    path: Path, kind: type[_Entry], known: Mapping[str, Collection[str]], compared: Collection[str], tables: Sequence[str] = ("expected",)
) -> list[_Entry]:
    """The ``[[expected]]`` tables of a file.

    ``known`` holds the values that a field may have; an entry bounds answers where its verdict is one of ``compared``.
    ``tables`` are the names of all tables that the file may have.

    Raises:
        InvalidInput: the file is malformed, or an entry names what does not exist.
    """
    entries = []
    for where, entry in _read_tables(path, kind, known, tables, "expected"):
        given = [name for name in _NUMBERS if getattr(entry, name) is not None]
        wanted = [name for name in _NUMBERS[: 3 if entry.verdict in _BOUNDED else 1] if entry.verdict in compared]
        if given != wanted and (given or entry.verdict != Verdict.MISREADS):
            rest = " and ".join(wanted) or f"no {' and no '.join(given)}, for what is {entry.verdict} is not compared"
            raise InvalidInput(path, None, f"{where} must have {rest}")
        entries.append(entry)
    return entries


def of_quantity(entries: Iterable[Any], quantity: str) -> list[Any]:
    """The entries about a quantity; those that name none and say ``unsupported`` or ``misreads`` are about all."""
    of_any = (Verdict.UNSUPPORTED, Verdict.MISREADS)
    everywhere = [one for one in entries if one.verdict in of_any and not one.quantity and quantity_words(quantity)]
    return [*(structs.replace(one, **dict.fromkeys(_NUMBERS)) for one in everywhere), *(one for one in entries if one.about == quantity)]


@dataclass(frozen=True)
class Expectations:
    """The expectations of one quantity, by (label of a system, subject), and those of some versions."""

    entries: Mapping[tuple[str, str], Expectation] = field(default_factory=dict)
    of_versions: Sequence[Expectation] = ()

    def of(self, system: str, subject: Subject | str) -> Expectation:
        """That of a subject on a system, by its label; a version without an entry has that of its engine, what has none ``AGREES``."""
        name, slash, model_format = str(subject).partition("/")
        engine, version = split_name(name)
        key = system, engine + slash + model_format
        for entry in self.of_versions:
            if version and (entry.system, entry.subject) == key and version in SpecifierSet(entry.versions):
                return entry
        return self.entries.get(key, AGREES)

    def why_no_model(self, library: Library, system: str, subject: Subject) -> str:
        """The reason that a subject has no model of a system to read: that of its entry, where that says ``unsupported``.

        "" where the model exists, where the subject needs none, and where no entry excuses that it is missing. For an engine of an
        environment, an entry of any reader of the format does: there are no entries for every engine that somebody adds.
        """
        if subject.format not in MODEL_SUFFIXES or library.has_model(system, subject.format):
            return ""
        label = library.label(system)
        entries = [self.of(label, subject)]
        if engine_files(library)[subject.engine].elsewhere:
            entries += [one for (of, name), one in self.entries.items() if of == label and name.endswith(f"/{subject.format}")]
        return next((one.reason for one in entries if one.verdict == Verdict.UNSUPPORTED), "")


def _each(table: Mapping[str, Any], key: Collection[str]) -> Iterator[Mapping[str, Any]]:
    """A table, or one for each choice of the values that are listed under fields of ``key``."""
    listed = {name: table[name] for name in key if isinstance(table.get(name), list)}
    for chosen in itertools.product(*listed.values()):
        yield {**table, **dict(zip(listed, chosen, strict=True))}


def _labels(library: Library) -> list[str]:
    """Systems that an entry may name: every robot of a folder, as a run need not be about all of them."""
    if not library.reads_files:
        return [*library.system_names(), *library.variant_names()]
    own = library.system_names()
    return sorted(path.name for path in library.systems.iterdir() if path.suffix in FILE_SUFFIXES or str(path) in own)


def load_expectations(library: Library, quantity: str = ACCELERATIONS) -> Expectations:
    """Expectations of a quantity; raises as ``expectations_by_quantity``."""
    return expectations_by_quantity(library, [quantity])[quantity]


def expectations_by_quantity(library: Library, quantities: Iterable[str]) -> dict[str, Expectations]:
    """Expectations of each quantity; none where the library has no such file.

    Raises:
        InvalidInput: the file is malformed, or an entry names a system or subject that does not exist any more.
    """
    if not library.expected_verdicts.is_file():
        return {quantity: Expectations() for quantity in quantities}
    known = {
        "system": _labels(library),
        "subject": list(map(str, known_subjects(library))),
        "verdict": SEVERITY,
        "quantity": ["", *find_quantities()],
    }
    compared = [verdict for verdict in SEVERITY if verdict != Verdict.UNSUPPORTED]
    entries = read_entries(library.expected_verdicts, Expectation, known, compared, TABLES)
    for entry in entries:
        try:
            SpecifierSet(entry.versions)
        except InvalidSpecifier as error:
            problem = f'versions = {entry.versions!r} of {entry.subject} on {entry.system} is no specifier; expected one as "<3.7"'
            raise InvalidInput(library.expected_verdicts, None, problem) from error
    return {quantity: _expectations(of_quantity(entries, quantity)) for quantity in quantities}


def _expectations(entries: Sequence[Expectation]) -> Expectations:
    own = {(entry.system, entry.subject): entry for entry in entries if not entry.versions}
    return Expectations(own, [entry for entry in entries if entry.versions])


def load_expected_differences(library: Library, quantities: Collection[str]) -> dict[str, list[ExpectedDifference]]:
    """The ``[[differs]]`` tables of a library about these quantities, by system.

    Raises:
        InvalidInput: the file is malformed, or a table names what does not exist, or what another names.
    """
    path, found = library.expected_verdicts, dict[str, list[ExpectedDifference]]()
    known = {"system": library.system_names(), "quantity": quantities}
    for _, entry in _read_tables(path, ExpectedDifference, known, TABLES, "differs") if path.is_file() else ():
        found.setdefault(entry.system, []).append(entry)
    return found
