"""Contacts by two versions: other points, other laws and other solvers are told apart, with the shapes that touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from catalogue import CALLED_HERE

from harness.engines.adapters.mujoco.contacts import found_contacts
from harness.files.contacts import FoundContact
from harness.results.trend import RunChange
from harness.results.upgrade import CONTACT_LAW, CONTACT_POINTS, CONTACT_SOLVER
from harness.trees.robot import Robot, read_robot
from harness.upgrade.portraits import Portrait, changes_between
from harness.upgrade.touching import TOUCHING_STATES, ContactPortrait, contact_changes, contacts_portrayed

FILE = """<mujoco><worldbody>
<geom name="floor" type="plane" size="1 1 1"/>
<body name="ball" pos="0 0 0.12"><freejoint/><geom name="ball" size="0.1" friction="0.4"/></body>
<body name="box" pos="0 0.3 0.11"><freejoint/><geom name="box" type="box" size="0.1 0.1 0.1"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path = tmp_path_factory.mktemp("contacts") / "two.xml"
    path.write_text(FILE)
    return read_robot(path)


@pytest.fixture(scope="module")
def portrait(robot: Robot) -> ContactPortrait:
    found = contacts_portrayed(CALLED_HERE, robot, "mujoco", 1)
    assert found is not None and len(found.contacts) == TOUCHING_STATES
    assert sum(map(len, found.contacts)) > TOUCHING_STATES
    return found


def changes(before: ContactPortrait, now: ContactPortrait) -> list[RunChange]:
    return list(contact_changes("two", "mujoco/mjcf", before, now))


def changed(portrait: ContactPortrait, change: Callable[[FoundContact], FoundContact | None]) -> ContactPortrait:
    """What touches the ball is otherwise."""
    return replace(
        portrait,
        contacts=[[new for one in own if (new := change(one) if "ball" in one.shapes else one) is not None] for own in portrait.contacts],
    )


def test_the_same_version_changes_nothing(robot: Robot, portrait: ContactPortrait) -> None:
    again = contacts_portrayed(CALLED_HERE, robot, "mujoco", 1)
    assert again is not None and changes(portrait, again) == []
    shuffled = replace(portrait, contacts=[own[::-1] for own in portrait.contacts])
    assert changes(portrait, shuffled) == []


PLANTED: dict[str, tuple[Callable[[FoundContact], FoundContact | None], str, str]] = {
    "point": (lambda one: replace(one, point=(one.point[0] + 1e-6, *one.point[1:])), CONTACT_POINTS, "touch elsewhere, by up to 1e-06 m"),
    "distance": (lambda one: replace(one, distance=one.distance + 1e-4), CONTACT_POINTS, "touch elsewhere, by up to 0.0001 m"),
    "normal's sign": (lambda one: replace(one, frame=(*(-x for x in one.frame[:3]), *one.frame[3:])), CONTACT_POINTS, "touch elsewhere"),
    "dropped": (lambda one: None, CONTACT_POINTS, "touch in another number of points"),
    "friction": (lambda one: replace(one, friction=(0.3, *one.friction[1:])), CONTACT_LAW, "have other friction"),
    "condim": (lambda one: replace(one, friction=()), CONTACT_LAW, "have other friction"),
    "margin and solref": (lambda one: replace(one, margin=0.1, solref=(0.03, 1.0)), CONTACT_LAW, "have other margin and solref"),
    "solreffriction": (lambda one: replace(one, sliding=(0.1, 1.0)), CONTACT_LAW, "have other solreffriction"),
}


@pytest.mark.parametrize("fault", PLANTED)
def test_what_changed_of_contacts_is_named_with_the_shapes(fault: str, portrait: ContactPortrait) -> None:
    change, what, said = PLANTED[fault]
    [found] = changes(portrait, changed(portrait, change))
    assert found.what == what and found.now.startswith(f"'ball' and 'floor' {said}")


def test_tangents_and_the_order_of_shapes_are_the_engines_choice(portrait: ContactPortrait) -> None:
    def turned(one: FoundContact) -> FoundContact:
        normal, first, second = one.frame[:3], one.frame[3:6], one.frame[6:]
        other = (*(-x for x in normal), *second, *first)
        return replace(one, frame=other, shapes=one.shapes[::-1], bodies=one.bodies[::-1])

    assert changes(portrait, changed(portrait, turned)) == []


@pytest.mark.parametrize(("ended", "what", "said"), [(False, CONTACT_SOLVER, "ends elsewhere at "), (True, CONTACT_LAW, "push otherwise")])
def test_a_solver_is_told_from_a_law(ended: bool, what: str, said: str, portrait: ContactPortrait) -> None:
    moved = 1e-3 * portrait.sizes[:, None] / portrait.ended.shape[1] ** 0.5
    other = replace(portrait, accelerations=portrait.accelerations + moved)
    [found] = changes(portrait, replace(other, ended=portrait.ended + moved) if ended else other)
    assert found.what == what and said in found.now and "0.1 % of qdd" in found.now and "and 'floor'" in found.now


def test_a_solver_that_leaves_rounding_of_what_cancels_is_the_same(portrait: ContactPortrait) -> None:
    other = replace(portrait, accelerations=portrait.accelerations + 1e-10 * portrait.sizes[:, None])
    assert changes(portrait, other) == []


def test_changes_of_contacts_are_among_those_of_a_file(portrait: ContactPortrait) -> None:
    other = Portrait(contacts=changed(portrait, PLANTED["friction"][0]))
    found, _ = changes_between("two", "mujoco/mjcf", Portrait(contacts=portrait), other)
    assert [one.what for one in found] == [CONTACT_LAW]
    assert changes_between("two", "mujoco/mjcf", Portrait(), other)[0] == []


def test_a_version_that_finds_other_contacts_is_seen(robot: Robot, portrait: ContactPortrait, monkeypatch: pytest.MonkeyPatch) -> None:
    from harness.engines.adapters.mujoco import robot as adapter

    def dropped(model: object, contacts: object) -> list[FoundContact]:
        return found_contacts(model, contacts)[1:]

    monkeypatch.setattr(adapter, "found_contacts", dropped)
    now = contacts_portrayed(CALLED_HERE, robot, "mujoco", 1)
    assert now is not None and [one.what for one in changes(portrait, now)] == [CONTACT_POINTS]


def test_files_without_contacts_have_no_portrait(tmp_path: Path) -> None:
    path = tmp_path / "none.xml"
    path.write_text(FILE.replace("<worldbody>", '<option><flag contact="disable"/></option><worldbody>', 1))
    assert contacts_portrayed(CALLED_HERE, read_robot(path), "mujoco", 1) is None
