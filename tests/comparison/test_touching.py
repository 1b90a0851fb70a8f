"""MuJoCo with contacts on is held against what it documents, with the contacts that it finds itself as inputs of the truth."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from comparison.robots import edited, line_of, meant_by
from support import call_engines_here

from harness.comparison.switched_on import beyond_the_end, judge_switched_on, pose, with_verdict
from harness.engines.adapters.mujoco import robot as adapter
from harness.explain import touching
from harness.files.contacts import FoundContact, structure_of
from harness.files.equalities import Constraint
from harness.files.findings import CONTACTS, SWITCHED_OFF
from harness.files.given import Given
from harness.files.touching import Touch
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.comparison import FileRecord, FilesComparison
from harness.results.switched_on import SwitchedOnRecord, stays_off, switched_on_text, with_those_on
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import AGREEMENT, Verdict

BOX = """<mujoco>
  <option cone="{cone}" impratio="4" tolerance="0" iterations="100"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1" friction="0.75 0.25 0.125"/>
    <body name="trunk" pos="0 0 0.2">
      <freejoint/>
      <geom name="trunk" type="box" size="0.2 0.1 0.05" mass="2" condim="4"/>
      <body pos="0.25 0 0">
        <joint name="knee" axis="0 1 0" range="-60 60"/>
        <geom name="leg" type="capsule" fromto="0 0 0 0.1 0 -0.2" size="0.03" mass="0.5" condim="{condim}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def written(folder: Path, cone: str = "elliptic", condim: int = 6) -> Path:
    path = folder / "box.xml"
    path.write_text(BOX.format(cone=cone, condim=condim))
    return path


def held_by(path: Path) -> SwitchedOnRecord:
    return judge_switched_on(meant_by(path), "mujoco")


@pytest.mark.ci
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_mujoco_touches_as_it_documents(cone: str, tmp_path: Path) -> None:
    record = held_by(written(tmp_path, cone))
    assert (record.verdict, record.explained, record.message, record.departures) == (Verdict.AGREES, True, "", [])
    assert record.states > record.touching >= 4
    assert record.backward_error is not None and record.backward_error <= AGREEMENT
    assert with_those_on(record) == "With the file's 1 joint limit and contacts on "


@pytest.mark.ci
def test_what_is_on_is_not_told_as_off(tmp_path: Path) -> None:
    path = written(tmp_path)
    record, left_out = held_by(path), meant_by(path).robot.left_out
    assert any(one.what == CONTACTS for one in left_out)
    assert stays_off(left_out, record.parts) == [] and record.is_felt
    lines = [line_of(path, f'geom name="{name}"') for name in ("floor", "trunk", "leg")]
    assert [part.line for part in record.parts if part.what == CONTACTS] == lines


def displaced(contacts: Sequence[Constraint], by: float) -> list[Constraint]:
    """The same bodies in other points and at other distances; numbers of 0 stay."""

    def moved(number: Fraction, by: float) -> Fraction:
        assert isinstance(number, Given)
        return Given(float(number) * (1 + by), number.place, number.attribute, number.index)

    found = []
    for one in contacts:
        assert isinstance(one.says, Touch)
        x, y, z = one.says.point
        found.append(replace(one, says=replace(one.says, point=(moved(x, by), y, moved(z, -by)), distance=moved(one.says.distance, by))))
    return found


@pytest.mark.parametrize("cone", ["elliptic", pytest.param("pyramidal", marks=pytest.mark.ci)])
def test_states_whose_contacts_are_alike_are_as_each_alone(cone: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They share one program, and each has its own points and distances in it."""
    judged: list[tuple[touching.Touching, States, Callable[[Sequence[Constraint]], Mechanism], Any]] = []
    truth = touching.Touching.truth

    def noted(self: touching.Touching, *given: Any) -> Reference:
        states, documented, *kernel = given
        judged.append((self, states, documented, kernel))
        return truth(self, *given)

    monkeypatch.setattr(touching.Touching, "truth", noted)
    held_by(written(tmp_path, cone))
    (found, states, documented, _), *_ = judged
    kinds = list({structure_of(own): own for own in found.contacts if own}.values())[:2]
    assert len(kinds) == 2
    contacts = [*(displaced(own, 0.01 * number) for number in range(3) for own in kinds), (), ()]
    states = states[np.arange(len(contacts))]
    written_programs: list[Mechanism] = []

    def counted(own: Sequence[Constraint]) -> Mechanism:
        written_programs.append(documented(own))
        return written_programs[-1]

    together = touching.Touching(contacts, np.arange(len(contacts))).truth(states, counted)
    assert len(written_programs) == 3
    each = [ReferenceKernel(documented(own)).evaluate(states[[number]]) for number, own in enumerate(contacts)]
    alone = Reference.concatenate(each)
    assert together.certified.all()
    for name in ("high", "low", "radius", "sensitivity", "certified"):
        np.testing.assert_array_equal(getattr(together, name), getattr(alone, name), err_msg=name)
    # And the numbers are felt.
    swapped = truth(touching.Touching([*contacts[2:4], *contacts[:2], *contacts[4:]], np.arange(len(contacts))), states, documented)
    moved = np.flatnonzero((swapped.high != together.high).any(axis=1))
    assert moved.tolist() == [0, 1, 2, 3]


@pytest.mark.ci
def test_states_at_which_bodies_touch_are_judged_by_their_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path)
    found = {}
    for most in (0, touching.MOST_WORK):
        monkeypatch.setattr(touching, "MOST_WORK", most)
        found[most] = held_by(path).touching
    assert found[0] == 4 < found[touching.MOST_WORK]


def changed(**fields: Callable[[FoundContact], object]) -> Callable[[FoundContact], FoundContact]:
    return lambda one: replace(one, **{name: change(one) for name, change in fields.items()})


FAULTS = {
    "friction": changed(friction=lambda one: tuple(mu * (1 + 1e-9) for mu in one.friction)),
    "margin": changed(margin=lambda one: one.margin + 1e-9),
    "solref": changed(solref=lambda one: (one.solref[0] * (1 + 1e-9), one.solref[1])),
    "sign of the normal": changed(frame=lambda one: (*(-x for x in one.frame[:3]), *one.frame[3:])),
    "bodies swapped": changed(bodies=lambda one: one.bodies[::-1]),
    "distance": changed(distance=lambda one: one.distance * (1 + 1e-9)),
}


NAMED = {
    "friction": "it is what contacts with 0.999999999 times the friction give",
    "distance": "it is what contacts with 0.999999999 times the distance give",
    "sign of the normal": "it is what contacts give whose normals point the other way",
    "bodies swapped": "it is what contacts give whose normals point the other way",
}


@pytest.mark.parametrize(("left", "whose"), [(6e3, "most of it is"), (3e6, "what its solver leaves is not the cause")])
def test_whether_a_solver_that_goes_on_comes_nearer_is_said(left: float, whose: str) -> None:
    said = beyond_the_end(3.1e6, left, "set this")
    assert said.startswith(whose) and said.endswith("data roundoffs remain if you set this")


@pytest.mark.parametrize("fault", FAULTS)
def test_a_contact_that_is_another_is_red(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The engine is asked about the file as it stands, and the optimum is that of other contacts."""
    found = touching.contacts_of
    monkeypatch.setattr(touching, "contacts_of", lambda own, *about: found([FAULTS[fault](one) for one in own], *about))
    record = held_by(written(tmp_path))
    assert (record.verdict, record.explained) == (Verdict.DISAGREES, False)
    first, *others, last = record.rest
    assert first == "it is only at states where bodies touch that it is not what its documentation gives"
    assert re.match(r"what its solver leaves is not the cause: \S+ data roundoffs remain if you set <option ", last)
    assert (NAMED[fault] in others) if fault in NAMED else not others


@pytest.mark.ci
def test_a_contact_that_is_another_at_one_state_of_those_alike_is_red(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found, seen, planted = touching.contacts_of, set[Hashable](), list[Hashable]()

    def faulty(own: Sequence[FoundContact], *about: Any) -> list[Constraint]:
        structure = structure_of(found(own, *about))
        if structure not in seen or not structure or planted:
            seen.add(structure)
            return found(own, *about)
        planted.append(structure)
        return found([FAULTS["distance"](one) for one in own], *about)

    monkeypatch.setattr(touching, "contacts_of", faulty)
    record = held_by(written(tmp_path))
    assert planted and (record.verdict, record.explained) == (Verdict.DISAGREES, False)


@pytest.mark.ci
def test_a_contact_that_is_dropped_is_red(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    call_engines_here(monkeypatch)
    found = adapter.found_contacts
    monkeypatch.setattr(adapter, "found_contacts", lambda model, contacts: found(model, contacts)[1:])
    record, posed = pose(meant_by(written(tmp_path)), "mujoco")
    assert posed is not None
    record = with_verdict(record, posed.case, posed.asked, posed.answers, names=False)
    assert (record.verdict, record.explained) == (Verdict.DISAGREES, False)


SHAPES = (
    'type="sphere" size="{0:.3f}"',
    'type="capsule" size="{1:.3f} {0:.3f}"',
    'type="box" size="{0:.3f} {1:.3f} {2:.3f}"',
    'type="ellipsoid" size="{0:.3f} {1:.3f} {2:.3f}"',
    'type="cylinder" size="{0:.3f} {1:.3f}"',
)


def tree_of_shapes(folder: Path, number: int) -> Path:
    """A tree of shapes that float above a plane, with numbers of contacts of their own, which its number chooses."""
    random = np.random.default_rng(number)
    count, opened = int(random.integers(3, 9)), 1
    bodies = ['<body pos="0 0 0.4"><freejoint/>']
    for place in range(count):
        if place:
            joint = random.choice(["hinge", "slide", "ball"], p=[0.7, 0.2, 0.1])
            limits = 'range="-40 40"' if joint == "hinge" else 'range="-0.1 0.1"' if joint == "slide" else ""
            x, y, z = random.normal(size=3) * 0.15
            bodies.append(f'<body pos="{x:.3f} {y:.3f} {z:.3f}"><joint type="{joint}" axis="{x:.3f} {y:.3f} 0.3" damping="0.1" {limits}/>')
            opened += 1
        shape = str(random.choice(SHAPES)).format(*random.uniform(0.05, 0.12, 3))
        friction = " ".join(f"{one:.3f}" for one in (random.uniform(0.2, 1.5), *random.uniform(0.01, 0.1, 2)))
        margin = random.choice([0, 0.01])
        soft = f'solref="{random.uniform(0.01, 0.1):.3f} {random.uniform(0.5, 1.5):.2f}" solimp="0.8 0.95 0.01" margin="{margin}"'
        bodies.append(f'<geom {shape} density="800" condim="{random.choice([1, 3, 4, 6])}" friction="{friction}" {soft}/>')
        if random.random() < 0.4 and opened > 1:
            bodies.append("</body>")
            opened -= 1
    bodies.append("</body>" * opened)
    cone, jacobian = random.choice(["elliptic", "pyramidal"]), random.choice(["dense", "sparse"])
    exact = random.choice(["enable", "disable"])
    ratio = random.choice([1, 1, 5])
    path = folder / f"tree{number}.xml"
    path.write_text(
        f'<mujoco><option cone="{cone}" jacobian="{jacobian}" impratio="{ratio}"><flag diagexact="{exact}"/></option>'
        f'<worldbody><geom type="plane" size="5 5 1"/>{"".join(bodies)}</worldbody></mujoco>'
    )
    return path


# Of the trees of few bodies, two that have every shape and number of directions, both cones and a sparse Jacobian.
AT_THE_DESK = (6, 11)
IN_CI = range(3)
# The others take 20 minutes of a processor together.
IN_TURN = pytest.mark.nightly(nights=4)


def marks_of(number: int) -> tuple[pytest.MarkDecorator, ...]:
    return () if number in AT_THE_DESK else (pytest.mark.ci,) if number in IN_CI else (IN_TURN,)


def test_trees_at_the_desk_stand_for_the_others(tmp_path: Path) -> None:
    texts = [tree_of_shapes(tmp_path, number).read_text() for number in range(60)]
    words = [set(re.findall(r'(?:geom type|joint type|condim|cone|jacobian|impratio)="\w+"', text)) for text in texts]
    assert set().union(*(words[number] for number in AT_THE_DESK)) == set().union(*words) - {'joint type="ball"'}


@pytest.mark.ci
@pytest.mark.parametrize("number", [pytest.param(number, marks=marks_of(number)) for number in range(60)])
def test_no_tree_of_shapes_is_red(number: int, tmp_path: Path) -> None:
    record = held_by(tree_of_shapes(tmp_path, number))
    assert (record.explained, record.message, record.rest) == (True, "", [])


REFUSED = {
    "adhesion": (('name="leg"', 'name="leg" adhesion="2"'), "has adhesion"),
    # It pulls as far as its gap goes, without friction.
    "adhesion at a distance": (('name="leg"', 'name="leg" adhesion="2" gap="0.3"'), "has adhesion"),
    "surface": (('name="floor"', 'name="floor" surfacevel="1 0 0"'), "has a surface that moves by itself"),
    "noslip": (
        ('impratio="4"', 'impratio="4" noslip_iterations="3"'),
        "goes through noslip iterations, which solve no problem that is documented",
    ),
    "discrete": (
        ('impratio="4"', 'impratio="4" integrator="discrete"'),
        "is solved in the metric of a step, which the discrete integrator has",
    ),
    "flag": (("<worldbody>", '<option><flag contact="disable"/></option><worldbody>'), SWITCHED_OFF),
}


@pytest.mark.parametrize("name", REFUSED)
def test_contacts_that_have_another_law_are_refused_by_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(touching, "MOST_WORK", 0)
    change, why = REFUSED[name]
    path = edited(written(tmp_path), tmp_path, change)
    record = held_by(path)
    refused = [part for part in record.parts if part.what == CONTACTS and part.why_not]
    assert {part.why_not for part in refused} == {why}
    if name in ("adhesion", "adhesion at a distance", "surface"):
        assert [part.line for part in refused] == [line_of(path, change[1])]
        # States at which it touches are not judged.
        assert (record.verdict, record.explained) == (Verdict.AGREES, True)
        assert any(f"contacts (line {refused[0].line}: it {why})" in text for text in stays_off([], record.parts))


# Two things, of which another one may be the first to touch, and neither has a limit.
UNLIKE = """<mujoco><option tolerance="0" iterations="100"/><worldbody>
  <geom type="plane" size="2 2 0.1"/>
  <body name="ball" pos="1 0 0.12"><freejoint/><geom size="0.1"/></body>
  <body name="{name}" pos="0 0 0.3">{parts}</body>
</worldbody></mujoco>"""
ARM = '<joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>'
DEPARTING = {
    "inverse weight of a slider": '<joint type="slide" axis="0 0 1" armature="2"/><geom size="0.1"/>',
    "inverse weight of a body without mass": f'{ARM}<body name="hand" pos="0.3 0 0.1"><geom size="0.05" mass="0"/></body>',
}


@pytest.mark.parametrize("departure", DEPARTING)
def test_a_departure_in_contacts_of_some_states_is_told(departure: str, tmp_path: Path) -> None:
    path = tmp_path / "unlike.xml"
    path.write_text(UNLIKE.format(name="sled", parts=DEPARTING[departure]))
    record = held_by(path)
    assert (record.explained, record.message, [one.name for one in record.departures]) == (True, "", [departure])
    assert record.departures[0].concerns == CONTACTS and (record.departures[0].alone or 0.0) > 1e-4
    assert record.backward_error is not None and record.backward_error <= AGREEMENT


@pytest.mark.ci
def test_options_of_an_included_file_are_those_of_the_file(tmp_path: Path) -> None:
    """Its cones, ratio and iterations: a scene includes a robot that has them."""
    inner, path = written(tmp_path), tmp_path / "scene.xml"
    path.write_text(f'<mujoco><include file="{inner.name}"/></mujoco>')
    record = held_by(path)
    assert (record.verdict, record.explained) == (Verdict.AGREES, True) and record.touching >= 4
    edited(inner, tmp_path, REFUSED["noslip"][0])
    again = tmp_path / "again.xml"
    again.write_text(path.read_text())
    assert {part.why_not for part in held_by(again).parts if part.what == CONTACTS} == {REFUSED["noslip"][1]}


def test_bodies_that_hardly_touch_are_judged_with_contacts_on(tmp_path: Path) -> None:
    path = edited(written(tmp_path), tmp_path, ('type="plane"', 'type="plane" pos="0 0 -50"'))
    record = held_by(path)
    assert (record.verdict, record.touching) == (Verdict.AGREES, 0)


@pytest.mark.ci
def test_a_solver_that_stops_early_is_told(tmp_path: Path) -> None:
    path = edited(written(tmp_path), tmp_path, ('tolerance="0" iterations="100"', 'solver="CG" tolerance="1e-3"'))
    record = held_by(path)
    assert record.explained and record.to_the_end is not None and record.to_the_end <= AGREEMENT
    assert "stops its solver" in switched_on_text(record)
    assert FilesComparison(files=[FileRecord(path=str(path))], switched_on=[record]).switched_on_of(str(path)) == [record]
