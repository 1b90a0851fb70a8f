"""Numbers, attributes and elements of a model: found where they stand, changed in place, and watched."""

from __future__ import annotations

import copy
import math
import pickle
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from harness.files.given import Given, Place
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.files.text.anatomy import anatomy
from harness.files.text.joint_table import constraint_texts, joint_rows, point_springs
from harness.files.text.lines import lines_of
from harness.files.text.scan import (
    Element,
    Number,
    Watch,
    all_elements,
    edited,
    find_elements,
    find_numbers,
    largest_change,
    scaled,
    with_values,
    without,
)
from harness.files.text.slots import Slot
from harness.files.text.written_numbers import with_attributes_written, with_number_written
from harness.files.tree import Joint
from harness.library import MODEL_SUFFIXES, Library

MJCF = """\
<?xml version="1.0"?>
<!-- stiffness="3" -->
<!-- decoration: geom -->
<mujoco model="7">
  <option gravity='0 0 -9.81'><flag contact="disable"/></option>
  <worldbody>
    <geom size="4"/>
    <body name="2" pos="1
      -2.5e-3 0">
      <joint name="pin" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
    </body>
  </worldbody>
</mujoco>
"""
URDF = """\
<robot name="r">
  <link name="world"/><link name="bar"><inertial><mass value="2"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="pin" type="continuous"><parent link="world"/><child link="bar"/></joint>
  <gazebo reference="pin"><springStiffness>
    270 </springStiffness><springReference>0</springReference></gazebo>
</robot>
"""


def shown(number: Number) -> tuple[int, str, str, int, float]:
    return number.line, number.element, number.attribute, number.index, number.value


def test_numbers_are_found_with_line_element_and_attribute() -> None:
    assert [shown(number) for number in find_numbers(MJCF, "mjcf") if number.value] == [
        (5, "option", "gravity", 2, -9.81),
        (8, "body", "pos", 0, 1.0),
        (9, "body", "pos", 1, -2.5e-3),
        (10, "joint", "axis", 1, 1.0),
        (11, "inertial", "mass", 0, 2.0),
        *((11, "inertial", "diaginertia", place, 1.0) for place in range(3)),
    ]
    springs = [shown(number) for number in find_numbers(URDF, "urdf") if number.attribute == ""]
    assert springs == [(6, "springStiffness", "", 0, 270.0), (6, "springReference", "", 0, 0.0)]


def test_elements_know_their_place() -> None:
    elements = {element.path[-1]: element for element in find_elements(MJCF, "mjcf")}
    assert "geom" not in elements
    body = elements["body"]
    assert body.path == ("mujoco", "worldbody", "body") and body.line == 8 and body.get("name") == "2"
    assert MJCF[body.start : body.opened].startswith("<body") and MJCF[body.closed : body.end] == "</body>"
    joint = elements["joint"]
    assert MJCF[joint.start : joint.end] == '<joint name="pin" axis="0 1 0"/>'
    assert body.start < joint.start < joint.end < body.closed
    assert without(MJCF[joint.start : joint.end], (joint.attributes[1].start - joint.start, joint.attributes[1].end - joint.start)) == (
        '<joint name="pin"/>'
    )


@pytest.mark.parametrize("model_format", MODEL_SUFFIXES)
def test_every_number_of_every_shipped_model_stands_where_it_is_said_to(model_format: str) -> None:
    for path in sorted((Library.built_in().models / model_format).glob(f"*{MODEL_SUFFIXES[model_format]}")):
        text = path.read_text()
        numbers = find_numbers(text, model_format)
        assert numbers
        assert all(float(text[number.start : number.end]) == number.value for number in numbers)
        assert all(number.line == text.count("\n", 0, number.start) + 1 for number in numbers)
        assert with_values(text, {}) == without(text) == text
        # Written anew, a number keeps its value to the last bit and everything around it.
        again = find_numbers(scaled(text, numbers, 1.0), model_format)
        assert [shown(number) for number in again] == [shown(number) for number in numbers]


def test_values_are_replaced_in_place() -> None:
    numbers = [number for number in find_numbers(MJCF, "mjcf") if number.attribute in ("gravity", "mass") and number.value]
    changed = with_values(MJCF, {numbers[0]: -1.62, numbers[1]: 1e-15})
    assert changed == MJCF.replace("-9.81", "-1.62").replace('mass="2"', 'mass="1e-15"')
    assert scaled(MJCF, numbers, 2) == MJCF.replace("-9.81", "-19.62").replace('mass="2"', 'mass="4.0"')


def test_a_watch_sees_what_moves_and_what_is_refused() -> None:
    model = parse_model(Path("model.xml"), MJCF, "mjcf")

    def answer(changed: ModelFile) -> np.ndarray:
        """Two joints, of which the first feels gravity and the second, a thousand times faster, the mass."""
        values = {(number.element, number.attribute): number.value for number in find_numbers(changed.text, "mjcf")}
        if values["inertial", "mass"] > 10:
            raise ValueError("too heavy")
        with np.errstate(all="ignore"):
            return np.array([[values["option", "gravity"], 1e3 / np.float64(values["inertial", "mass"])]])

    watch = Watch(model, answer)
    gravity, mass = (
        next(number for number in find_numbers(MJCF, "mjcf") if number.attribute == name and number.value) for name in ("gravity", "mass")
    )
    assert watch.movement(MJCF) == 0
    assert watch.movement(scaled(MJCF, [gravity], 1.01)) == pytest.approx(0.01)
    assert watch.movement(scaled(MJCF, [mass], 0.0)) is None  # a leaf without mass is no valid model
    assert watch.movement(scaled(MJCF, [mass], 100.0)) is None  # the reader's own refusal
    assert watch.movement(scaled(MJCF, [mass], 1e-320)) == math.inf
    assert watch.movement(MJCF.replace('axis="0 1 0"', 'axis="0 2 0"')) is None


def test_what_constraints_leave_is_measured_by_a_metre_and_not_by_its_own_rounding() -> None:
    """Behind the acceleration of one joint, two rows of a closed loop hold rounding, which another order of operations changes."""
    healthy, moved = np.array([[2.0, 0.0, 3e-16], [-4.0, 0.0, 0.0]]), np.array([[2.0, 1e-16, 0.0], [-4.0, 0.0, 2e-16]])
    assert largest_change(healthy, moved, 1) == pytest.approx(3e-16)
    assert largest_change(healthy, moved) == math.inf
    opened = moved + np.array([0.0, 0.0, 1e-3])
    assert largest_change(healthy, opened, 1) == pytest.approx(1e-3)
    assert largest_change(healthy, 1.5 * healthy, 1) == pytest.approx(0.5)
    watch = Watch(parse_model(Path("model.xml"), MJCF, "mjcf"), lambda model: healthy if "-9.81" in model.text else opened, 1)
    assert watch.movement(MJCF.replace("-9.81", "-9.8")) == pytest.approx(1e-3)


def test_the_watched_model_is_the_one_that_was_read() -> None:
    path = Library.built_in().model_path("collar", "urdf")
    model = read_model(path, "urdf")
    assert parse_model(path, model.text, "urdf") == model


OPTIONS = [
    "",
    "<option/>",
    '<option gravity="0 0 -3"/>',
    "<option></option>",
    "<option>\n<flag/></option>",
    '<option><flag contact="disable"/></option>',
    '<option><flag gravity="disable"/></option><option><flag spring="disable" damper="enable"/></option>',
    '<option/><option gravity="0 0 -3"><flag damper="disable"/></option>',
]
FLAGS = {"gravity": "mjDSBL_GRAVITY", "spring": "mjDSBL_SPRING", "damper": "mjDSBL_DAMPER"}


@pytest.mark.parametrize("option", OPTIONS)
def test_a_stage_is_switched_wherever_its_flag_stands_or_would(option: str) -> None:
    """And no other one is, nor does a line move where the flag is taken away again."""
    body = '<body name="2"><joint name="pin" axis="0 1 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>'
    plain = f"<mujoco>{option}<worldbody>\n{body}</worldbody></mujoco>"

    def disabled(text: str) -> dict[str, bool]:
        flags = mujoco.MjModel.from_xml_string(text).opt.disableflags
        return {stage: bool(flags & getattr(mujoco.mjtDisableBit, flag)) for stage, flag in FLAGS.items()}

    def slots(text: str) -> dict[str, Slot]:
        return dict(anatomy(parse_model(Path("a.xml"), text, "mjcf")).stages)

    before = disabled(plain)
    assert {stage: slot.words for stage, slot in slots(plain).items()} == {
        stage: ("disable" if off else "enable",) for stage, off in before.items()
    }
    for stage, slot in slots(plain).items():
        for word in ("disable", "enable"):
            text = edited(plain, slot.written([word]))
            assert disabled(text) == {**before, stage: word == "disable"}
            gone = edited(text, slots(text)[stage].gone(text))
            assert disabled(gone) == {**before, stage: False} and gone.count("\n") == text.count("\n")


def slots_of(value: object) -> Iterator[Slot]:
    """Every slot in an anatomy."""
    if isinstance(value, Slot):
        yield value
    elif is_dataclass(value) and not isinstance(value, ModelFile):
        for part in fields(value):
            yield from slots_of(getattr(value, part.name))
    elif isinstance(value, Mapping):
        yield from slots_of(tuple(value.values()))
    elif isinstance(value, tuple):
        for one in value:
            yield from slots_of(one)


@pytest.mark.parametrize("model_format", MODEL_SUFFIXES)
def test_what_is_taken_away_leaves_its_default_and_all_else(model_format: str) -> None:
    """But what goes with it: an element that has no other attribute."""
    for name in ("collar", "furuta_pendulum.rotated_inertial", "spring_pendulum", "coupled_oscillators"):
        model = read_model(Library.built_in().model_path(name, model_format), model_format)
        every = [slot for slot in slots_of(anatomy(model)) if not slot.absent]
        assert len(every) > 5
        for slot in every:
            text = edited(model.text, slot.gone(model.text))
            left = find_elements(text, model_format)
            assert text.count("\n") == model.text.count("\n")
            assert slot.place.found not in {one.get(slot.place.attribute) for one in left if one.line == slot.place.line}
            gone = attributes_of(find_elements(model.text, model_format)) - attributes_of(left)
            # A spring of Gazebo's goes with the element that holds it.
            assert gone.total() <= 1 or slot.place.attribute == "", (slot.place, gone)


def attributes_of(elements: Sequence[Element]) -> Counter[tuple[object, ...]]:
    return Counter((one.path, attribute.name, attribute.value) for one in elements for attribute in one.attributes)


@pytest.mark.parametrize("before", [True, False])
def test_each_joint_has_the_rotor_of_its_own_transmission(before: bool) -> None:
    plain = read_model(Library.built_in().model_path("furuta_pendulum.armature", "urdf"), "urdf")
    head, opening, tail = plain.text.partition("<transmission")
    own = opening + tail.partition("</robot>")[0]
    further = own.replace('"gear"', '"further"').replace('"arm"', '"pendulum"').replace('"0.0001"', '"0.75"')
    text = head.replace('effort="0"', 'effort="1"') + (further + own if before else own + further) + "</robot>"
    bodies = anatomy(parse_model(plain.path, text, "urdf")).bodies
    rotors = {joint.name.words[0]: joint.armature.words for body in bodies for joint in body.joints if joint.armature is not None}
    assert rotors == {"arm": ("0.0001",), "pendulum": ("0.75",)}


# Every attribute on a line of its own, named by its value.
LINES = """<mujoco model="m">
<option gravity="0 0 -9"/>
<worldbody>
<frame
 pos="0 0 1"
 euler="10 0 0">
<body name="b"
 pos="1 0 0"
 quat="1 1 0 0">
<joint name="j"
 axis="0 1 0"
 pos="0 0 .1"
 damping="1"
 stiffness="2"
 springref="3"
 armature="4"/>
<inertial
 pos="0 0 .2"
 quat="1 0 1 0"
 mass="2"
 diaginertia="1 1 1"/>
<body name="fixed"
 pos="2 0 0">
<inertial
 pos="0 0 .3"
 mass="3"
 diaginertia="2 2 2"/>
</body>
</body></frame></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("quantity", "attributes"),
    [
        ("gravity", ['gravity="0 0 -9"']),
        ("joint", ['name="j"']),
        ("anchor", ['pos="1 0 0"', 'pos="0 0 1"', 'pos="0 0 .1"']),
        ("axis", ['axis="0 1 0"', 'quat="1 1 0 0"', 'euler="10 0 0"']),
        ("frame", ['quat="1 1 0 0"', 'euler="10 0 0"']),
        ("armature", ['armature="4"']),
        ("damping", ['damping="1"']),
        ("stiffness", ['stiffness="2"']),
        ("spring reference", ['springref="3"']),
        ("mass", ['mass="2"', 'mass="3"']),
        ("centre", ['pos="0 0 .2"', 'pos="0 0 .3"', 'pos="1 0 0"', 'quat="1 1 0 0"', 'pos="0 0 1"', 'euler="10 0 0"']),
        ("inertia", ['diaginertia="1 1 1"', 'quat="1 0 1 0"', 'diaginertia="2 2 2"', 'quat="1 1 0 0"', 'euler="10 0 0"']),
    ],
)
def test_the_lines_that_decide_a_quantity_begin_with_the_likeliest(quantity: str, attributes: list[str]) -> None:
    """What is the body's or joint's own first, then the body's place, then the frames around it."""
    lines = LINES.splitlines()
    found = [lines[line - 1] for line in lines_of(parse_model(Path("m.xml"), LINES, "mjcf"), quantity, "j")]
    assert len(found) == len(attributes) and all(one in line for one, line in zip(attributes, found, strict=True)), found


def test_a_row_of_a_joint_tells_what_the_file_leaves_out_in_brackets() -> None:
    inertial = '<inertial pos="0 0 0" mass="7" diaginertia="1 1 1"/>'
    further = f'<body name="s"><joint name="s" type="slide"/>{inertial}</body><body name="f"><freejoint name="f"/>{inertial}</body>'
    hinge, slide, free = joint_rows(parse_model(Path("m.xml"), LINES.replace("</frame>", f"</frame>{further}"), "mjcf"))
    place = "1 0 0, quat 1 1 0 0, body in frame 0 0 1, euler 10 0 0, joint at 0 0 .1"
    assert (hinge.kind, hinge.axis, hinge.origin, hinge.line) == ("(hinge)", "0 1 0", place, 10)
    assert (hinge.body, hinge.mass, hinge.damping, hinge.stiffness, hinge.armature) == ("b", "2", "1", "2", "4")
    assert (slide.kind, slide.axis, slide.origin, slide.damping) == ("slide", "(0 0 1)", "(0 0 0)", "")
    assert (free.kind, free.axis, free.mass) == ("free", "", "7")


PIN = Place(Path("robot.xml"), 10, 7, "joint")


def test_attributes_are_written_into_the_element_of_their_place() -> None:
    own = all_elements(MJCF, "mjcf")
    (pin,) = [number for number, element in enumerate(own) if element.tag == "joint"]
    place = replace(PIN, element=pin)
    changed = with_attributes_written(MJCF, "mjcf", place, {"axis": "1 0 0", "damping": "3"})
    assert changed == MJCF.replace('<joint name="pin" axis="0 1 0"/>', '<joint damping="3" name="pin" axis="1 0 0"/>')
    assert with_number_written(MJCF, "mjcf", Given(1.0, place, "axis", 1), 0.1) == MJCF.replace('axis="0 1 0"', 'axis="0 0.1 0"')
    for elsewhere in (replace(place, element=pin + 1), replace(place, element=len(own))):
        with pytest.raises(KeyError, match=r"<joint> at robot\.xml:10"):
            with_attributes_written(MJCF, "mjcf", elsewhere, {"damping": "3"})
    with pytest.raises(KeyError, match=r"axis of <joint> at robot\.xml:10"):
        with_number_written(MJCF, "mjcf", Given(1.0, place, "axis", 3), 0.1)


def test_a_number_of_a_file_is_itself_in_a_copy_and_knows_its_place_after_a_journey() -> None:
    number = Given(0.1, PIN, "axis", 2)
    assert copy.copy(number) is copy.deepcopy(number) is number
    again = pickle.loads(pickle.dumps(number))
    assert (again, again.key, again.component) == (number, (PIN, "axis", 2), "z")


def test_a_part_knows_places_of_what_its_file_gives_alone() -> None:
    joint = Joint("pin", JointKind.HINGE, damping=Given(1.0, PIN, "damping"))
    assert joint.place_of("damping") == PIN and joint.places == {"damping": PIN}
    with pytest.raises(KeyError, match="stiffness"):
        joint.place_of("stiffness")


def test_what_ties_a_mechanism_is_told_with_its_line_in_both_formats() -> None:
    library = Library.built_in()

    def told(name: str) -> list[str]:
        own = [read_model(library.model_path(name, model_format), model_format) for model_format in MODEL_SUFFIXES]
        return [line for model in own for line in (*constraint_texts(model), *point_springs(model))]

    squeezer = "constraint pin_3 holds a point of K2 at -0.028 0 0 at one of K3 at 0 0 -0.035"
    assert [line for line in told("andrews_squeezer") if "pin_3" in line] == [f"line 63: {squeezer}", f"line 120: {squeezer}"]
    left = "constraint rope_left moves joint rope_left by 0 0.2 0 0 0 of powers of pulley"
    assert [line for line in told("atwood") if "rope_left" in line] == [f"line 29: {left}", f"line 41: {left}"]
    assert told("collar") == [
        "line 23: spatial tendon over site anchor, site eye: name spring, stiffness 120, springlength 2.5",
        "line 24: spring from world at -2.5 0 0 to collar at 1.5 0 0, stiffness 120, damping 0, free length 2.5",
    ]
