"""Contacts that MuJoCo finds are those of the file: pairs, numbers, distances, normals and points."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import flint
import mujoco
import numpy as np
import pytest
from comparison.robots import line_of, meant_by
from support import call_engines_here

from harness.arrays import Array
from harness.comparison.geometry import hold_shapes
from harness.comparison.switched_on import judge_switched_on
from harness.engines.adapters.mujoco import robot as adapter
from harness.engines.adapters.mujoco.contacts import found_contacts, shapes_that_touch
from harness.explain import touching
from harness.explain.changes.shape_rules import shape_rules_of
from harness.files.contacts import FoundContact
from harness.results.shapes import ShapesRecord
from harness.results.switched_on import switched_on_text
from harness.trees.robot import read_robot
from harness.trees.shapes import PlacedShape, ShapesInWorld
from harness.truth.nearest import nearest
from harness.verdict import AGREEMENT, Verdict

SHAPES = """<mujoco>
  <default>
    <geom margin="0.01"/>
    <default class="soft"><geom condim="4" friction="0.5 0.1" gap="0.03" solmix="3" solref="0.03 1"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1" euler="10 5 0" pos="0 0 0.05"/>
    <body name="trunk" pos="0 0 0.3">
      <freejoint/>
      <geom name="trunk" size="0.1"/>
      <body name="arm" pos="0.2 0 0">
        <joint axis="0 1 0"/>
        <geom name="arm" class="soft" type="capsule" fromto="0 0 0 0.2 0.1 0" size="0.05"/>
        <body name="hand" pos="0.25 0.1 0">
          <joint axis="1 1 0" pos="0 0.01 0"/>
          <geom name="hand" class="soft" type="capsule" size="0.05 0.1" zaxis="1 2 0"/>
          <body pos="0 0.01 0"><geom name="box" type="box" size="0.05 0.05 0.05" pos="0 0 0.1"/></body>
        </body>
      </body>
    </body>
    <body name="other" pos="0.1 0.05 0.6">
      <freejoint/>
      <frame pos="0 0 0.01" euler="1 20 3">
        <geom name="rod" type="capsule" size="0.04 0.15" zaxis="1 2 3" priority="1" friction="0.3"/>
      </frame>
      <geom size="0.08" pos="0 0 0.2"/>
    </body>
    <body name="ball" pos="0.1 0.05 0.9"><freejoint/><geom name="ball" size="0.1" solref="-500 -10" contype="2" conaffinity="3"/></body>
    <body name="crate" pos="-0.6 0 0.2">
      <freejoint/>
      <geom name="crate" type="box" size="0.1 0.07 0.05" euler="10 20 30"/>
      <geom name="beam" type="box" size="0.03 1" fromto="0 0 0 0.2 0.1 0.1"/>
      <geom name="can" type="cylinder" size="0.03 0.05" pos="0 0 -0.05"/>
    </body>
    <body name="marble" pos="-0.6 0.02 0.34"><freejoint/><geom name="marble" size="0.04"/></body>
    <body name="ghost" pos="-0.4 0.3 0.1">
      <freejoint/><geom name="ghost" type="capsule" size="0.04 0.1" zaxis="1 1 0" contype="0" conaffinity="0" mass="1"/>
    </body>
  </worldbody>
  <contact>
    <exclude body1="trunk" body2="other"/>
    <pair geom1="floor" geom2="ghost" friction="0.4 0.2" condim="4" solreffriction="0.05 1" margin="0.02" gap="0.01"/>
  </contact>
</mujoco>
"""


def written(folder: Path, text: str, name: str = "shapes.xml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def found_at(path: Path, states: Array) -> list[tuple[FoundContact, ...]]:
    model = mujoco.MjModel.from_xml_path(str(path))
    data, found = mujoco.MjData(model), list[tuple[FoundContact, ...]]()
    for q in states:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        found.append(found_contacts(model, data.contact[: data.ncon]))
    return found


def states_of(path: Path, count: int, seed: int = 0) -> Array:
    """Where steps of MuJoCo lead."""
    model, random = mujoco.MjModel.from_xml_path(str(path)), np.random.default_rng(seed)
    data, found = mujoco.MjData(model), []
    for _ in range(count):
        mujoco.mj_resetData(model, data)
        data.qvel[:] = random.normal(size=model.nv)
        for _ in range(random.integers(0, 400)):
            mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


def held(path: Path, engine_has: Path | None = None, change: Callable[[FoundContact], FoundContact] = lambda one: one) -> ShapesRecord:
    """A file against MuJoCo on another one, whose contacts are changed."""
    own = engine_has or path
    states, names = states_of(own, 30), shapes_that_touch(mujoco.MjModel.from_xml_path(str(own)))
    record = hold_shapes(read_robot(path), states, [[change(one) for one in at] for at in found_at(own, states)], names)
    assert record is not None
    return record


def test_contacts_are_those_of_the_file(tmp_path: Path) -> None:
    record = held(written(tmp_path, SHAPES))
    assert (record.verdict, record.rest) == (Verdict.AGREES, [])
    assert record.contacts >= 100 and record.given >= 1 and 0 < record.error <= AGREEMENT


def in_float32(one: FoundContact) -> FoundContact:
    fields = ("point", "frame", "friction", "solref", "solimp", "sliding", "distance", "margin")
    return replace(one, **{name: np.float32(getattr(one, name)).tolist() for name in fields})


def test_contacts_in_float32_are_held_in_roundoffs_of_that(tmp_path: Path) -> None:
    path = written(tmp_path, SHAPES)
    states, names = np.float32(states_of(path, 30)).astype(float), shapes_that_touch(mujoco.MjModel.from_xml_path(str(path)))
    found = [[in_float32(one) for one in own] for own in found_at(path, states)]
    longer = [[replace(one, distance=one.distance - 1e-4) for one in own] for own in found]
    about = read_robot(path), states
    verdicts = [hold_shapes(*about, own, names, roundoff) for own, roundoff in ((found, 2.0**-24), (found, 2.0**-53), (longer, 2.0**-24))]
    assert [one and one.verdict for one in verdicts] == [Verdict.AGREES, Verdict.DISAGREES, Verdict.DISAGREES]
    assert verdicts[0] is not None and 0.01 < verdicts[0].error < 2


TWICE = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
  <body pos="0 0 0.25"><freejoint/><geom name="ball" size="0.1"/><geom name="rod" type="capsule" size="0.05 0.1" pos="0.3 0 -0.1"/></body>
  <body pos="0.3 0.12 0.2"><freejoint/><geom name="beside" type="capsule" size="0.05 0.1"/></body></worldbody>
  <contact><pair geom1="floor" geom2="ball" condim="1" margin="0.3"/><pair geom1="ball" geom2="floor" margin="{margin}"/>
    <pair geom1="floor" geom2="rod"/><pair geom1="floor" geom2="rod"/><pair geom1="rod" geom2="beside"/></contact></mujoco>"""


@pytest.mark.parametrize(("margin", "count"), [("0.3", 2), ("0.01", 1)])
def test_shapes_touch_once_for_each_element_that_pairs_them(margin: str, count: int, tmp_path: Path) -> None:
    """With the numbers of each; a pair that one element alone detects touches once."""
    path = written(tmp_path, TWICE.format(margin=margin))
    states = np.array(
        [[0, 0, 0.25, 1, 0, 0, 0, 0.3, 0.12, 0.2, 1, 0, 0, 0.0], [0, 0, 0.1, 0.9, 0.3, 0.2, 0.1, 0.3, 0.12, 0.2, 1, 0, 0, 0.0]]
    )
    states[1, 3:7] /= np.linalg.norm(states[1, 3:7])
    found, robot = found_at(path, states), read_robot(path)
    of_ball = [one for one in found[0] if set(one.shapes) == {"floor", "ball"}]
    assert [len(one.friction) for one in of_ball] == [0, 2][:count]
    record = hold_shapes(robot, states, found, shapes_that_touch(mujoco.MjModel.from_xml_path(str(path))))
    assert record is not None and (record.verdict, record.rest) == (Verdict.AGREES, [])
    for one in of_ball:
        others = [[other for other in found[0] if other is not one], found[1]]
        record = hold_shapes(robot, states, others, ["floor", "ball", "rod", "beside"])
        assert record is not None and re.search(rf"touch in {count} points by the file, and in {count - 1}", record.rest[0])


SUNK = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
  <body><freejoint/><geom name="crate" type="box" size="0.1 0.2 0.3"/></body></worldbody></mujoco>"""


def test_all_corners_of_a_box_touch_a_plane_by_the_rule_of_mujoco_warp(tmp_path: Path) -> None:
    path = written(tmp_path, SUNK)
    robot, (rule, _) = read_robot(path), shape_rules_of("mujoco_warp", "mujoco")
    states, signs = np.array([[0.0, 0.0, -0.5, 1.0, 0.0, 0.0, 0.0]]), list(itertools.product((-1.0, 1.0), repeat=3))
    (lowest, *_), *_ = found_at(path, states)
    corners = [(np.array(one) * (0.1, 0.2, 0.3) + (0.0, 0.0, -0.5)).tolist() for one in signs]
    every = [replace(lowest, distance=z, point=(x, y, z / 2)) for x, y, z in corners]
    assert robot.shapes is not None and [rule.bears_on(robot.tree, one) for one in robot.shapes.shapes] == [False, True]
    about = robot, states, [every], ["floor", "crate"], 2.0**-24
    documented, by_rule = hold_shapes(*about), hold_shapes(*about, rule.every_corner)
    assert documented is not None and re.fullmatch(r"'crate' .* and 'floor' .* touch in 8 points, where the file has 4", documented.rest[0])
    assert by_rule is not None and (by_rule.verdict, by_rule.contacts, by_rule.rest) == (Verdict.AGREES, 8, [])
    seven = hold_shapes(robot, states, [every[1:]], *about[3:], rule.every_corner)
    assert seven is not None and seven.verdict == Verdict.DISAGREES


def text_with(old: str, new: str) -> str:
    assert old in SHAPES
    return SHAPES.replace(old, new)


OTHER_FILES = {
    "radius": (text_with('name="trunk" size="0.1"', 'name="trunk" size="0.1000000001"'), "distances", "trunk"),
    "position": (text_with('size="0.05 0.1" zaxis', 'pos="1e-10 0 0" size="0.05 0.1" zaxis'), "points", "hand"),
    "axis": (text_with('zaxis="1 2 3"', 'zaxis="1 2 3.000001"'), "points", "rod"),
    "orientation of a plane": (text_with('euler="10 5 0"', 'euler="10 5.0000001 0"'), "normals", "floor"),
    "margin": (text_with('name="ball" size', 'name="ball" margin="0.0100001" size'), "margin", "ball"),
    "dropped": (
        text_with("<contact>", '<contact><exclude body1="ball" body2="world"/>'),
        "touch in 1 points by the file, and in 0",
        "ball",
    ),
    "further": (text_with('<exclude body1="trunk" body2="other"/>', ""), "the file has them touch nowhere", "trunk"),
    "priority": (text_with('priority="1"', ""), "friction", "rod"),
    "solmix": (text_with('solmix="3"', 'solmix="1"'), "solref", "arm"),
    "condim": (text_with('condim="4"', 'condim="3"'), "friction", "arm"),
    "edge of a box": (text_with('size="0.1 0.07 0.05"', 'size="0.1 0.07 0.0500000001"'), "distances", "crate"),
    "end of a box": (text_with("0.2 0.1 0.1", "0.2 0.1 0.1000000001"), "points", "beam"),
    "friction of a pair": (text_with('friction="0.4 0.2"', 'friction="0.4 0.25"'), "friction", "ghost"),
    "slip of a pair": (text_with('solreffriction="0.05 1"', ""), "solreffriction", "ghost"),
    "dropped pair": (text_with('<pair geom1="floor" geom2="ghost"', '<pair geom1="trunk" geom2="ghost"'), "by the file, and in 0", "ghost"),
    "contype": (text_with('contype="2" conaffinity="3"', 'contype="2" conaffinity="4"'), "by the file", "ball"),
}


@pytest.mark.ci
@pytest.mark.parametrize("fault", OTHER_FILES)
def test_contacts_of_another_file_are_red(fault: str, tmp_path: Path) -> None:
    text, what, name = OTHER_FILES[fault]
    path = written(tmp_path, SHAPES)
    record = held(path, written(tmp_path, text, "other.xml"))
    line = line_of(path, f'geom name="{name}"')
    assert record.verdict == Verdict.DISAGREES
    assert any(what in sentence and f"{name!r} (line {line})" in sentence for sentence in record.rest), record.rest


CHANGED: dict[str, Callable[[FoundContact], FoundContact]] = {
    "friction": lambda one: replace(one, friction=tuple(min(mu, 0.5) for mu in one.friction)),
    "distances": lambda one: replace(one, distance=one.distance + 1e-12),
    "normals": lambda one: replace(one, frame=(*(-x for x in one.frame[:3]), *one.frame[3:])),
    "points": lambda one: replace(one, point=(one.point[0] + 1e-12, *one.point[1:])),
    "axes of contact": lambda one: replace(one, frame=(*one.frame[:3], 1.0, 0.0, 0.0, *one.frame[6:])),
}


@pytest.mark.ci
@pytest.mark.parametrize("fault", CHANGED)
def test_contacts_that_are_changed_are_red(fault: str, tmp_path: Path) -> None:
    record = held(written(tmp_path, SHAPES), change=CHANGED[fault])
    assert record.verdict == Verdict.DISAGREES and any(fault in sentence for sentence in record.rest)


@pytest.fixture
def at_few_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """Truth at the fewest states that are judged; shapes are held against contacts at all."""
    monkeypatch.setattr(touching, "MOST_WORK", 0)


@pytest.mark.ci
@pytest.mark.usefixtures("at_few_states")
def test_a_record_says_what_is_judged(tmp_path: Path) -> None:
    record = judge_switched_on(meant_by(written(tmp_path, SHAPES)), "mujoco")
    assert record.shapes is not None and (record.explained, record.shapes.rest) == (True, [])
    assert record.shapes.contacts > 0 and "roundoffs of where the file has them" in record.shapes.text


@pytest.mark.ci
@pytest.mark.usefixtures("at_few_states")
def test_a_record_is_red_where_contacts_are_not_those_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The optimum is that of the contacts as they are given, and agrees."""
    call_engines_here(monkeypatch)
    real = adapter.found_contacts
    change = CHANGED["points"]
    monkeypatch.setattr(adapter, "found_contacts", lambda model, data: [change(one) for one in real(model, data)])
    path = written(tmp_path, SHAPES)
    record = judge_switched_on(meant_by(path), "mujoco")
    assert (record.verdict, record.explained) == (Verdict.DISAGREES, False)
    assert switched_on_text(record).startswith("finds other contacts than the file has: ")
    line = line_of(path, 'name="floor"')
    assert f"(line {line})" in " ".join(record.rest)


UPRIGHT = """<mujoco><worldbody>
<geom name="slope" type="plane" size="1 1 1" euler="0 30 0"/>
<body euler="0 30 0"><freejoint/><geom name="post" type="capsule" size="0.1 0.2" pos="0 0 0.299" euler="{tilt} 0 0"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(("tilt", "is_square"), [(0, False), (0.01, True)])
def test_a_capsule_upright_on_a_slope_has_a_frame_that_is_not_square(tilt: float, is_square: bool, tmp_path: Path) -> None:
    """See docs/issues/mujoco-tangent-of-upright-capsules.md."""
    path = written(tmp_path, UPRIGHT.format(tilt=tilt))
    model = mujoco.MjModel.from_xml_path(str(path))
    states = np.array([model.qpos0])
    record = hold_shapes(read_robot(path), states, found_at(path, states), shapes_that_touch(model))
    wrong = ["'post' (line 3) and 'slope' (line 2) have axes of contact that are not square"]
    assert record is not None and (record.contacts, record.rest) == (1, [] if is_square else wrong)


@pytest.mark.ci
@pytest.mark.usefixtures("at_few_states")
def test_no_contact_is_said_of_a_file_that_overrides_their_numbers(tmp_path: Path) -> None:
    path = written(tmp_path, SHAPES.replace("<default>", '<option o_margin="0.1"><flag override="enable"/></option><default>', 1))
    assert judge_switched_on(meant_by(path), "mujoco").shapes is None


REPLICAS = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<replicate count="3" offset="0.3 0 0" euler="0 0 20">
  <body name="ball" pos="0.5 0 0.1"><freejoint/><geom name="ball" size="0.11"/><geom type="capsule" size="0.05 0.2" euler="80 0 0"/></body>
</replicate>
<body name="last" pos="0 0.4 0.1"><freejoint/><geom size="0.11"/><replicate count="2" offset="0 0 0.1"><geom size="0.1"/></replicate></body>
</worldbody></mujoco>"""


# As of a robot and the scene that it includes, each with a worldbody.
WORLDS = """<mujoco>
<worldbody><geom type="plane" size="3 3 1"/><body pos="0 0 .1"><freejoint/><geom size=".11"/></body></worldbody>
<worldbody>
  <geom type="box" size=".3 .3 .1" pos="1 0 .1" friction=".3"/>
  <body pos="1 0 .25"><freejoint/><geom size=".1"/></body><body pos="2 0 .05"><freejoint/><geom size=".1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("text", [REPLICAS, WORLDS], ids=["replicas", "worldbodies"])
def test_replicas_and_unnamed_shapes_of_several_worldbodies_are_told_apart(text: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    model = mujoco.MjModel.from_xml_path(str(path))
    [found] = found_at(path, model.qpos0[None])
    record = hold_shapes(read_robot(path), model.qpos0[None], [found], shapes_that_touch(model))
    assert record is not None and (record.rest, record.given, record.contacts) == ([], 0, len(found))
    assert {name for one in found for name in one.bodies} == {"world", *(body.name for body in read_robot(path).tree.bodies)}


@pytest.mark.ci
def test_the_last_of_many_replicas_stands_where_the_file_puts_it(tmp_path: Path) -> None:
    """It is turned 49 times, by angles in degrees that no float64 number is in radians."""
    replicas = '<replicate count="50" offset="0 0 0.01" euler="0 0 {turn}"><geom type="capsule" {geom}/></replicate>'
    first = replicas.format(turn=25, geom='size=".01 .05" pos="0 -.23 -.2" euler="0 84.5 0"')
    second = replicas.format(turn=15, geom='size=".032 .04" pos=".025 -.2 -.2" euler="-24 -12 2"')
    bodies = f'<body name="one"><freejoint/>{first}</body><body name="two"><freejoint/>{second}</body>'
    path = written(tmp_path, f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    model, random = mujoco.MjModel.from_xml_path(str(path)), np.random.default_rng(0)
    states = np.tile(model.qpos0, (6, 1)) + random.normal(scale=0.2, size=(6, model.nq))
    for start in (3, 10):
        states[:, start : start + 4] /= np.linalg.norm(states[:, start : start + 4], axis=1, keepdims=True)
    record = hold_shapes(read_robot(path), states, found_at(path, states), shapes_that_touch(model))
    assert record is not None and record.contacts > 50 and record.rest == []


# Trees of any kind.


def tree_of(folder: Path, seed: int) -> Path:
    """Spheres and capsules on joints, fixed to one another and in frames, with filters and numbers of all kinds."""
    random = np.random.default_rng(seed)
    opened, parts, names = 0, list[str](), list[str]()
    for number in range(int(random.integers(3, 12))):
        x, y, z = random.normal(size=3) * 0.15
        kind = random.choice(["hinge", "slide", "ball", "none"])
        joint = "" if kind == "none" else f'<joint type="{kind}" axis="{x:.3f} {y:.3f} 0.3" pos="0 {z:.3f} 0"/>'
        if not opened:
            joint = "" if kind == "none" else "<freejoint/>"
        parts.append(f'<body name="b{number}" pos="{x:.3f} {y:.3f} {z if opened else 0.3:.3f}">{joint}')
        opened += 1
        for _ in range(int(random.integers(1, 3))):
            a, b, c = random.normal(size=3) * 0.1
            radius = random.uniform(0.02, 0.1)
            ends = f'type="capsule" fromto="0 0 0 {a:.3f} {b:.3f} {c:.3f}" size="{radius:.3f}"'
            stands = f'type="capsule" euler="{90 * a:.2f} {900 * b:.2f} 10" size="{radius:.3f} {random.uniform(0.02, 0.2):.3f}"'
            box = f'type="box" euler="{900 * b:.2f} {900 * c:.2f} 10" size="{radius:.3f} {random.uniform(0.02, 0.1):.3f} 0.03"'
            beam = f'type="box" fromto="0 0 0 {a:.3f} {b:.3f} {c:.3f}" size="{radius:.3f}"'
            shape = random.choice([f'size="{radius:.3f}"', ends, stands, box, beam])
            slide, spin = random.uniform(0.1, 1.5, 2)
            numbers = f'friction="{slide:.3f} {spin:.3f}" solmix="{random.choice([0.3, 1, 2])}" margin="{random.choice([0, 0.013])}"'
            soft = f'solref="{random.choice(["0.02 1", "0.05 0.7", "-300 -20"])}" gap="{random.choice([0, 0.02])}"'
            others = f'priority="{random.choice([0, 0, 1])}" condim="{random.choice([1, 3, 4, 6])}" contype="{random.choice([1, 2, 3])}"'
            named = f"name='g{len(parts)}'"
            names.append(named[6:-1])
            geom = f"<geom {named} {shape} mass='1' {numbers} {soft} {others}/>"
            parts.append(f'<frame pos="0 {a:.3f} 0" axisangle="1 {b:.3f} 0 30">{geom}</frame>' if random.random() < 0.3 else geom)
        closing = int(random.integers(0, opened + 1)) if random.random() < 0.5 else 0
        parts.append("</body>" * closing)
        opened -= closing
    parts.append("</body>" * opened)
    one = f'geom1="{random.choice(names)}" geom2="floor" friction="{random.choice([0, 0.3])}" condim="{random.choice([1, 3, 6])}"'
    pair = f'<pair {one} margin="{random.choice([0, 0.05])}" gap="0.01"/>' if random.random() < 0.7 else ""
    exclude = f'<contact><exclude body1="b0" body2="b2"/>{pair}</contact>'
    flag = f'<option><flag filterparent="{random.choice(["enable", "disable"])}"/></option>'
    floor = f'<geom name="floor" type="plane" size="1 1 1" euler="{random.normal():.3f} 3 0"/>'
    text = f"<mujoco>{flag}<worldbody>{floor}<geom size='0.1' pos='0.1 0 0'/>{''.join(parts)}</worldbody>{exclude}</mujoco>"
    return written(folder, text, f"tree{seed}.xml")


@pytest.mark.parametrize("seed", [pytest.param(one, marks=pytest.mark.nightly if one > 5 else ()) for one in range(60)])
def test_no_tree_is_red(seed: int, tmp_path: Path) -> None:
    path = tree_of(tmp_path, seed)
    model, random = mujoco.MjModel.from_xml_path(str(path)), np.random.default_rng(seed)
    states = np.array([mujoco.MjData(model).qpos + random.normal(size=model.nq) * random.choice([0.05, 0.5]) for _ in range(20)])
    record = hold_shapes(read_robot(path), states, found_at(path, states), shapes_that_touch(model))
    assert record is not None and (record.rest, record.verdict) == ([], Verdict.AGREES)


PARALLEL = """<mujoco><worldbody>
<body name="one" pos="0 0 0"><freejoint/><geom name="one" type="capsule" size="0.1 0.3"/></body>
<body name="two" pos="0.15 0 0"><freejoint/><geom name="two" type="capsule" size="0.08 0.2"/></body></worldbody></mujoco>"""


def parallel_states(random: np.random.Generator, count: int) -> Array:
    """Two capsules beside one another, end to end, and with a part of their lengths beside one another, turned together."""
    found = []
    for _ in range(count):
        turn, offset = random.normal(size=4), np.zeros(3)
        turn /= np.linalg.norm(turn)
        mujoco.mju_rotVecQuat(offset, np.array([0.15, 0.02, random.choice([0.0, 0.1, 0.3, 0.45, 0.52])]), turn)
        found.append([0, 0, 0, *turn, *offset, *turn])
    return np.array(found)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda one: one, ""),
        (lambda one: replace(one, point=tuple(np.add(one.point, 1e-12))), "points"),
        (lambda one: replace(one, distance=one.distance + 1e-12), "distances"),
        (lambda one: replace(one, frame=(*(-x for x in one.frame[:3]), *one.frame[3:])), "normals"),
    ],
)
def test_parallel_capsules_touch_anywhere_beside_one_another(
    change: Callable[[FoundContact], FoundContact], fault: str, tmp_path: Path
) -> None:
    path = written(tmp_path, PARALLEL)
    states = parallel_states(np.random.default_rng(0), 12)
    found = [[change(one) for one in own] for own in found_at(path, states)]
    record = hold_shapes(read_robot(path), states, found, ["one", "two"])
    assert record is not None and record.contacts == sum(map(len, found)) >= 12
    assert any(fault in one for one in record.rest) if fault else (record.rest, record.given) == ([], 0)


def test_a_contact_of_parallel_capsules_beyond_their_ends_is_red(tmp_path: Path) -> None:
    """A capsule whose end is turned away from the middle of the other: what faces the end is further than what is nearest."""
    path = written(tmp_path, PARALLEL)
    states = np.array([[0.0, 0, 0, 1, 0, 0, 0, 0.15, 0, 0.3, 1, 0, 0, 0]])
    [[first, *_]] = found_at(path, states)
    moved = replace(first, point=(first.point[0], first.point[1], 0.45))
    record = hold_shapes(read_robot(path), states, [[moved]], ["one", "two"])
    assert record is not None and "touch where they are further apart than elsewhere" in record.rest[0]


@pytest.mark.parametrize("depth", [0.01, 0.2])
def test_corners_as_high_as_the_centre_may_touch_or_not(depth: float, tmp_path: Path) -> None:
    """A cube on its edge, deep enough in the ground for the corners beside its centre."""
    text = f"""<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
    <body pos="0 0 {0.1 * 2**0.5 - depth}" euler="45 0 0"><freejoint/><geom name="cube" type="box" size="0.1 0.1 0.1"/></body>
    </worldbody></mujoco>"""
    path = written(tmp_path, text)
    states = np.array([mujoco.MjModel.from_xml_path(str(path)).qpos0])
    [found] = found_at(path, states)
    for own in (found, found[:2]):
        record = hold_shapes(read_robot(path), states, [own], ["floor", "cube"])
        assert record is not None and (record.rest, record.contacts) == ([], len(own))
    record = hold_shapes(read_robot(path), states, [found[:1]], ["floor", "cube"])
    assert record is not None and "touch in 2 points by the file, and in 1 by the engine" in record.rest[0]


@pytest.mark.parametrize("where", [(0.06, 0.01, 0.02), (0.13, 0.1, 0.03), (0.0, -0.18, 0.31), (-0.09, 0.18, 0.295)])
def test_a_sphere_leaves_a_box_through_the_nearest_face(where: tuple[float, float, float], tmp_path: Path) -> None:
    text = f"""<mujoco><worldbody><geom name="box" type="box" size="0.1 0.2 0.3"/>
    <body pos="{" ".join(map(str, where))}"><freejoint/><geom name="ball" size="0.15"/></body></worldbody></mujoco>"""
    path = written(tmp_path, text)
    states = np.array([mujoco.MjModel.from_xml_path(str(path)).qpos0])
    record = hold_shapes(read_robot(path), states, found_at(path, states), ["box", "ball"])
    assert record is not None and (record.rest, record.contacts) == ([], 1)


# Against what is least among many points.


def sampled(shape: PlacedShape, ways: Array) -> Array:
    """(k, 3) points of the axis."""
    centre, axis = (np.array([float(part.mid()) for part in own]) for own in (shape.centre, shape.axis))
    return centre + ways[:, None] * float(shape.half.mid()) * axis


@pytest.mark.parametrize("seed", range(3))
def test_no_points_of_two_capsules_are_nearer(seed: int, tmp_path: Path) -> None:
    path = tree_of(tmp_path, seed)
    robot, ways = read_robot(path), np.linspace(-1, 1, 401)
    states = states_of(path, 2)
    placed = ShapesInWorld(robot.tree, robot.joints, robot.shapes.shapes)
    for q in states:
        with flint.ctx.workprec(192):
            own = [one for one in placed.at(q.tolist()) if one.shape.kind in ("sphere", "capsule")]
            for first, second in itertools.pairwise(own):
                for one in nearest(first, second) or ():
                    apart = np.linalg.norm(sampled(first, ways)[:, None] - sampled(second, ways)[None], axis=-1).min()
                    least = apart - float(first.radius.mid()) - float(second.radius.mid())
                    spacing = max(float(first.half.mid()), float(second.half.mid())) / 200
                    assert -1e-12 <= least - float(one.distance.mid()) <= 2 * spacing + 1e-12


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("<worldbody>", '<option><flag override="enable"/></option><worldbody>', "overrides the numbers of all contacts"),
        ("</worldbody>", '<body mocap="true" pos="0 0 5"><geom size="0.1"/></body></worldbody>', "has bodies that are moved from outside"),
        ("</worldbody>", "</worldbody><deformable/>", "has deformable bodies"),
        ("</worldbody>", '<geom size="large"/></worldbody>', "has shapes that are not read: "),
    ],
)
def test_a_file_whose_shapes_mean_something_else_says_why(old: str, new: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "shapes.xml"
    path.write_text(SHAPES.replace(old, new, 1))
    shapes = read_robot(path).shapes
    assert shapes is not None and shapes.why_not.startswith(why)


# Shapes in frames that are nearly theirs.

NEARLY = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="link" pos="0 0 0.2"><freejoint/>
  <inertial pos="0.1 0.02 0" quat="0.8 0 0.6 0" mass="1" diaginertia="0.01 0.02 0.015"/>
  <geom name="rod" type="capsule" size="0.05 0.2" pos="{pos}" quat="{quat}"/>
</body>
</worldbody></mujoco>"""
PLACED = {
    "at the inertia": ("0.1000003 0.0199996 0", "0.8000002 0 0.6 0"),
    "along the inertia": ("0.1 0.03 0", "0.8 1e-7 0.6 0"),
    "at the body": ("3e-7 0 -5e-7", "1 0 4e-7 0"),
    "along the body": ("0.2 0 0", "1 0 4e-7 0"),
}


@pytest.mark.usefixtures("at_few_states")
@pytest.mark.parametrize("place", PLACED)
def test_a_shape_that_is_nearly_in_a_frame_of_its_body_is_put_there(place: str, tmp_path: Path) -> None:
    position, orientation = PLACED[place]
    path = written(tmp_path, NEARLY.format(pos=position, quat=orientation))
    record = judge_switched_on(meant_by(path), "mujoco")
    assert record.shapes is not None and (record.explained, record.shapes.rest) == (True, [])
    assert record.shapes.contacts > 0 and record.shapes.verdict == Verdict.EXPLAINED
    line = line_of(path, 'name="rod"')
    assert f"differ by less than 1e-6 (line {line}): write" in record.shapes.text


@pytest.mark.usefixtures("at_few_states")
@pytest.mark.parametrize(("position", "orientation"), [("0.100002 0.02 0", "0.80001 0 0.6 0"), ("2e-6 0 0", "0.8 0 0.60001 0")])
def test_one_that_is_further_from_them_stays_where_the_file_has_it(position: str, orientation: str, tmp_path: Path) -> None:
    path = written(tmp_path, NEARLY.format(pos=position, quat=orientation))
    record = judge_switched_on(meant_by(path), "mujoco")
    assert record.shapes is not None and (record.shapes.verdict, record.shapes.rule, record.shapes.rest) == (Verdict.AGREES, "", [])
    robot, (rule,) = read_robot(path), shape_rules_of("mujoco", "")
    assert robot.shapes is not None
    assert [rule.of(robot.tree, shape) for shape in robot.shapes.shapes] == [*robot.shapes.shapes]


@pytest.mark.ci
@pytest.mark.usefixtures("at_few_states")
def test_contacts_elsewhere_are_red_beside_one_that_is_put_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    call_engines_here(monkeypatch)
    real = adapter.found_contacts
    monkeypatch.setattr(adapter, "found_contacts", lambda model, data: [CHANGED["points"](one) for one in real(model, data)])
    position, orientation = PLACED["at the inertia"]
    record = judge_switched_on(meant_by(written(tmp_path, NEARLY.format(pos=position, quat=orientation))), "mujoco")
    assert record.shapes is not None and record.shapes.rest and record.shapes.verdict == Verdict.DISAGREES
