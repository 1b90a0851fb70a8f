"""A USD stage as plain prims: each with its kind, its schemas and its values, composed over all layers, and the place of each.

Composition is that of OpenUSD, whose bindings are imported where a file is read. A place is the line of the layer that holds the strongest
opinion: of its text, and for binary layers of the text that ``usdcat`` prints of them.

Most attributes of UsdPhysics are float32. Their numbers are the shortest decimals that round to them, which are those that people and
converters wrote where they wrote up to seven digits.

Source: OpenUSD documentation, UsdPhysics, UsdGeom and UsdStage.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from harness.errors import InvalidModel, message_of, not_installed
from harness.files.document.layer_lines import ROOT, lines_of
from harness.files.document.xml import MAXIMUM_DEPTH, MAXIMUM_ELEMENTS, Document, irregular, shorten
from harness.files.given import Given, Place

MOST_BYTES = 500_000_000
_TEXT = b"#usda"
_FLOAT32 = re.compile(r"^(float|half|quatf|quath|(point|vector|normal|color)[34][fh]|matrix[234]f)")
_LOCATED = re.compile(r"(?:'|@|\s)(?P<path>[^'@\n]*?):(?P<line>\d+):\d+: (?P<what>.*?)(?:'?\s*$|\n)")


@dataclass(frozen=True)
class Property:
    """The value of an attribute or relationship: numbers, words (tokens, strings, paths of prims), or a truth value as 0 or 1."""

    place: Place
    numbers: tuple[float, ...] = ()
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Prim:
    """One prim.

    Attributes:
        path: "/arm/link". kind: of its schema, "" for none. schemas: that are applied, in their order, known to OpenUSD or not.
        name: that people read: its display name, else its own. parent: path. values: by the name of the property, of those authored.
    """

    path: str
    kind: str
    schemas: tuple[str, ...]
    name: str
    parent: str
    place: Place
    values: Mapping[str, Property]

    def numbers(self, name: str) -> tuple[Given, ...]:
        """The numbers of an attribute; none where no layer gives any."""
        value = self.values.get(name)
        return () if value is None else tuple(Given(number, value.place, name, at) for at, number in enumerate(value.numbers))

    def finite(self, name: str) -> tuple[Given, ...]:
        """``numbers``; none where one is not finite, as USD writes that there is none.

        Raises:
            InvalidModel: one is not a number, or the attribute holds words.
        """
        value = self.values.get(name)
        if value is not None and value.words:
            self.refuse(f"{name} is {shorten(' '.join(value.words))!r}; expected a number", name)
        if value is None or any(map(math.isinf, value.numbers)):
            return ()
        if any(map(math.isnan, value.numbers)):
            self.refuse(f"{name} is nan; expected a finite number", name)
        return self.numbers(name)

    def number(self, name: str) -> Given | None:
        """The only number of an attribute; None where no layer gives a finite one."""
        return next(iter(self.finite(name)), None)

    def word(self, name: str, default: str = "") -> str:
        value = self.values.get(name)
        return value.words[0] if value is not None and value.words else default

    def words(self, name: str) -> tuple[str, ...]:
        return self.values[name].words if name in self.values else ()

    def is_on(self, name: str, default: bool = True) -> bool:
        value = self.values.get(name)
        return bool(value.numbers[0]) if value is not None and value.numbers else default

    def at(self, name: str) -> Place:
        """The place of a property; of the prim where no layer gives it."""
        return self.values[name].place if name in self.values else self.place

    def refuse(self, problem: str, name: str = "") -> Any:
        """Raises InvalidModel at a property, or at the prim."""
        place = self.at(name)
        raise InvalidModel(place.path, place.line, f"<{self.path}> {problem}")


@dataclass(frozen=True)
class UsdDocument(Document):
    """A stage as a document of a root and one element for each prim.

    Attributes:
        prims: parents before their children. layer: metadata of the stage, as "metersPerUnit", with the place of each.
        layers: the files that it is composed of.
    """

    prims: tuple[Prim, ...] = ()
    layer: Mapping[str, Property] = field(default_factory=dict)
    layers: tuple[Path, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        return (self.path, *self.layers)


def read_stage(path: Path) -> UsdDocument:
    """The stage of a file.

    Raises:
        InvalidModel: no readable file of USD, or a layer that it is composed of is none; or the bindings of OpenUSD are not installed,
            or another package's have taken their place.
    """
    _refuse_irregular(path)
    usd = _bindings(path)
    # It takes the diagnostics that would be printed.
    delegate = usd.UsdUtils.CoalescingDiagnosticDelegate()
    try:
        _refuse_irregular_layers(usd, path)
        stage = usd.Usd.Stage.Open(str(path), usd.Usd.Stage.LoadAll)
        if problems := [str(problem) for problem in stage.GetCompositionErrors()]:
            told = f"is not composed: {shorten(problems[0])}; name a file that is there"
            raise InvalidModel(path, _line_of(path, problems[0]), told)
        return _Reader(usd, path, stage).document()
    except usd.Tf.ErrorException as error:
        raise _unreadable(path, message_of(error)) from None
    finally:
        # Warnings on what is no part of the composition are nobody's business here.
        delegate.TakeUncoalescedDiagnostics()
        del delegate


def _refuse_irregular(path: Path) -> None:
    try:
        if kind := irregular(path):
            raise InvalidModel(path, None, f"is {kind}; expected a USD file")
        size = path.stat().st_size
        path.open("rb").close()
    except FileNotFoundError:
        raise InvalidModel(path, None, "there is no such file; write the model, or correct the path") from None
    except (OSError, ValueError) as error:
        raise InvalidModel(path, None, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not size:
        raise InvalidModel(path, None, 'is empty; expected a robot in USD, which begins with "#usda 1.0"')
    if size > MOST_BYTES:
        raise InvalidModel(path, None, f"is larger than {MOST_BYTES} bytes; leave meshes in layers of their own")


def _bindings(path: Path) -> Any:
    """The modules of ``pxr`` under one name."""
    try:
        from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdUtils
    except ModuleNotFoundError as error:
        if error.name == "pxr":
            raise InvalidModel(path, None, f"is read by OpenUSD: {not_installed('pxr')}") from None
        raise _foreign(path, error) from None
    except (ImportError, AttributeError) as error:
        raise _foreign(path, error) from None
    modules = {one.__name__.rpartition(".")[2]: one for one in (Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdUtils)}
    return type("Bindings", (), modules)


def _foreign(path: Path, error: BaseException) -> InvalidModel:
    found = f"is read by OpenUSD, whose bindings cannot be imported ({shorten(message_of(error))})"
    return InvalidModel(
        path,
        None,
        f"{found}; usd-core and another package that brings a pxr, as usd-exchange does, break each other: install the harness's extra usd "
        "in an environment without that",
    )


def _refuse_irregular_layers(usd: Any, path: Path) -> None:
    """Refuse layers that are FIFOs, devices or directories before anything opens them; one that is not there is told later."""
    seen, waiting = {path.resolve()}, [path]
    while waiting:
        one = waiting.pop()
        try:
            # A process that reads a file again has another one perhaps.
            if (known := usd.Sdf.Layer.Find(str(one.resolve()))) is not None:
                known.Reload(True)
            layer = usd.Sdf.Layer.FindOrOpen(str(one))
        except usd.Tf.ErrorException as error:
            raise _unreadable(one, message_of(error)) from None
        # A reference into the same layer names none.
        for name in filter(None, layer.GetCompositionAssetDependencies() if layer else ()):
            other = Path(layer.ComputeAbsolutePath(name))
            if other.resolve() in seen or not other.exists():
                continue
            seen.add(other.resolve())
            if kind := irregular(other):
                raise InvalidModel(one, _line_of(one, name), f"@{shorten(name)}@ is {kind}; expected a layer of USD")
            if len(seen) > MAXIMUM_DEPTH:
                raise InvalidModel(one, None, f"is composed of more than {MAXIMUM_DEPTH} layers; no robot needs that many")
            waiting.append(other)


def _unreadable(path: Path, words: str) -> InvalidModel:
    located = _LOCATED.search(words)
    if located is None:
        return InvalidModel(path, None, f"is no USD file that OpenUSD reads: {shorten(words)}; restore the file")
    at, what = Path(located["path"]), shorten(located["what"])
    if "pxrInternal" in what:
        what = "OpenUSD cannot parse what stands there"
    own = path if at.name == path.name else at
    return InvalidModel(own, int(located["line"]), f"is not well-formed USD: {what}; correct it, or restore the file")


def _line_of(path: Path, problem: str) -> int | None:
    """The line of the text of a file that holds the asset that a problem names; None where none does."""
    asset = re.search(r"@([^@]*)@", problem)
    name = Path(asset[1]).name if asset else Path(problem).name
    with path.open("rb") as file:
        if file.read(len(_TEXT)) != _TEXT or not name:
            return None
        return next((number for number, line in enumerate(file, 1) if name.encode() in line), None)


class _Reader:
    """Reads the prims of one stage."""

    def __init__(self, usd: Any, path: Path, stage: Any) -> None:
        self._usd, self._path, self._stage, self._numbers = usd, path, stage, dict[str, int]()
        self._lines = cache(self._lines_of_layer)

    def document(self) -> UsdDocument:
        usd = self._usd
        root = etree.Element("usd")
        elements, prims = {root: 1}, list[Prim]()
        for prim in self._stage.Traverse(usd.Usd.TraverseInstanceProxies(usd.Usd.PrimDefaultPredicate)):
            path = str(prim.GetPath())
            if len(prims) > MAXIMUM_ELEMENTS or path.count("/") > MAXIMUM_DEPTH:
                raise InvalidModel(self._path, None, f"<{shorten(path)}> is prim {len(prims)}; no robot needs so many, or so deep ones")
            one = self._prim(prim, path, len(prims) + 1)
            prims.append(one)
            element = etree.SubElement(root, "prim", name=one.path, schemas=" ".join(one.schemas))
            elements[element] = one.place.line
        layers = tuple(Path(layer.realPath) for layer in self._stage.GetUsedLayers() if layer.realPath)
        return UsdDocument(self._path, "", root, elements, prims=tuple(prims), layer=self._metadata(), layers=layers)

    def _prim(self, prim: Any, path: str, number: int) -> Prim:
        specs = [spec for spec in prim.GetPrimStack() if str(spec.specifier) == "Sdf.SpecifierDef"] or prim.GetPrimStack()
        place = self._place(specs[0].layer, str(specs[0].path), number, path) if specs else Place(self._path, 1, number, path)
        # Schemas that OpenUSD does not know are not among those that it says are applied.
        listed = prim.GetMetadata("apiSchemas")
        schemas = tuple(map(str, listed.ApplyOperations([]))) if listed is not None else ()
        values = {}
        for property in prim.GetAuthoredProperties():
            if (value := self._value(property, number, path)) is not None:
                values[str(property.GetName())] = value
        return Prim(path, str(prim.GetTypeName()), schemas, prim.GetDisplayName() or prim.GetName(), path.rpartition("/")[0], place, values)

    def _value(self, property: Any, number: int, path: str) -> Property | None:
        """The value of a property; None where it has none, or one that no reading asks for."""
        usd = self._usd
        stack = property.GetPropertyStack(usd.Usd.TimeCode.Default())
        if not stack:
            return None
        if isinstance(property, usd.Usd.Relationship):
            # One layer may say attribute where another says relationship.
            lists = [(spec, getattr(spec, "targetPathList", None)) for spec in stack]
            strongest = next((spec for spec, listed in lists if listed is not None and listed.GetAppliedItems()), stack[0])
            place = self._place(strongest.layer, str(strongest.path), number, path)
            return Property(place, words=tuple(map(str, property.GetTargets())))
        if property.GetTypeName().isArray and property.GetName().partition(":")[0] not in ("newton", "mjc", "xformOpOrder"):
            # Meshes.
            return None
        found = property.Get()
        if found is None:
            return None
        strongest = next((spec for spec in stack if getattr(spec, "HasDefaultValue", bool)()), stack[0])
        place = self._place(strongest.layer, str(strongest.path), number, path)
        return _value(place, found, str(property.GetTypeName()))

    def _metadata(self) -> dict[str, Property]:
        layer, found = self._stage.GetRootLayer(), {}
        for name in ("metersPerUnit", "kilogramsPerUnit", "upAxis"):
            if self._stage.HasAuthoredMetadata(name):
                place = self._place(layer, f"{ROOT}.{name}", 0, ROOT)
                found[name] = _value(place, self._stage.GetMetadata(name), "double")
        return found

    def _place(self, layer: Any, path: str, number: int, prim: str) -> Place:
        # Of a property that a variant gives, its path names the variants.
        file, lines = self._lines(layer.identifier)
        return Place(file, lines.get(path, lines.get(path.partition(".")[0], 1)), number, prim)

    def _lines_of_layer(self, identifier: str) -> tuple[Path, Mapping[str, int]]:
        layer = self._usd.Sdf.Layer.Find(identifier)
        file = Path(layer.realPath or str(self._path))
        if file.is_file():
            file = self._path if file.resolve() == self._path.resolve() else file
            with file.open("rb") as opened:
                if opened.read(len(_TEXT)) == _TEXT:
                    return file, lines_of(file.read_text(encoding="utf-8", errors="replace"))
        return file, lines_of(layer.ExportToString())


def _value(place: Place, found: Any, kind: str) -> Property:
    if isinstance(found, bool | int | float):
        numbers = [float(found)]
    elif isinstance(found, str):
        return Property(place, words=(found,))
    elif hasattr(found, "GetReal"):
        numbers = [float(found.GetReal()), *map(float, found.GetImaginary())]
    else:
        parts = list(found) if hasattr(found, "__len__") else []
        if parts and isinstance(parts[0], str):
            return Property(place, words=tuple(map(str, parts)))
        flat: list[Any] = [value for part in parts for value in (part if hasattr(part, "__len__") else (part,))]
        if not all(isinstance(value, int | float) for value in flat):
            return Property(place)
        numbers = [float(value) for value in flat]
    if _FLOAT32.match(kind):
        numbers = [shortest(number) for number in numbers]
    return Property(place, numbers=tuple(numbers))


def shortest(number: float) -> float:
    """The float64 of the shortest decimal that rounds to a number of float32; of others, themselves."""
    single = np.float32(number)
    return float(str(single)) if float(single) == number and math.isfinite(number) else number


def applied(prims: Mapping[str, Prim], path: str, schema: str) -> Iterator[Prim]:
    """The prims at a path and above it, the nearest first, that a schema is applied to."""
    while path:
        if (prim := prims.get(path)) is not None and schema in prim.schemas:
            yield prim
        path = path.rpartition("/")[0]
