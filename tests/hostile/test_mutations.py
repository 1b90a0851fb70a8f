"""Model files mutated by seed: each is refused with its place, or read and judged; none is wrong in silence.

A mutant that is read goes to every engine that reads its format. Where all of them agree with the truth although a number
differs from the unchanged file's, that number must be one that no answer feels: with a hundredth more of it in the unchanged
file, the engines agree as well. Structural changes have the engines' answers for a judge.
"""

from __future__ import annotations

import math
import random
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN, MODELLED
from support import harness

from harness.crosscheck import assignment, stages
from harness.crosscheck.assignment import Assignment
from harness.engines import Subject
from harness.errors import InvalidModel
from harness.files.document.xml import parse_document
from harness.files.model_file import ROOT_TAGS, ModelFile, parse_model, read_model
from harness.files.text.joint_table import joint_rows, point_springs
from harness.files.text.scan import Element, Number, edited, find_elements, find_numbers, with_values
from harness.lagrange.derivation import load_mechanism
from harness.truth.sampling import generic_sample
from harness.workers import Task, Workers

ENGINES = ("mujoco", "pinocchio")
NUMBERS = ["", "nan", "-inf", "1e400", "1e308", "-1e308", "5e-324", "-0", "0x10", "1,5", "1.5.2", "1e", "--1", "1_0", "\uff11", "0 0"]
HEADS = [
    '<!DOCTYPE x [<!ENTITY a "1">]>',
    '<!DOCTYPE x [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>',
    '<!DOCTYPE x SYSTEM "file:///etc/hostname">',
    '<?xml version="1.1"?>',
    '<?xml version="1.0" encoding="latin-1"?>',
    '<?xml version="1.0" encoding="utf-16"?>',
    '<?xml-model href="nowhere"?>',
    "<!-- -- -->",
    "\ufeff",
    "\0",
    " ",
]
CODINGS = ["utf-16", "utf-16-be", "utf-32", "utf-8-sig", "cp037", "utf-7"]


def bytes_of(draw: random.Random, text: str, model_format: str) -> bytes:
    content = bytearray(text.encode())
    for _ in range(draw.randint(1, 3)):
        place, length = draw.randrange(len(content)), draw.choice([0, 0, 1, 1, 7, 400])
        content[place : place + length] = draw.choice([b"", bytes([draw.randrange(256)]), b"<", b'"', b"&", b"/>", b"9", b"\xff"])
    return bytes(content)


def number(draw: random.Random, text: str, model_format: str) -> str:
    chosen = draw.choice(find_numbers(text, model_format))
    new = draw.choice([*NUMBERS, *(repr(chosen.value * factor) for factor in (-1.0, 0.5, 2.0, 1 + 1e-3, 1 + 1e-6, 1 + 1e-9, 1e9))])
    return edited(text, [(chosen.start, chosen.end, draw.choice([new, repr(chosen.value + draw.choice([-1.0, 0.1, 1e-3]))]))])


def attribute(draw: random.Random, text: str, model_format: str) -> str:
    element = draw.choice([element for element in find_elements(text, model_format) if any(a.name for a in element.attributes)])
    one, other = (draw.choice([a for a in element.attributes if a.name]) for _ in range(2))
    written = text[one.start : one.end]
    foreign = draw.choice([a for e in find_elements(text, model_format) for a in e.attributes if a.name])
    instead = {
        "gone": "",
        "twice": written + written,
        "renamed": written.replace(one.name, one.name[:-1] + draw.choice("xyz:"), 1),
        "of another": f' {one.name}="{other.value}"',
        "foreign": f"{written} {foreign.name}='{foreign.value}'",
        "empty": f' {one.name}=""',
        "long": f' {one.name}="{one.value}{" 1" * draw.choice([1, 5000])}"',
        "unquoted": f" {one.name}={one.value}",
        "spaced": f"\n {one.name}\t=\n' {one.value} '",
        "referred": f' {one.name}="{"".join(f"&#{ord(letter)};" for letter in one.value)}"',
    }
    return edited(text, [(one.start, one.end, draw.choice(list(instead.values())))])


def element(draw: random.Random, text: str, model_format: str) -> str:
    elements = find_elements(text, model_format)
    one, other = draw.choice(elements[1:]), draw.choice(elements)
    whole = text[one.start : one.end]
    instead: dict[str, list[tuple[int, int, str]]] = {
        "gone": [(one.start, one.end, "")],
        "twice": [(one.end, one.end, whole)],
        "elsewhere": [(other.start, other.start, whole)],
        "renamed": [(one.start + 1, one.start + 1 + len(one.tag), draw.choice(["link", "body", "joint", "x:y", "a" * 300, "\u00e9"]))],
        "commented": [(one.start, one.end, f"<!--{whole}-->")],
        "unclosed": [(one.opened - 2, one.opened, ">")],
        "hollow": [(one.opened, one.closed, "")],
        "with text": [(one.end, one.end, "text")],
        "cdata": [(one.end, one.end, "<![CDATA[ ]]>")],
        "included": [(one.end, one.end, '<include file="/etc/passwd"/>')],
    }
    return edited(text, draw.choice(list(instead.values())))


def nesting(draw: random.Random, text: str, model_format: str) -> str:
    one: Element = draw.choice(find_elements(text, model_format)[1:])
    tag, depth = draw.choice([one.tag, "frame", "default", "body", "link"]), draw.choice([1, 2, 150, 190, 300, 20_000])
    return edited(text, [(one.start, one.start, f"<{tag}>" * depth), (one.end, one.end, f"</{tag}>" * depth)])


def heading(draw: random.Random, text: str, model_format: str) -> str:
    text = draw.choice(HEADS) + text.partition("?>\n")[2] if text.startswith("<?") else draw.choice(HEADS) + text
    chosen = draw.choice(find_numbers(text, model_format) or [None])
    if chosen is None or draw.random() < 0.5:
        return text
    return edited(text, [(chosen.start, chosen.end, draw.choice(["&a;", "&c;", "&#0;"]))])


def coding(draw: random.Random, text: str, model_format: str) -> bytes:
    ends = draw.choice(["\n", "\r\n", "\r", "\u2028", "\x85"])
    return text.replace("\n", ends).encode(draw.choice(["utf-8", *CODINGS]), "xmlcharrefreplace")


MUTATIONS: tuple[Callable[..., str | bytes], ...] = (bytes_of, number, attribute, element, nesting, number, heading, coding)


def mutant(seed: int, text: str, model_format: str) -> bytes:
    draw = random.Random(seed)
    made = draw.choice(MUTATIONS)(draw, text, model_format)
    return made if isinstance(made, bytes) else made.encode("utf-8", "surrogatepass")


class Judge:
    """Every engine that reads a format, at certified states of one system."""

    def __init__(self, name: str, model_format: str) -> None:
        self.mechanism = load_mechanism(BUILT_IN, name)
        self.states = generic_sample(self.mechanism, 8, 3)
        self.of = [Assignment(BUILT_IN, Subject(engine, model_format), self.mechanism, None) for engine in ENGINES]
        self.truths = stages.Truths(self.states)

    def verdicts(self, model: ModelFile) -> tuple[str, ...]:
        """Of each engine the gravest verdict, or what it refuses the model with."""
        assignment._MODELS._found.clear()
        found = []
        for one in self.of:
            asked = Assignment(one.library, one.subject, one.mechanism, model)
            answers = stages.ask(asked, self.states, self.truths)
            if answers.comparison is not None:
                found.append(str(answers.comparison.verdicts[answers.comparison.worst]))
            else:
                assert answers.problem is not None or answers.unsupported, answers.failure
                assert "\n" not in answers.failure and answers.failure
                found.append(answers.failure)
        return tuple(found)

    def agrees(self, model: ModelFile) -> bool:
        return set(self.verdicts(model)) == {"agrees"}

    def feels(self, model: ModelFile, one: Number) -> bool:
        """True if the check is red with a hundredth more of one number of a sound model."""
        try:
            moved = parse_model(model.path, with_values(model.text, {one: one.value * 1.01 or 0.01}), model.format)
        except InvalidModel:
            return False
        return not self.agrees(moved)


def changed_numbers(sound: ModelFile, model: ModelFile) -> list[Number]:
    """Numbers of a sound model that stand in another one, of the same elements and attributes, with another value."""

    def shape(text: str) -> list[Any]:
        root = parse_document(sound.path, text, ROOT_TAGS[sound.format]).root
        return [(element.tag, sorted(element.attrib)) for element in root.iter("*")]

    before, after = (find_numbers(one.text, one.format) for one in (sound, model))
    if shape(sound.text) != shape(model.text) or len(before) != len(after):
        return []
    return [one for one, other in zip(before, after, strict=True) if abs(one.value - other.value) > 1e-5 * (abs(one.value) or 1.0)]


def outcome(judge: Judge, sound: ModelFile, path: Path) -> str:
    """What becomes of a mutant at ``path``; raises where that is none of what may become of it."""
    try:
        model = read_model(path, sound.format)
    except InvalidModel as refusal:
        assert str(refusal).startswith(str(path)) and "\n" not in str(refusal) and refusal.problem
        whole_file = ("is empty", "is not well-formed XML", "is larger than", "is in UTF-16")
        assert refusal.line is not None or refusal.problem.startswith(whole_file), refusal
        return "refused"
    assert joint_rows(model) and isinstance(point_springs(model), list)
    verdicts = judge.verdicts(model)
    assert verdicts == judge.verdicts(read_model(path, sound.format))
    if set(verdicts) != {"agrees"}:
        return "red"
    changed = changed_numbers(sound, model)
    assert not any(judge.feels(sound, one) for one in changed), (changed, model.text)
    return "not felt" if changed else "agrees"


def outcomes(name: str, model_format: str, seeds: list[int], folder: Path, note: Callable[[str], None]) -> Counter[str]:
    """What becomes of the mutants of one file, as a task of a worker."""
    sound = read_model(BUILT_IN.model_path(name, model_format), model_format)
    judge, found = Judge(name, model_format), Counter[str]()
    for seed in seeds:
        path = folder / f"{name}-{seed}.{model_format}"
        path.write_bytes(mutant(seed, sound.text, model_format))
        note(path.name)
        try:
            found[outcome(judge, sound, path)] += 1
        except Exception as error:
            raise AssertionError(f"{path.name}: {''.join(traceback.format_exception(error))}") from error
    return found


def run(names: list[str], count: int, folder: Path) -> Counter[str]:
    """``count`` mutants spread over both files of the systems ``names``."""
    files = [(name, model_format) for name in names for model_format in ("mjcf", "urdf")]
    given = [Task(file, outcomes, (*file, list(range(start, count, len(files))), folder), file) for start, file in enumerate(files)]
    with Workers(2, time_limit=600) as workers:
        done = list(workers.run(given))
    problems = [f"{one.crash.note}: {one.crash}" if one.crash else str(one.exception) for one in done if one.value is None]
    assert not problems, "\n".join(problems)
    return sum((one.value for one in done), Counter())


@pytest.mark.ci
def test_two_hundred_mutants_are_refused_or_judged(tmp_path: Path) -> None:
    found = run(["bar_pendulum", "collar"], 200, tmp_path)
    assert found.total() == 200
    assert found["refused"] > 80 and found["red"] > 10 and found["agrees"] > 5


@pytest.mark.nightly
def test_two_thousand_mutants_are_refused_or_judged(tmp_path: Path) -> None:
    found = run(MODELLED, 2000, tmp_path)
    assert found.total() == 2000
    assert found["refused"] > 800 and found["red"] > 100


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.nightly(nights=4)) for seed in range(2, 40))])
def test_a_mutant_ends_the_command_with_one_of_its_statuses(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "mutant.xml"
    path.write_bytes(mutant(seed, BUILT_IN.model_path("bar_pendulum", "mjcf").read_text(), "mjcf"))
    done = harness("check", "bar_pendulum", "--mjcf", str(path), "--states", "4", cwd=tmp_path)
    assert done.returncode in (0, 1, 2, 3)
    assert "Traceback" not in done.stdout + done.stderr
    assert done.returncode != 2 or str(path) in done.stderr


def test_numbers_are_compared_by_value() -> None:
    """A planted silence: what every engine feels is found among the changed numbers, and felt."""
    sound = read_model(BUILT_IN.model_path("bar_pendulum", "mjcf"), "mjcf")
    heavier = parse_model(sound.path, sound.text.replace('mass="2"', 'mass="2.1"'), "mjcf")
    [changed] = changed_numbers(sound, heavier)
    assert math.isclose(changed.value, 2) and Judge("bar_pendulum", "mjcf").feels(sound, changed)
