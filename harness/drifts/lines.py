"""The differences of two sides by cause, with their lines, and the changes by which the second side moves as the first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.drifts.plan import HeldSides, MovingSide, Plan
from harness.engines.moving import HeldNumbers, NumberKey
from harness.explain.changes import Change
from harness.explain.changes.held import HeldFile, Said, change_to, section_of
from harness.files.given import Place
from harness.results.cause import DriftCause
from harness.results.drift import SideDifference
from harness.results.table import counted, number_text

# Told by other numbers beside them.
_FOLLOW = ("limited", "aabb", "rbound", "conaffinity")
# The number by which an owner that one file alone has is told once.
_FIRST = {"body": "mass", "jnt": "type", "geom": "type", "actuator": "gear", "eq": "type", "tendon": "range", "site": "pos"}
Told = tuple[SideDifference, Change | None]


def differences_of(sides: tuple[MovingSide, MovingSide], held: HeldSides, plan: Plan) -> dict[DriftCause, list[Told]]:
    """The differences of two sides by cause, each with the change of the second file that ends it, if one does.

    Settings of the sides have values instead of lines.
    """
    files = HeldFile(sides[0].path), HeldFile(sides[1].path)
    found: dict[DriftCause, list[Told]] = {}
    for cause, keys in plan.differing.items():
        of_cause = [told for key in keys for told in _differences(files, (held.first, held.second), cause, key, sides)]
        # Several numbers of an element are written as one.
        found[cause] = list({difference: (difference, change) for difference, change in of_cause}.values())
    settings = {
        DriftCause.DELAY: ([f"{side.delay:g} s" for side in sides], (not sides[0].delay, not sides[1].delay)),
        DriftCause.DECIMATION: ([counted(side.decimation, "step") for side in sides], (False, False)),
    }
    for cause, (values, absent) in settings.items():
        if cause in plan.differing:
            difference = SideDifference(owner="", what=cause.value, first=values[0], second=values[1], is_absent=absent)
            found[cause] = [(difference, None)]
    return found


def _differences(
    files: tuple[HeldFile, HeldFile],
    held: tuple[HeldNumbers, HeldNumbers],
    cause: DriftCause,
    key: NumberKey,
    sides: tuple[MovingSide, MovingSide],
) -> Iterator[Told]:
    """The differences between the files in one number."""
    array, owner = key
    prefix, _, name = array.partition("_")
    if name in _FOLLOW:
        return
    one, other = (numbers[cause].get(key) for numbers in held)
    if one is None or other is None:
        if name == _FIRST.get(prefix):
            yield _of_one_file(files, held, key), None
        return
    said = [file.says(array, owner) for file in files]
    if len(said[0]) != len(said[1]):
        said = [own[:1] for own in said]
    compiled = [_compiled(array, value, numbers) for value, numbers in zip((one, other), held, strict=True)]
    absent = _is_absent(array, one), _is_absent(array, other)
    others = [pair for pair in zip(*said, strict=True) if pair[0].text != pair[1].text]
    for first, second in others or list(zip(*said, strict=True))[:1]:
        yield _difference(files, (first, second), compiled, (cause, key, absent), sides)


def _difference(
    files: tuple[HeldFile, HeldFile],
    said: tuple[Said, Said],
    compiled: Sequence[str],
    about: tuple[DriftCause, NumberKey, tuple[bool, bool]],
    sides: tuple[MovingSide, MovingSide],
) -> Told:
    cause, (array, owner), absent = about
    prefix, _, name = array.partition("_")
    texts = [compiled[side] if prefix == "flag" else own.text or compiled[side] for side, own in enumerate(said)]
    if texts[0] == texts[1]:
        # The files say the same, of which engines make other numbers.
        says = [text if prefix not in ("opt", "flag") else "" for text in texts]
        texts = [f"{text}, compiled as {own}" if text and text != own else own for text, own in zip(says, compiled, strict=True)]
    written = [own.name for own in said if own.text]
    if len(set(written)) > 1:
        # Each file has another attribute for it.
        texts = [f"{own.name} {text}" for own, text in zip(said, texts, strict=True)]
    difference = SideDifference(
        owner=said[1].owner or _named(array, owner),
        what="" if len(set(written)) > 1 else (written or [said[0].name])[0],
        first=texts[0],
        second=texts[1],
        first_place=said[0].told(sides[0].path),
        second_place=said[1].told(sides[1].path),
        is_absent=absent,
    )
    is_set_by_side = prefix == "opt" and any(getattr(side, {"timestep": "length"}.get(name, name), None) for side in sides)
    if is_set_by_side or sides[0].path == sides[1].path:
        return difference, None
    wanted = said[0]
    if files[0].is_urdf != files[1].is_urdf:
        # As many numbers are written alike in both formats, under other names.
        if len(wanted.text.split()) != max(1, len(said[1].text.split())):
            return difference, None
        wanted = replace(wanted, attribute=said[1].attribute, otherwise=())
    change = change_to(cause.value, f"{difference.what} of {difference.owner}", said[1], wanted)
    if change is None:
        return difference, None
    place, is_removed = change.place, not said[0].text
    remedy = f'{said[1].part} {place.attribute}="{said[1].text if is_removed else said[0].text}"'.lstrip()
    line = Place(change.path or sides[1].path, place.line).within(sides[1].path)
    return replace(difference, remedy=remedy, remedy_place=line, is_removed=is_removed), change


def _of_one_file(files: tuple[HeldFile, HeldFile], held: tuple[HeldNumbers, HeldNumbers], key: NumberKey) -> SideDifference:
    has = [any(key in numbers for numbers in one.by_cause.values()) for one in held]
    texts = ["present" if there else "absent" for there in has]
    lines = [file.says(*key)[0].told(file.path) if there else "" for file, there in zip(files, has, strict=True)]
    return SideDifference(owner="", what=_named(*key), first=texts[0], second=texts[1], first_place=lines[0], second_place=lines[1])


def _named(array: str, owner: str) -> str:
    # Each of several numbers of a ball or free joint is one that its element writes for all.
    section, owner = section_of(array), owner.partition("[")[0]
    return "" if not owner else owner if owner.startswith(f"{section} ") else f"{section} {owner}"


def _is_absent(array: str, value: Array) -> bool:
    """True for a number that acts by its size, or a switch, that is off."""
    grows = array.partition(":")[0].endswith(("damping", "frictionloss", "armature", "stiffness", "biasprm", "gainprm"))
    return not np.any(value) and (grows or array.startswith("flag"))


def _compiled(array: str, value: Array, numbers: HeldNumbers) -> str:
    words: Mapping[int, str] = numbers.words.get(array, {})
    if words:
        return words.get(int(value[0]), str(int(value[0])))
    if array.startswith("flag"):
        return "on" if value[0] else "off"
    if array == "actuator_biasprm:2":
        return number_text(-float(value[0]) + 0.0)
    last = np.flatnonzero(value)
    shown = value if array.startswith(("opt", "jnt", "body", "geom")) else value[: int(last[-1]) + 1 if len(last) else 1]
    return " ".join(number_text(float(number)) for number in shown)
