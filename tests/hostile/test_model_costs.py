"""Model files made to be slow: what reading one costs grows with its size, and what no mechanism needs is refused early."""

from __future__ import annotations

import contextlib
import gc
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from catalogue import BUILT_IN

from harness.crosscheck.assignment import Assignment
from harness.crosscheck.examination import MOST_PARTS
from harness.crosscheck.superfluous import superfluous
from harness.engines import Subject
from harness.errors import InvalidModel
from harness.files.document.xml import MAXIMUM_ELEMENTS
from harness.files.model_file import parse_model
from harness.files.text.scan import find_elements

BAR = '<joint name="{0}" class="{1}" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'


def bars(count: int, of_class: Callable[[int], str]) -> str:
    return "".join(f'<body name="b{i}">{BAR.format(f"j{i}", of_class(i))}</body>' for i in range(count))


def many_classes(count: int) -> str:
    """As many default classes as joints, each joint of another."""
    classes = "".join(f'<default class="c{i}"><joint damping="0.{i}" stiffness="1"/></default>' for i in range(count))
    return f"<mujoco><default>{classes}</default><worldbody>{bars(count, 'c{}'.format)}</worldbody></mujoco>"


def long_class(count: int) -> str:
    """As many writings of the same attributes in one class as joints that are of it."""
    joints = "".join(f'<joint damping="0.{i}" stiffness="1"/>' for i in range(count))
    return f"<mujoco><default class='c'>{joints}</default><worldbody>{bars(count, lambda i: 'c')}</worldbody></mujoco>"


def long_lines(count: int) -> str:
    """Much text before the numbers of which the lines are counted."""
    return f"<!--{' ' * (10_000 * count)}--><mujoco><worldbody>{bars(count, lambda i: 'main')}</worldbody></mujoco>"


def empty_bodies(count: int) -> str:
    return f"<mujoco><worldbody><body name='b'>{BAR.format('j', 'main')}</body>{'<body/>' * count}</worldbody></mujoco>"


def cost(text: str) -> float:
    """CPU seconds of reading an MJCF and finding its numbers, the least of three, refused or not."""

    def once() -> float:
        started = time.process_time()
        with contextlib.suppress(InvalidModel):
            parse_model(Path("model.xml"), text, "mjcf")
            find_elements(text, "mjcf")
        return time.process_time() - started

    # What other tests have left in memory is not to be looked through here.
    gc.disable()
    try:
        return min(once() for _ in range(3))
    finally:
        gc.enable()


@pytest.mark.ci
@pytest.mark.parametrize("written", [many_classes, long_class, long_lines, empty_bodies])
def test_four_times_the_size_costs_at_most_eight_times(written: Callable[[int], str]) -> None:
    """In proportion it costs four times as much, and by the square sixteen times; a busy machine lies between."""
    assert cost(written(1200)) < 8 * cost(written(300))


@pytest.mark.ci
def test_more_elements_than_any_mechanism_needs_are_refused_early() -> None:
    with pytest.raises(InvalidModel, match=rf"model\.xml:1: <body> is element {MAXIMUM_ELEMENTS + 1} .* at most {MAXIMUM_ELEMENTS}"):
        parse_model(Path("model.xml"), empty_bodies(1_200_000), "mjcf")
    assert cost(empty_bodies(1_200_000)) < 3 * cost(empty_bodies(100_000))


@pytest.mark.parametrize(
    "classes",
    [
        '<default class="c"><default class="c"><joint damping="1"/></default></default>',
        '<default class="b"><default class="c"><joint damping="1"/></default><default class="c"><default class="b"/></default></default>',
        '<default class="b"><default><default class="c"><joint/></default></default></default>',
    ],
)
def test_classes_around_themselves_or_without_a_name_are_read_or_refused(classes: str) -> None:
    text = f"<mujoco><default>{classes}</default><worldbody>{bars(1, lambda i: 'c')}</worldbody></mujoco>"
    try:
        parse_model(Path("model.xml"), text, "mjcf")
    except InvalidModel as refusal:
        assert refusal.line == 1


def test_a_model_of_too_many_parts_is_superfluous_as_a_whole() -> None:
    """Each part costs a loading of all of them, so that the cost would grow with the square of the size."""
    subject, path = Subject("mujoco", "mjcf"), BUILT_IN.model_path("bar_pendulum", "mjcf")
    classes = "".join(f'<default class="c{i}"><joint damping="1"/></default>' for i in range(MOST_PARTS // 2))
    text = path.read_text().replace("<worldbody>", f"<default>{classes}</default><worldbody>", 1)
    large = replace(Assignment.of(BUILT_IN, "bar_pendulum", subject), model=parse_model(path, text, "mjcf"))
    [part] = superfluous(large)
    assert part.element == "mujoco" and f"expected at most {MOST_PARTS}" in part.why
