"""The systems that tests run over, and which of them and of the robots stand for the others; it imports nothing that takes long."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from lxml import etree

from harness.engines import Subject
from harness.explain.as_read import misread_by
from harness.files.document.xml import read_text
from harness.files.model_file import read_model
from harness.library import MODEL_SUFFIXES, Library, member_of, robots_folder
from harness.programs.mechanisms.mechanism import Mechanism

Name = TypeVar("Name", str, Path)

BUILT_IN = Library.built_in()
# For tests that look into an engine's own model.
CALLED_HERE = replace(BUILT_IN, calls_engines_here=True)
STATES = 100


def text_of(name: str, library: Library = BUILT_IN) -> str:
    """The text of a system's file, or of its family's."""
    path = library.system_path(name)
    member = member_of(path)
    return (path if member is None else member[0]).read_text(encoding="utf-8")


def turns_freely(name: str) -> bool:
    """Whether a built-in system has a ball or free joint, whose positions and velocities are not those of its text."""
    return "Attitude(" in text_of(name)


def is_tied(name: str, library: Library = BUILT_IN) -> bool:
    """Whether a system has constraints beside its joints; without deriving it, since every process asks while it collects the tests."""
    return "constraints=" in text_of(name, library)


def is_bounded(name: str) -> bool:
    """Whether a system has dry friction or limits, as ``is_tied``."""
    return any(word in text_of(BUILT_IN.system_of(name)) for word in ("dry_friction=", "limits="))


# Systems whose joints carry their coordinates themselves.
PLAIN = [name for name in BUILT_IN.system_names() if not turns_freely(name)]
VARIANTS = BUILT_IN.variant_names()
# Every model file: of a system's own and of its variants.
MODELS = [
    (name, model_format)
    for name in [*BUILT_IN.system_names(), *VARIANTS]
    for model_format in MODEL_SUFFIXES
    if BUILT_IN.has_model(name, model_format)
]
MODELLED = [name for name in BUILT_IN.system_names() if all(BUILT_IN.has_model(name, form) for form in MODEL_SUFFIXES)]
# Those whose tree is all that moves.
TREES = [name for name in MODELLED if not is_tied(name)]
_TESTS = Path(__file__).parent
# Robots' files: those that come with the harness, and those that the tests add; what another file includes is none.
ROBOTS = sorted(
    path
    for folder in (robots_folder(BUILT_IN), _TESTS / "comparison" / "files", _TESTS / "trees" / "files")
    for path in folder.iterdir()
    if path.suffix in MODEL_SUFFIXES.values() and "<mujocoinclude" not in path.read_text()
)


def features_of_file(text: str) -> Iterator[str]:
    """What a reader of a model file meets: each element, each type of it, and each attribute; prefixes need no declaration."""
    root = etree.fromstring(text.encode(), etree.XMLParser(remove_comments=True, remove_pis=True, recover=True))
    for element in root.iter():
        yield f"{root.tag} {element.tag}"
        yield from (f"{root.tag} {element.tag} {name}={value if name == 'type' else ''}" for name, value in element.attrib.items())


def features_of_system(name: str) -> Iterator[str]:
    """What a system is: what it declares, what of the harness it declares it with, and what stands in the models of it.

    Contacts and shapes bear on no motion between contacts, which is what is asked for of a system.
    """
    return (one for one in _all_features(name) if not _OF_CONTACTS & set(one.removesuffix("=").split()))


_OF_CONTACTS = {"Contact", "contacts", "filterparent", "geom", "collision", "geometry", "box", "sphere", "cylinder"}


def _all_features(name: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(text_of(name))):
        if isinstance(node, ast.ImportFrom) and node.module == "harness":
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            yield from (f"{node.func.id} {keyword.arg}" for keyword in node.keywords if node.func.id[0].isupper())
    if member_of(BUILT_IN.system_path(name)):
        yield "family"
    for model_format in MODEL_SUFFIXES:
        if (name, model_format) not in MODELS:
            yield f"no {model_format}"
    for model, model_format in MODELS:
        if BUILT_IN.system_of(model) == name:
            yield from features_of_file(read_text(BUILT_IN.model_path(model, model_format)))


def cover(features: Mapping[Name, set[str]], sizes: Mapping[Name, int], covered: set[str] = frozenset()) -> list[Name]:  # type: ignore[assignment]
    """Names that have every feature but those ``covered`` already: always the next with most further ones for its size.

    The greedy cover of Chvatal (A greedy heuristic for the set-covering problem, 1979), without those that later ones make superfluous;
    the first by name of several that are as good.
    """
    left = set().union(*features.values()) - covered
    chosen: list[Name] = []
    while left:
        chosen.append(max(sorted(features), key=lambda name: (len(features[name] & left) / sizes[name], -sizes[name])))
        left -= features[chosen[-1]]
    for name in sorted(chosen, key=lambda name: (-sizes[name], name)):
        others = covered.union(*(features[other] for other in chosen if other != name))
        if features[name] <= others:
            chosen.remove(name)
    return sorted(chosen)


def _joints(text: str) -> int:
    return text.count("<joint") + text.count("<freejoint")


SYSTEM_FEATURES = {name: set(features_of_system(name)) for name in BUILT_IN.system_names()}
# Elements and types; attributes of shapes, sensors and actuators are many, and no acceleration feels them.
ROBOT_FEATURES = {path: {one for one in features_of_file(path.read_text()) if not one.endswith("=")} for path in ROBOTS}
# Those without a model are as large as the largest robot.
_SYSTEM_SIZES = {
    name: sum(_joints(read_text(BUILT_IN.model_path(name, form))) for form in MODEL_SUFFIXES if (name, form) in MODELS) or 20
    for name in BUILT_IN.system_names()
}
_ROBOT_SIZES = {path: _joints(path.read_text()) for path in ROBOTS}
# What a run at the desk takes of the catalogue, and the robots that have what no system has.
REPRESENTATIVE = cover(SYSTEM_FEATURES, _SYSTEM_SIZES)
REPRESENTATIVE_ROBOTS = cover(ROBOT_FEATURES, _ROBOT_SIZES, set().union(*SYSTEM_FEATURES.values()))


def is_misread(subject: Subject, mechanism: Mechanism) -> bool:
    """Whether the engine's reader is known to make another mechanism of its model in the built-in library."""
    if subject.format not in MODEL_SUFFIXES:
        return False
    file = read_model(BUILT_IN.model_path(mechanism.name, subject.format), subject.format)
    return bool(misread_by(file, mechanism.gravity, subject.engine, BUILT_IN)[1].applied)
