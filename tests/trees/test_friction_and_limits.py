"""Dry friction and limits of a file: the certified optimum against MuJoCo's answers and against an evaluation of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import flint
import mujoco
import numpy as np
import pytest
from documented_optimum import DIGITS, Row, changed
from documented_optimum import optimum as documented_optimum
from flint import arb, arb_mat

from harness.arrays import Array
from harness.comparison.robot_library import ask_engine, engine_of
from harness.engines.request import Held, SolverSettings
from harness.explain.as_read import read_by
from harness.explain.changes.departures import Departure, departed, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.meant import Meant, question_of
from harness.files.equalities import SolverParameters, frictions_of, limits_of
from harness.files.tree import Body
from harness.library import Stance
from harness.programs.evaluation import mass_matrix, values
from harness.programs.kernels import BallKernel
from harness.programs.loops.interpreter import bounded_outputs
from harness.programs.mechanisms import zones
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import right_hand_side
from harness.programs.states import States
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import Robot, read_robot
from harness.truth.compare import Comparison, compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import near, pressed
from harness.truth.optimum import optimum
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import sample
from harness.verdict import AGREEMENT

SEED, STATES = 7, 24
BODIES = """
<body><joint name="a" axis="0 1 0" {a}/><inertial pos=".5 0 0" mass="1" diaginertia=".1 .1 .1"/>
<body pos="1 0 0"><joint name="b" type="slide" axis="0 .6 .8" {b}/><inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/>
<site name="s" pos=".1 .2 .3"/>
<body pos="0 0 1"><joint name="c" type="ball" {c}/><site name="t" pos="0 .2 .3"/>
<inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/></body></body></body>
<body><joint name="f" type="free" {f}/><site name="u" pos=".3 .1 -.2"/><inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/></body>"""


def written(folder: Path, /, option: str = "", tendons: str = "", **joints: str) -> Path:
    path = folder / "model.xml"
    bodies = BODIES.format(**{name: joints.get(name, "") for name in "abcf"})
    path.write_text(f"<mujoco>\n{option}\n<worldbody>{bodies}</worldbody>\n<tendon>{tendons}</tendon>\n</mujoco>")
    return path


def documented(robot: Robot, departures: Sequence[Departure] = ()) -> Mechanism:
    """The robot with its dry friction and limits, by the laws that MuJoCo documents, or with departures from them."""
    engine, root = engine_of("mujoco"), element_at(robot.tree.place)
    bounds = (*frictions_of(robot.tree), *limits_of(robot.tree), *limits_of(robot.tree, of_tendons=True))
    chosen = [one for one in (*robot.equalities, *bounds) if not one.why_not]
    laws = departed(departures, robot.tree, chosen, engine.laws(root, robot.format, chosen))
    return optimum(mechanism_of(robot), robot, chosen, laws, engine.fuses(root, robot.format))


def answered(path: Path, states: States) -> Array:
    """MuJoCo's accelerations with these alone, solved to the end."""
    model, off = mujoco.MjModel.from_xml_path(str(path)), mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_EQUALITY | off.mjDSBL_CONTACT | off.mjDSBL_AUTORESET | off.mjDSBL_ACTUATION)
    model.opt.density = model.opt.viscosity = 0.0
    model.opt.iterations, model.opt.tolerance = 100, 0.0
    data, found = mujoco.MjData(model), np.empty_like(states.v)
    for state in range(len(states)):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = states.q[state], states.v[state], states.tau[state]
        data.qacc_warmstart[:] = 0
        mujoco.mj_forward(model, data)
        found[state] = data.qacc
    return found


def states_of(robot: Robot, mechanism: Mechanism, count: int = STATES) -> States:
    """Sampled states, in which joints with limits reach beyond either by half of their range."""
    states, random, first = sample(mechanism, count, SEED), np.random.default_rng(SEED), 0
    q = states.q.copy()
    for name in robot.joints:
        joint = robot.joint(name)
        if joint.limits is not None and joint.kind.is_single:
            low, high = (math.radians(bound) if joint.in_degrees else float(bound) for bound in joint.limits)
            q[:, first] = random.uniform(low - (high - low) / 2, high + (high - low) / 2, count)
        first += joint.kind.positions
    return replace(states, q=q)


def judged(path: Path, robot: Robot | None = None) -> tuple[Mechanism, States, Comparison]:
    robot = robot or read_robot(path)
    mechanism = documented(robot)
    states = states_of(robot, mechanism)
    return mechanism, states, compare(ReferenceKernel(mechanism).evaluate(states), answered(path, states), factorises=True)


def worst(compared: Comparison) -> float:
    assert not np.isnan(compared.backward_error).any()
    return float(compared.backward_error.max())


RUBBING = {
    "hinge": {"a": 'frictionloss="3"'},
    "slide": {"b": 'frictionloss="3"'},
    "ball": {"c": 'frictionloss="0.5"'},
    "free": {"f": 'frictionloss="2"'},
    "all": dict.fromkeys("abcf", 'frictionloss="3"'),
    "soft": {"a": 'frictionloss="3" solimpfriction="0.3 0.6 0.001" solreffriction="0.5 1"'},
    "direct": {"a": 'frictionloss="3" solimpfriction="0.97 0.8 0.02 0.3 3" solreffriction="-100 -4"', "b": 'frictionloss="0.01"'},
    "refsafe": {"a": 'frictionloss="3" solreffriction="0.0001 1"'},
}


@pytest.mark.parametrize("name", RUBBING)
def test_mujoco_rubs_as_it_documents(name: str, tmp_path: Path) -> None:
    _, _, compared = judged(written(tmp_path, **RUBBING[name]))
    assert worst(compared) <= AGREEMENT


LIMITED = {
    "hinge": {"a": 'range="-40 30"'},
    "slide": {"b": 'range="-0.2 0.3"'},
    "margin": {"a": 'range="-40 30" margin="0.2"', "b": 'range="-0.2 0.3" margin="-0.05"'},
    "both at once": {"a": 'range="-4 3" margin="0.5"'},
    "soft": {"a": 'range="-40 30" solimplimit="0.3 0.6 0.5" solreflimit="0.5 0.7"'},
    "power": {"a": 'range="-40 30" solimplimit="0.1 0.9 0.9 0.3 3.3" solreflimit="-100 -4"', "b": 'range="-.2 .3" solimplimit="0 0 0"'},
    "with friction": {"a": 'range="-40 30" frictionloss="2"', "b": 'range="-0.2 0.3" frictionloss="5"', "c": 'frictionloss=".3"'},
}


@pytest.mark.parametrize("name", LIMITED)
def test_mujoco_limits_as_it_documents(name: str, tmp_path: Path) -> None:
    _, _, compared = judged(written(tmp_path, **LIMITED[name]))
    assert worst(compared) <= AGREEMENT


@pytest.mark.parametrize("kind", ['frictionloss="{0}" solimpfriction="0.3 0.6 0.001"', 'limited="true" range="-20 20"'])
@pytest.mark.parametrize("mass", [1e14, 1e17])
def test_what_is_heavy_is_no_stiffer_than_mujocos_least_regularisation(kind: str, mass: float, tmp_path: Path) -> None:
    path, inertia = tmp_path / "heavy.xml", f'<inertial pos=".5 0 0" mass="{mass}" diaginertia="{mass} {mass} {mass}"/>'
    body = f'<body><joint name="a" axis="0 1 0" {kind.format(mass)}/>{inertia}</body>'
    path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    _, _, compared = judged(path)
    assert worst(compared) <= AGREEMENT


@pytest.mark.parametrize("name", ["hinge", "both at once", "power"])
def test_a_state_that_is_pressed_is_beyond_a_limit(name: str, tmp_path: Path) -> None:
    """Whatever its own joints are at; of states that are not there nothing would ever be asked of limits."""
    robot = read_robot(written(tmp_path, **LIMITED[name]))
    mechanism = documented(robot)
    assert isinstance(mechanism, DeclaredMechanism)
    states = sample(mechanism, STATES, SEED)
    within = replace(states, q=np.where(np.arange(states.q.shape[1]) < 2, 0.0, states.q))
    assert mechanism.reaches_limits(pressed(mechanism, within)).all()


@dataclass(frozen=True)
class Drawn:
    """A model with joints a, b and c of random numbers, and the same numbers as rows."""

    path: Path
    rows: list[Row]


_TERMS = ((0, "1.5"), (1, "-2"))


def softness_of(random: np.random.Generator) -> dict[str, tuple[float, ...]]:
    """Parameters of the solver, by their names."""
    own: dict[str, tuple[float, ...]] = {}
    if random.random() < 0.5:
        own["solref"] = (round(random.uniform(0.001, 0.3), 4), round(random.uniform(0.3, 2), 3))
    elif random.random() < 0.5:
        own["solref"] = (-round(random.uniform(0, 300), 2), -round(random.uniform(0, 20), 2))
    if random.random() < 0.6:
        shape = round(random.uniform(0, 1), 3), round(random.uniform(0.1, 1), 2), round(random.uniform(1, 4), 2)
        own["solimp"] = (round(random.uniform(0, 1), 3), round(random.uniform(0.3, 1), 3), *shape)
    return own


def attribute(name: str, values: Sequence[float]) -> str:
    return f'{name}="{" ".join(repr(float(one)) for one in values)}"'


def drawn(folder: Path, seed: int, kinds: Sequence[str] = ("friction", "limit", "coupling")) -> Drawn:
    """A hinge, a slide and a ball joint with friction and limits of any numbers, a sum of the first two with both, and a coupling."""
    random = np.random.default_rng(seed)
    attributes: dict[str, str] = {}
    numbers: list[tuple[str, dict[str, Any]]] = []
    for name in ("a", "b", "c", "sum"):
        for of in ("friction", "limit") if name != "c" else ("friction",):
            if random.random() < (0.2 if name != "sum" else 0.6) or of not in kinds:
                continue
            own: dict[str, Any] = softness_of(random)
            texts = [attribute(f"{key}{of}", value) for key, value in own.items()]
            if of == "friction":
                own["loss"] = round(10 ** random.uniform(-2, 1.2), 4)
                texts.append(attribute("frictionloss", [own["loss"]]))
            else:
                own["range"] = round(random.uniform(-1, -0.1), 3), round(random.uniform(0.1, 1), 3)
                own["margin"] = round(random.choice([0.0, random.uniform(-0.1, 0.9)]), 3)
                texts += [attribute("range", own["range"]), attribute("margin", [own["margin"]])]
            attributes[name] = f"{attributes.get(name, '')} {' '.join(texts)}"
            numbers.append((name, own))
    couplings = ""
    if random.random() < 0.4 and "coupling" in kinds:
        own = softness_of(random) | {"coefficients": tuple(np.round(random.uniform(-1, 1, 5), 3).tolist())}
        texts = [attribute(key.replace("coefficients", "polycoef"), value) for key, value in own.items()]
        couplings, numbers = f'<equality><joint name="e" joint1="a" joint2="b" {" ".join(texts)}/></equality>', [*numbers, ("e", own)]
    tendon = "".join(f'<joint joint="{"ab"[place]}" coef="{multiple}"/>' for place, multiple in _TERMS)
    tendons = f"<fixed {attributes.pop('sum')}>{tendon}</fixed>" if "sum" in attributes else ""
    path = written(folder, f'<compiler angle="radian"/>{couplings}', tendons, **attributes)
    with flint.ctx.workprec(5 * DIGITS):
        reference = Terms(mechanism_of(read_robot(path)))
        inverse = reference.at([0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0], [0] * 11, [0] * 11)[0].inv()
        along = arb_mat([[arb(float(multiple)) for _, multiple in _TERMS] + [0] * 9])
        weights = {
            "a": inverse[0, 0],
            "b": inverse[1, 1],
            "c": sum((inverse[i, i] for i in (2, 3, 4)), arb(0)) / 3,
            "sum": (along * inverse * along.transpose())[0, 0],
            "e": arb(float(inverse[0, 0])) + arb(float(inverse[1, 1])),
        }
    places = {"a": (0,), "b": (1,), "sum": (0, 1), "e": (0, 1)}
    rows: list[Row] = []
    for name, own in numbers:
        weight = arb(float(weights[name]))
        sums = {"multiples": tuple(float(multiple) for _, multiple in _TERMS)} if name == "sum" else {}
        own |= {"owner": name, "constraint": f"friction of {name}"} | sums
        if name == "c":
            rows += [Row((column,), weight, **own) for column in (2, 3, 4)]
        elif "range" in own:
            low_and_high = zip((1, -1), own.pop("range"), strict=True)
            ends = [own | {"sign": sign, "bound": bound, "constraint": f"limit {sign} of {name}"} for sign, bound in low_and_high]
            rows += [Row(places[name], weight, places[name], **end) for end in ends]
        else:
            rows.append(Row(places[name], weight, places[name], **own))
    return Drawn(path, rows)


class Terms:
    """M and f of a tree, as matrices of balls."""

    def __init__(self, mechanism: RobotMechanism) -> None:
        self.mechanism, self.kernel = mechanism, BallKernel(mechanism.program, 0)

    def at(self, q: Sequence[Any], v: Sequence[Any], tau: Sequence[Any], parameters: Sequence[Any] | None = None) -> tuple[Any, Any]:
        """With other values of parameters than the mechanism's own, where they are given."""
        own = self.mechanism.parameter_values if parameters is None else parameters
        flat = list(self.kernel.bind([])(*map(arb, itertools.chain(q, v, tau, [0], own))))
        found = {}
        for name, places in self.mechanism.program.outputs.items():
            found[name], flat = flat[: len(places)], flat[len(places) :]
        return mass_matrix(found["mass"], self.mechanism.nv), arb_mat([[one] for one in right_hand_side(found, list(map(arb, tau)))])


def length(vector: Sequence[Any], mass: Any) -> float:
    """In the norm of M."""
    column = arb_mat([[one] for one in vector])
    return float((column.transpose() * mass * column)[0, 0].mid()) ** 0.5


def shares_of_the_bound(model: Drawn, count: int, in_balls: bool = False) -> Array:
    """(n,) distances between the truth and the optimum by active sets, of what the truth certifies."""
    robot = read_robot(model.path)
    mechanism = documented(robot)
    states = states_of(robot, mechanism_of(robot), count)
    if robot.equalities:
        assert isinstance(mechanism, DeclaredMechanism)
        # Every second state nearly closes the coupling; elsewhere its impedance is that of far away.
        closing = (np.arange(count) % 2 == 1)[:, None]
        states = replace(states, q=np.where(closing, near(mechanism, states).q, states.q))
    kernel = ReferenceKernel(mechanism)
    if in_balls:
        for chart in kernel._charts:
            chart.__dict__["encoded"] = chart.__dict__["swept"] = None
    return shares_at(kernel, states, Terms(mechanism_of(robot)), model.rows)


def shares_at(kernel: ReferenceKernel, states: States, plain: Terms, rows: Sequence[Row]) -> Array:
    """The same at given states, with the equations of the tree and the rows."""
    truth, shares = kernel.evaluate(states), np.empty(len(states))
    assert truth.certified.all()
    for state in range(len(states)):
        at = [values[state].tolist() for values in (states.q, states.v, states.tau)]
        with flint.ctx.workprec(5 * DIGITS):
            mass, force = plain.at(*at)
            found = documented_optimum(mass, force, rows, *([*map(arb, one)] for one in at[:2]))
            known = [arb(high) + arb(low) for high, low in zip(truth.high[state].tolist(), truth.low[state].tolist(), strict=True)]
            shares[state] = length([one - other for one, other in zip(found, known, strict=True)], mass) / truth.radius[state]
    return shares


@pytest.mark.ci
def test_the_optimum_is_that_of_active_sets(tmp_path: Path) -> None:
    for seed in range(4):
        assert shares_of_the_bound(drawn(tmp_path, seed), 12).max() <= 1, seed


@pytest.mark.nightly
@pytest.mark.parametrize("part", range(5))
def test_the_optimum_is_that_of_active_sets_at_ten_thousand_states(part: int, tmp_path: Path) -> None:
    for seed in range(100 + 50 * part, 150 + 50 * part):
        assert shares_of_the_bound(drawn(tmp_path, seed), 40).max() <= 1, seed


# Of each input, by which it is changed; the difference quotient is off by its square.
_CHANGE = 2.0**-80


@pytest.mark.ci
def test_the_data_roundoff_is_that_of_difference_quotients(tmp_path: Path) -> None:
    """Of positions, velocities, forces, the numbers of bodies and those of rows, on the side that each row is on."""
    for seed in (0, 3):
        model, count = drawn(tmp_path, seed), 1
        robot = read_robot(model.path)
        apart, mechanism = mechanism_of(robot), documented(robot)
        states, plain = states_of(robot, apart, count), Terms(apart)
        truth = ReferenceKernel(mechanism).evaluate(states)
        for state in range(count):
            groups = [[*values[state].tolist()] for values in (states.q, states.v, states.tau)] + [[*apart.parameter_values]]
            with flint.ctx.workprec(8 * DIGITS):
                ends = [_with_each_changed(plain, groups, model.rows, 1 + sign * arb(_CHANGE)) for sign in (1, -1)]
                mass = plain.at(*(list(map(arb, group)) for group in groups))[0]
                quotients = [[(a - b) / (2 * arb(_CHANGE)) for a, b in zip(*pair, strict=True)] for pair in zip(*ends, strict=True)]
                expected = sum(length(one, mass) for one in quotients)
            assert truth.sensitivity[state] == pytest.approx(expected, rel=1e-9), (seed, state)


def _with_each_changed(plain: Terms, groups: Sequence[Sequence[float]], rows: Sequence[Row], factor: Any) -> list[Any]:
    """The accelerations with each number times ``factor``, one after the other."""
    given, found = [list(map(arb, group)) for group in groups], []
    for group in given:
        for place, value in enumerate(group):
            group[place] = value * factor
            found.append(documented_optimum(*plain.at(*given), rows, given[0], given[1]))
            group[place] = value
    terms = plain.at(*given)
    return [*found, *(documented_optimum(*terms, own, given[0], given[1]) for own in changed(rows, factor))]


def rows_of(robot: Robot) -> list[Row]:
    """Dry friction and limits of the joints of one velocity, whose equations are those of the robot."""
    apart, rows, places, positions = mechanism_of(robot), list[Row](), 0, list[float]()
    joints = [robot.joint(name) for name in robot.joints]
    starts = list(itertools.accumulate((joint.kind.positions for joint in joints), initial=0))
    for joint in joints:
        positions += [0.0] * joint.kind.positions
        if joint.kind.has_attitude:
            positions[-4] = 1.0
    with flint.ctx.workprec(5 * DIGITS):
        inverse = Terms(apart).at(positions, [0.0] * apart.nv, [0.0] * apart.nv)[0].inv()
        radians = arb.pi() / 180
    for joint, start in zip(joints, starts, strict=False):
        if joint.kind.is_single:
            weight = arb(float(inverse[places, places]))
            if joint.friction_loss:
                rows.append(Row((places,), weight, loss=float(joint.friction_loss), **softness_in(joint.friction_softness)))
            for sign, bound in zip((1, -1), joint.limits or (), strict=False):
                own = softness_in(joint.limit_softness) | {"margin": float(joint.margin), "sign": sign}
                with flint.ctx.workprec(5 * DIGITS):
                    own["bound"] = float(bound) * (radians if joint.in_degrees else arb(1))
                rows.append(Row((places,), weight, (start,), **own))
        places += joint.kind.velocities
    return rows


def softness_in(softness: SolverParameters) -> dict[str, Any]:
    return {"solref": tuple(map(float, softness.solref)), "solimp": tuple(map(float, softness.solimp))}


def shares_of_a_file(path: Path, count: int) -> Array:
    """As ``shares_of_the_bound``, of a robot with the friction and the limits of its joints of one velocity alone."""
    robot = read_robot(path)
    robot = replace(robot, equalities=(), tree=replace(robot.tree, tendons=()))
    apart = mechanism_of(robot)
    return shares_at(ReferenceKernel(documented(robot)), states_of(robot, apart, count), Terms(apart), rows_of(robot))


@pytest.mark.ci
@pytest.mark.parametrize("name", ["arm.urdf", "quadruped.xml"])
def test_the_optimum_of_a_robot_is_that_of_active_sets(name: str) -> None:
    path = Path(__file__).parents[2] / "harness" / "robots" / name
    assert shares_of_a_file(path, 6).max() <= 1 and rows_of(read_robot(path))


@pytest.mark.ci
def test_half_of_the_bound_would_not_hold(tmp_path: Path) -> None:
    """In balls it is what high + low loses; in double-double running errors are some hundred times what is lost."""
    shares = np.concatenate([shares_of_the_bound(drawn(tmp_path, seed, ("friction",)), 12, in_balls=True) for seed in range(2)])
    assert 0.5 < shares.max() <= 1


FAULTS = {
    "friction": ({"a": 'frictionloss="3"'}, 'frictionloss="3"', 'frictionloss="3.00001"'),
    "half of the bound": ({"a": 'frictionloss="3"'}, 'frictionloss="3"', 'frictionloss="1.5"'),
    "impedance of friction": ({"a": 'frictionloss="30" solimpfriction="0.3"'}, '"0.3"', '"0.30001"'),
    "damping of friction": ({"a": 'frictionloss="300" solreffriction="0.3 1"'}, '"0.3 1"', '"0.30001 1"'),
    "range": ({"a": 'range="-40 30"'}, "-40 30", "-40 30.0001"),
    "sign of the margin": ({"a": 'range="-40 30" margin="0.01"'}, '"0.01"', '"-0.01"'),
    "impedance of a limit": ({"a": 'range="-40 30" solimplimit=".3 .9 2"'}, ".3 .9 2", ".3 .9 2.0001"),
    "time constant of a limit": ({"a": 'range="-40 30" solreflimit="0.3 1"'}, '"0.3 1"', '"0.30001 1"'),
    "friction of a limit": ({"a": 'range="-40 30" solimplimit=".3 .9 2"'}, "solimplimit", "solimpfriction"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_seen(name: str, tmp_path: Path) -> None:
    attributes, old, new = FAULTS[name]
    right = written(tmp_path, **attributes)
    robot, text = read_robot(right), right.read_text()
    assert text.count(old) == 1
    right.write_text(text.replace(old, new))
    assert worst(judged(right, robot)[2]) > 10 * AGREEMENT


def test_a_force_at_its_bound_counts_as_inside(tmp_path: Path) -> None:
    """Half an ulp leads across, so that data roundoff is the larger of both sides; the force is the bound."""
    path = tmp_path / "one.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1" frictionloss="1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    mechanism = documented(read_robot(path))
    # Within the range the row gives 0.9 of tau, as R is a ninth of A.
    at = 1 / 0.9
    states = States.at([[0.0]] * 5, [[0.0]] * 5, [[at], [np.nextafter(at, 2)], [np.nextafter(at, 0)], [0.9 * at], [1.1 * at]])
    truth = ReferenceKernel(mechanism).evaluate(states)
    assert truth.certified.all()
    assert truth.high[:3, 0] == pytest.approx(states.tau[:3, 0] - 1.0, abs=1e-15)
    # A row that slides resists no rounding of tau.
    assert min(truth.sensitivity[:3]) > 1.5 * truth.sensitivity[3] and truth.sensitivity[4] > 1.5 * truth.sensitivity[3]


def test_which_forces_are_near_a_bound_is_decided_by_what_roundings_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Bounds of the loops, which are infinite where M is ill-conditioned, say nothing of it."""
    path = written(tmp_path, a='frictionloss="0.3"', b='limited="true" range="-0.2 0.2"')
    robot = read_robot(path)
    mechanism = documented(robot)
    assert isinstance(mechanism, DeclaredMechanism)
    states = states_of(robot, mechanism)
    parameters = mechanism.parameters_at(states)
    found = mechanism.across(states, parameters, UNIT_ROUNDOFF)

    def boundless(*given: Any) -> Any:
        known = bounded_outputs(*given)
        assert known is not None
        return replace(known, bound=np.full_like(known.bound, np.inf))

    monkeypatch.setattr(zones, "bounded_outputs", boundless)
    assert np.array_equal(mechanism.across(states, parameters, UNIT_ROUNDOFF), found, equal_nan=True)


def test_sides_that_are_exchanged_after_the_last_look_are_proved_anew(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What a force was on its former side fits the next one always."""
    robot = read_robot(written(tmp_path, a='frictionloss="2"', b='frictionloss="3"'))
    mechanism = documented(robot)
    states = sample(mechanism, STATES, SEED)
    expected = mechanism.parameters_at(states)
    monkeypatch.setattr(zones, "_BLOCKS", 1)
    monkeypatch.setattr(zones, "_SINGLE", 0)
    np.testing.assert_array_equal(mechanism.parameters_at(states), expected)


def test_a_limit_that_rounding_reaches_is_undecided(tmp_path: Path) -> None:
    """Its damping sets in at once; where it would push nothing, either way is the same."""
    path = tmp_path / "one.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body><joint name="j" axis="0 0 1" range="-1 0.3"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    mechanism = documented(read_robot(path))
    truth = ReferenceKernel(mechanism).evaluate(States.at([[0.3]] * 2, [[1.0], [-1.0]], [[0.0]] * 2))
    assert truth.certified.tolist() == [False, True] and truth.high[1, 0] == 0.0
    assert "on which side" in next(truth.why_undecided())


def test_the_mean_impedance_of_friction_without_width_is_a_departure(tmp_path: Path) -> None:
    """As documented it is the first number; MuJoCo takes the mean, for a width of 0 alone."""
    (departure,) = [one for one in departures_of("mujoco", "") if one.name == "impedance of friction without width"]
    for width, departs in (("0", True), ("0.1", False)):
        (folder := tmp_path / width).mkdir()
        path = written(folder, a=f'frictionloss="3" solimpfriction="0.3 0.6 {width}"')
        robot = read_robot(path)
        _, states, compared = judged(path, robot)
        assert (worst(compared) > 10 * AGREEMENT) == departs
        truth = ReferenceKernel(documented(robot, [departure])).evaluate(states)
        assert worst(compare(truth, answered(path, states), factorises=True)) <= AGREEMENT


def test_what_mixes_signs_is_no_law(tmp_path: Path) -> None:
    (found,) = frictions_of(read_robot(written(tmp_path, a='frictionloss="3" solreffriction="0.3 -1"')).tree)
    assert found.why_not == "has solref 0.3 -1, which mixes signs; expected both positive, or none" and found.line == 4


def test_friction_of_a_planar_joint_is_none_of_one_engine(tmp_path: Path) -> None:
    path, inertial = (
        tmp_path / "sheet.urdf",
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>',
    )
    joint = '<joint name="j" type="planar"><parent link="a"/><child link="b"/><dynamics friction="1"/></joint>'
    path.write_text(f'<robot name="sheet">\n<link name="a"/><link name="b">{inertial}</link>\n{joint}</robot>')
    (found,) = frictions_of(read_robot(path).tree)
    assert found.why_not == "is of a planar joint, which engines make several of" and found.line == 3


def test_what_the_file_switches_off_does_not_act(tmp_path: Path) -> None:
    both = {"a": 'frictionloss="3" range="-40 30"'}
    for flag, left in (("constraint", []), ("limit", ["dry friction"]), ("frictionloss", ["lower limit", "upper limit"])):
        # What stands at a place is kept by the file's name.
        (folder := tmp_path / flag).mkdir()
        robot = read_robot(written(folder, f'<option><flag {flag}="disable"/></option>', **both))
        chosen = [*frictions_of(robot.tree), *limits_of(robot.tree)]
        laws = engine_of("mujoco").laws(element_at(robot.tree.place), robot.format, chosen)
        assert [one.kind for one in chosen if one.name in laws] == left


@pytest.mark.ci
@pytest.mark.parametrize("format", ["mjcf", "urdf"])
def test_an_engine_is_asked_with_friction_and_limits_of_joints_by_name(format: str, tmp_path: Path) -> None:
    """Those of no other joint act, and none where none is named."""
    path = written(tmp_path, **LIMITED["with friction"])
    if format == "urdf":
        path = Path(__file__).parents[2] / "harness" / "robots" / "arm.urdf"
        text = path.read_text().replace('<dynamics damping="8"/>', '<dynamics damping="8" friction="7"/>')
        path = tmp_path / "arm.urdf"
        path.write_text(text)
    robot = read_by(read_robot(path), "mujoco", engine_of("mujoco"), Stance.PLAIN).robot
    names = [joint.name for joint in robot.tree.joints if joint.kind.is_single]
    for rubbing, limited in ((names, names), (names[:1], ()), ((), names[1:2]), ((), ())):
        tree = replace(robot.tree, bodies=tuple(_with(body, rubbing, limited) for body in robot.tree.bodies))
        own = replace(robot, tree=tree)
        mechanism = documented(own)
        states = states_of(robot, mechanism)
        truth = ReferenceKernel(mechanism).evaluate(states)
        held = Held((), (), SolverSettings("Newton", 100, 0.0), rubbing=owners(rubbing), limited=owners(limited))
        answers = ask_engine("mujoco", question_of(Meant(own, states, truth), Stance.PLAIN, held))
        assert worst(compare(truth, answers.of(robot.joints), factorises=True)) <= AGREEMENT


def owners(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"joint {name}" for name in names)


def _with(body: Body, rubbing: Sequence[str], limited: Sequence[str]) -> Body:
    joints = [joint if joint.name in rubbing else replace(joint, friction_loss=Fraction(0)) for joint in body.joints]
    return replace(body, joints=tuple(joint if joint.name in limited else replace(joint, limits=None) for joint in joints))


SUM = '<fixed {}><joint joint="a" coef="1.5"/><joint joint="b" coef="-2"/></fixed>'
ALONG = '<spatial {}><site site="s"/><site site="u"/><site site="t"/></spatial>'
TENDONS = {
    "friction of a sum": (SUM, 'frictionloss="3" solreffriction="0.3 1"'),
    "limits of a sum": (SUM, 'range="-2 1" margin="0.1" solimplimit="0.5 0.9 0.4"'),
    "both of a sum": (SUM, 'name="x" range="-2 1" frictionloss="3"'),
    "friction through sites": (ALONG, 'frictionloss="30000" solimpfriction="0.5 0.9"'),
    "limits through sites": (ALONG, 'range="1.5 2.5" solreflimit="-100 -4"'),
}


@pytest.mark.ci
@pytest.mark.parametrize("name", TENDONS)
def test_tendons_rub_and_are_limited_as_documented_but_for_their_curvature(name: str, tmp_path: Path) -> None:
    """Through sites MuJoCo leaves J' v out, where it moves; at rest it is as documented."""
    tendon, attributes = TENDONS[name]
    path = written(tmp_path, tendons=tendon.format(attributes))
    robot = read_robot(path)
    curved = [one for one in departures_of("mujoco", "") if one.name == "J' v of tendons and ball joints"]
    assert_departs_where_it_moves(path, robot, curved, departs="sites" in name)


def test_rows_move_by_their_jacobian_and_their_curvature(tmp_path: Path) -> None:
    """By differences along the motion; of hinges and slides alone, positions change by v."""
    path = tmp_path / "cord.xml"
    path.write_text(
        """<mujoco><worldbody><site name="w" pos="0.3 -0.2 0.9"/><body><joint name="a" axis="0 1 0" range="-9 9"/>
        <inertial pos=".5 0 0" mass="1" diaginertia=".1 .1 .1"/><site name="s" pos=".1 .2 .3"/>
        <body pos="1 0 0"><joint name="b" type="slide" axis="0 .6 .8"/><joint name="c" axis="1 0 0" frictionloss="2"/>
        <inertial pos=".3 .1 0" mass="2" diaginertia=".1 .12 .1"/><site name="t" pos=".4 .2 -.3"/></body></body></worldbody>
        <tendon><spatial range="1 2" frictionloss="3"><site site="s"/><site site="w"/><site site="t"/></spatial></tendon></mujoco>"""
    )
    mechanism = mechanism_of(read_robot(path))
    rows, step = documented(read_robot(path)).softened, 2.0**-20
    assert rows is not None and len(rows.rows) == 6
    states = sample(mechanism, STATES, SEED)

    def at(by: float) -> dict[str, Array]:
        moved = replace(states, q=states.q + by * states.v)
        return values(rows.program, documented(read_robot(path)).inputs(moved)[: len(rows.program.inputs)])

    before, now, after = (at(by * step) for by in (-1, 0, 1))
    rate = np.einsum("rvn,nv->rn", now["jacobian"].reshape(6, mechanism.nv, -1), states.v)
    np.testing.assert_allclose(now["rate"], rate, rtol=1e-12, atol=1e-12)
    # A row of dry friction holds no position.
    placed = now["residual"].any(axis=1)
    assert placed.tolist() == [" limit" in name for name in rows.rows], rows.rows
    for found, change in ((rate[placed], "residual"), (now["bias"], "rate")):
        moved = (after[change] - before[change])[placed if change == "residual" else slice(None)]
        np.testing.assert_allclose(found, moved / (2 * step), rtol=1e-6, atol=1e-7 * np.abs(now["bias"]).max())
    assert (np.abs(now["bias"]).max(axis=1) > 0.1).sum() == 3


@pytest.mark.ci
@pytest.mark.parametrize("attributes", ['range="0 60"', 'range="0 170" margin="0.4" solimplimit="0.2 0.9 1.5 0.3 2.5"'])
def test_ball_joints_are_limited_as_documented_but_for_their_curvature(attributes: str, tmp_path: Path) -> None:
    path = written(tmp_path, c=attributes)
    curved = [one for one in departures_of("mujoco", "") if one.name == "J' v of tendons and ball joints"]
    assert_departs_where_it_moves(path, read_robot(path), curved, departs=True)


def assert_departs_where_it_moves(path: Path, robot: Robot, departures: Sequence[Departure], departs: bool) -> None:
    states = sample(documented(robot), STATES, SEED)
    for moving in (True, False):
        at = states if moving else replace(states, v=np.zeros_like(states.v))
        answers = answered(path, at)
        compared = compare(ReferenceKernel(documented(robot)).evaluate(at), answers, factorises=True)
        assert (worst(compared) > 10 * AGREEMENT) == (departs and moving), worst(compared)
        truth = ReferenceKernel(documented(robot, departures)).evaluate(at)
        assert worst(compare(truth, answers, factorises=True)) <= AGREEMENT
        without = compare(ReferenceKernel(mechanism_of(robot)).evaluate(at), answers, factorises=True)
        assert worst(without) > 10 * AGREEMENT


def test_a_tendon_around_something_says_why_it_is_not_read(tmp_path: Path) -> None:
    path = written(
        tmp_path, tendons='<spatial frictionloss="2" range="0 1"><site site="s"/><pulley divisor="2"/><site site="t"/></spatial>'
    )
    tree = read_robot(path).tree
    found = [*frictions_of(tree), *limits_of(tree, of_tendons=True)]
    assert [one.name for one in found] == [
        "dry friction of tendon (tendon 1)",
        "lower limit of tendon (tendon 1)",
        "upper limit of tendon (tendon 1)",
    ]
    assert {one.why_not for one in found} == {"is about a tendon that runs along a path, or about none of this file"}
