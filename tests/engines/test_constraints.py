"""Engines on models with constraints, against a 50-digit solve of the rigid equations and of the optimum that MuJoCo documents."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from planar_loops import FOUR_BAR, LOOPS, SLIDER_CRANK, Answer, Loop, Softened, four_bar_gap

from harness.arrays import Array
from harness.crosscheck import constraint_laws
from harness.crosscheck.constraint_laws import departures_from
from harness.engines import ConstraintLaw, InverseWeight, Unsupported, load_engine
from harness.engines.adapters.pinocchio.constraints import LoopConstraints
from harness.engines.adapters.pinocchio.model import PinocchioModel
from harness.engines.adapters.pinocchio.solver import Solver
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.library import Library
from harness.trees.inverse_weights import inverse_weights

LIBRARY = replace(Library.built_in(), calls_engines_here=True)
SUBJECTS = [(engine, model_format) for engine in ("mujoco", "pinocchio") for model_format in ("mjcf", "urdf")]
COUNT = 6
# Data roundoffs: the bar of the verdict, and what a wrong number exceeds.
BAR, WRONG = 64.0, 1e4
GRAVITY = 9.81


def model_of(name: str, model_format: str) -> ModelFile:
    return read_model(LIBRARY.model_path(name, model_format), model_format)


def changed(file: ModelFile, *pairs: tuple[str, str]) -> ModelFile:
    text = file.text
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return parse_model(file.path, text, file.format)


@cache
def states_of(name: str) -> Any:
    return LOOPS[name].states(COUNT, seed=1)


def arrays(states: Sequence[tuple[list[float], ...]]) -> tuple[Array, Array, Array]:
    q, v, tau = (np.array([state[part] for state in states]) for part in range(3))
    return q, v, tau


def answers(engine: str, file: ModelFile, joints: Sequence[str], states: Sequence[tuple[list[float], ...]]) -> Array:
    return load_engine(LIBRARY, engine).load(file, joints, GRAVITY).forward_dynamics(*arrays(states))


def require_balance_and_reproducer(model: Any, file: ModelFile, states: Sequence[Any], capsys: pytest.CaptureFixture[str]) -> None:
    """Terms balance the answers with the forces of constraints, and the reproducer prints the first answer."""
    q, v, tau = arrays(states)
    found, terms = model.forward_dynamics(q, v, tau), model.terms(q, v, tau)
    balance = np.einsum("nij,nj->ni", terms.mass, found) + terms.velocity + terms.gravity - terms.passive - terms.applied
    assert np.abs(balance).max() < 1e-10 * np.abs(terms.passive).max()
    exec(model.reproducer("text", q[0], v[0], tau[0], found[0]), {"text": file.text})
    printed, expected = (np.array(eval(line)) for line in capsys.readouterr().out.splitlines())
    np.testing.assert_allclose(printed, expected, rtol=1e-12)


def laws_of(file: ModelFile, engine: str = "mujoco") -> Mapping[str, ConstraintLaw]:
    """The laws that the engine's program is known to have."""
    return constraint_laws.laws_of(LIBRARY, engine, file, [one.name for one in departures_from(LIBRARY, engine, file)])


def weights_of(file: ModelFile, laws: Mapping[str, ConstraintLaw]) -> Mapping[InverseWeight, float]:
    return inverse_weights(file, [one for law in laws.values() for row in law.weights or () for one in row])


def truth(engine: str, file: ModelFile, loop: Loop) -> Answer:
    """The problem that an engine is known to solve."""
    laws = laws_of(file, engine)
    return loop.softened(Softened(laws, weights_of(file, laws))) if laws else loop.rigid


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize(("engine", "model_format"), SUBJECTS)
def test_a_loop_moves_as_the_engine_documents(name: str, engine: str, model_format: str) -> None:
    loop, file, states = LOOPS[name], model_of(name, model_format), states_of(name)
    assert loop.worst(truth(engine, file, loop), states, answers(engine, file, loop.joints, states)) < BAR


SOFT = {
    "the exact diagonal": ("<flag ", '<flag diagexact="enable" '),
    "impedance without width": ('end"/>\n  </eq', 'end" solimp="0.9 0.99 0 0.5 2"/>\n  </eq'),
    "impedance below its least": ('end"/>\n  </eq', 'end" solimp="-1 0.95"/>\n  </eq'),
    "damping ratio": ('end"/>\n  </eq', 'end" solref="0.05 0.7"/>\n  </eq'),
    "stiffness and damping": ('end"/>\n  </eq', 'end" solref="-10000 -300"/>\n  </eq'),
    "a time constant below two steps": ('end"/>\n  </eq', 'end" solref="0.001 1"/>\n  </eq'),
    "a longer step": ("<option ", '<option timestep="0.02" '),
    "a longer step that nobody minds": ("<flag ", '<flag refsafe="disable" '),
    "a default class": ("<worldbody>", '<default><equality solref="0.04" solimp="0.8 0.9"/></default>\n  <worldbody>'),
    "as stiff as it goes": ('end"/>\n  </eq', 'end" solimp="0.9999 0.9999"/>\n  </eq'),
}
EXACT_SOLVE = ("<option ", '<option iterations="3" tolerance="0" ')


# At the desk: both forms of solref, an impedance beyond its bounds, a step, the flag that minds it, and a default class.
SOFT_AT_THE_DESK = (
    "impedance below its least", "stiffness and damping", "a longer step", "a longer step that nobody minds", "a default class",
)  # fmt: skip


@pytest.mark.parametrize(
    "change", [pytest.param(change, id=name, marks=() if name in SOFT_AT_THE_DESK else pytest.mark.ci) for name, change in SOFT.items()]
)
def test_mujoco_solves_the_optimum_that_the_file_declares(change: tuple[str, str]) -> None:
    plain, states = model_of("four_bar", "mjcf"), near_the_constraint("four_bar")
    file = changed(plain, change, EXACT_SOLVE)
    found = answers("mujoco", file, FOUR_BAR.joints, states)
    assert FOUR_BAR.worst(truth("mujoco", file, FOUR_BAR), states, found) < BAR
    # What the change declares is felt, but for the one that takes away a bound that nothing reached.
    assert (FOUR_BAR.worst(truth("mujoco", plain, FOUR_BAR), states, found) > WRONG) == ("refsafe" not in change[1])


def test_a_stiff_loop_needs_more_than_mujocos_default_tolerance() -> None:
    """At impedance 0.9999 the solver stops after its first iteration, 764 data roundoffs from the optimum."""
    states = states_of("four_bar")
    file = changed(model_of("four_bar", "mjcf"), SOFT["as stiff as it goes"])
    assert FOUR_BAR.worst(truth("mujoco", file, FOUR_BAR), states, answers("mujoco", file, FOUR_BAR.joints, states)) > BAR


def near_the_constraint(name: str) -> list[tuple[list[float], list[float], list[float]]]:
    """Within the width of the impedance, and drifting: on the constraint itself nothing feels stiffness, damping and width."""
    generator = np.random.default_rng(3)
    return [
        (
            (np.array(q) + generator.uniform(-2e-4, 2e-4, len(q))).tolist(),
            (np.array(v) + generator.uniform(-0.1, 0.1, len(q))).tolist(),
            tau,
        )
        for q, v, tau in states_of(name)
    ]


def on_a_tree(rows: Callable[[Sequence[Any], Sequence[Any]], tuple[Any, ...]]) -> Loop:
    """The four-bar with other rows than its closure."""
    return replace(FOUR_BAR, rows=lambda q, p: {"closure": rows(q, p)})


def _length(q: Sequence[Any], p: Sequence[Any]) -> Any:
    """From the hook to the coupler's end."""
    a, b, *_ = p
    x = a * sp.cos(q[0]) + b * sp.cos(q[0] + q[1]) - HOOK[0]
    return sp.sqrt(x**2 + (a * sp.sin(q[0]) + b * sp.sin(q[0] + q[1]) - HOOK[1]) ** 2)


# x and z of a point of the ground.
HOOK = sp.Rational(1, 2), sp.Rational(3, 2)
GROUND = '<body name="ground">'
HOOKED = f'{GROUND}\n      <site name="hook" pos="{float(HOOK[0])} 0 {float(HOOK[1])}"/>'
TENDON = '</worldbody>\n  <tendon><spatial name="cord"><site site="hook"/><site site="coupler_end"/></spatial></tendon>'
SUM = '</worldbody>\n  <tendon><fixed name="cord"><joint joint="crank" coef="2"/><joint joint="follower" coef="-0.5"/></fixed></tendon>'
CLOSURE = '<connect name="closure" site1="coupler_end" site2="follower_end"/>'
OTHERS: Mapping[str, tuple[Loop, list[tuple[str, str]]]] = {
    "weld": (
        on_a_tree(
            lambda q, p: (*four_bar_gap(q, p)[:1], 0, four_bar_gap(q, p)[1], 0, -sp.Rational(3, 4) * sp.sin((q[0] + q[1] - q[2]) / 2), 0)
        ),
        [(CLOSURE, '<weld name="closure" site1="coupler_end" site2="follower_end" torquescale="0.75"/>')],
    ),
    "joint by a polynomial": (
        on_a_tree(lambda q, p: (q[1] - sp.Rational(3, 8) - sp.Rational(3, 2) * q[2] - q[2] ** 2 / 4 + q[2] ** 4 / 8,)),
        [(CLOSURE, '<joint name="closure" joint1="coupler" joint2="follower" polycoef="0.375 1.5 0.25 0 -0.125"/>')],
    ),
    "joint alone": (
        on_a_tree(lambda q, p: (q[1] - sp.Rational(3, 8),)),
        [(CLOSURE, '<joint name="closure" joint1="coupler" polycoef="0.375"/>')],
    ),
    "joint from references": (
        replace(
            on_a_tree(lambda q, p: (q[1] - sp.Rational(1, 4) - 2 * (q[2] - sp.Rational(1, 2)),)),
            energies=lambda q, v, p: FOUR_BAR.energies((q[0], q[1] - sp.Rational(1, 4), q[2] - sp.Rational(1, 2)), v, p),
        ),
        [
            (CLOSURE, '<joint name="closure" joint1="coupler" joint2="follower" polycoef="0 2"/>'),
            ('name="coupler" type="hinge" axis="0 -1 0"', 'name="coupler" type="hinge" axis="0 -1 0" ref="0.25"'),
            ('name="follower" type="hinge" axis="0 -1 0"', 'name="follower" type="hinge" axis="0 -1 0" ref="0.5"'),
        ],
    ),
    "tendon between two points": (
        on_a_tree(lambda q, p: (_length(q, p) - _length((0, 0, 0), p) - sp.Rational(1, 8),)),
        [(CLOSURE, '<tendon name="closure" tendon1="cord" polycoef="0.125"/>'), ("</worldbody>", TENDON), (GROUND, HOOKED)],
    ),
    "tendon on joints": (
        on_a_tree(lambda q, p: (2 * q[0] - q[2] / 2 - sp.Rational(1, 8),)),
        [(CLOSURE, '<tendon name="closure" tendon1="cord" polycoef="0.125"/>'), ("</worldbody>", SUM)],
    ),
}


def off_the_constraint(count: int) -> list[tuple[list[float], list[float], list[float]]]:
    """States anywhere: an optimum is one where the constraint is violated too."""
    generator = np.random.default_rng(2)
    return [
        (generator.uniform(-3, 3, 3).tolist(), generator.uniform(-5, 5, 3).tolist(), generator.uniform(-20, 20, 3).tolist())
        for _ in range(count)
    ]


# Those whose J changes along the motion.
CURVED = ("weld", "joint by a polynomial", "tendon between two points")


@pytest.mark.ci
@pytest.mark.parametrize("kind", OTHERS)
def test_every_kind_of_constraint_has_mujocos_law(kind: str) -> None:
    """The program leaves J' v out of couplings, which the documentation has of all equalities."""
    loop, changes = OTHERS[kind]
    file = changed(model_of("four_bar", "mjcf"), *changes, EXACT_SOLVE)
    states = off_the_constraint(COUNT)
    found = answers("mujoco", file, loop.joints, states)
    assert loop.worst(truth("mujoco", file, loop), states, found) < BAR
    documented = constraint_laws.laws_of(LIBRARY, "mujoco", file)
    departs = bool(departures_from(LIBRARY, "mujoco", file))
    assert departs == (kind in CURVED and kind != "weld")
    assert (loop.worst(loop.softened(Softened(documented, weights_of(file, documented))), states, found) > WRONG) == departs
    laws = {name: replace(law, has_curvature=not law.has_curvature) for name, law in laws_of(file).items()}
    assert (loop.worst(loop.softened(Softened(laws, weights_of(file, laws))), states, found) > WRONG) == (kind in CURVED)


@pytest.mark.ci
def test_the_documented_inverse_weight_of_a_slider_is_another_optimum() -> None:
    loop, states = SLIDER_CRANK, states_of("slider_crank")
    file = model_of("slider_crank", "mjcf")
    found, documented = answers("mujoco", file, loop.joints, states), constraint_laws.laws_of(LIBRARY, "mujoco", file)
    assert loop.worst(truth("mujoco", file, loop), states, found) < BAR
    assert loop.worst(loop.softened(Softened(documented, weights_of(file, documented))), states, found) > WRONG


# The coupler's end at a point of the world.
STANDING = {
    "mjcf": [
        ("<worldbody>", '<worldbody>\n    <site name="here" pos="1.5 0 1.2"/>'),
        (CLOSURE, '<connect name="closure" site1="coupler_end" site2="here"/>'),
    ],
    "urdf": [('B name="follower"', 'B name="world"'), ('BQ value="1.3 0 0"', 'BQ value="1.5 0 1.2"')],
}


def _coupler_end(q: Sequence[Any], p: Sequence[Any]) -> tuple[Any, Any]:
    """From a point of the world to the coupler's end (x, z)."""
    a, b, *_ = p
    x, z = (a * of(q[0]) + b * of(q[0] + q[1]) for of in (sp.cos, sp.sin))
    return x - sp.Rational(3, 2), z - sp.Rational(6, 5)


@pytest.mark.parametrize(("engine", "model_format"), SUBJECTS)
def test_the_world_may_be_an_end(engine: str, model_format: str) -> None:
    loop = replace(FOUR_BAR, rows=lambda q, p: {"closure": (_coupler_end(q, p)[0], 0, _coupler_end(q, p)[1])})
    file = changed(model_of("four_bar", model_format), *STANDING[model_format])
    first, second, _ = FOUR_BAR.assembled
    generator = np.random.default_rng(4)
    states = [
        ([first, second, generator.uniform(-3, 3)], [0.0, 0.0, generator.uniform(-5, 5)], generator.uniform(-20, 20, 3).tolist())
        for _ in range(COUNT)
    ]
    assert loop.worst(truth(engine, file, loop), states, answers(engine, file, loop.joints, states)) < BAR


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
def test_a_weld_holds_two_frames_together(engine: str) -> None:
    """The follower stands along x, its frame in that of the ground; Pinocchio's rows are others of the same meaning."""
    turn = 'quat="0.8 0 0.6 0"'
    file = changed(
        model_of("four_bar", "mjcf"),
        (CLOSURE, '<weld name="closure" site1="mine" site2="grounds" torquescale="0.5"/>'),
        (GROUND, f'{GROUND}\n      <site name="grounds" pos="2.4 0 0.1" {turn}/>'),
        ('<site name="follower_end"', f'<site name="mine" pos="0.4 0 0.1" {turn}/>\n        <site name="follower_end"'),
        EXACT_SOLVE,
    )
    rigid = replace(FOUR_BAR, rows=lambda q, p: {"closure": (q[2],)}, independent=(0,))
    loop = replace(FOUR_BAR, rows=lambda q, p: {"closure": _weld_of_follower(q)}) if engine == "mujoco" else rigid
    generator = np.random.default_rng(5)
    states = [
        ([*generator.uniform(-3, 3, 2).tolist(), 0.0], [*generator.uniform(-5, 5, 2).tolist(), 0.0], generator.uniform(-20, 20, 3).tolist())
        for _ in range(COUNT)
    ]
    assert loop.worst(truth(engine, file, loop), states, answers(engine, file, loop.joints, states)) < BAR


def _weld_of_follower(q: Sequence[Any]) -> tuple[Any, ...]:
    x, z = sp.Rational(2, 5), sp.Rational(1, 10)
    sine, cosine = sp.sin(q[2]), sp.cos(q[2])
    return x * cosine - z * sine - x, 0, x * sine + z * cosine - z, 0, -sp.sin(q[2] / 2) / 2, 0


@pytest.mark.parametrize("kind", [kind for kind in OTHERS if kind != "weld"])
def test_pinocchio_refuses_what_its_solver_has_no_constraint_of(kind: str) -> None:
    _, changes = OTHERS[kind]
    with pytest.raises(Unsupported, match=r"line \d+: constraint 'closure' couples (joint|tendon)s"):
        load_engine(LIBRARY, "pinocchio").load(changed(model_of("four_bar", "mjcf"), *changes), FOUR_BAR.joints, GRAVITY)


MIMIC = '<child link="follower"/>\n    <mimic joint="coupler" multiplier="1.5" offset="0.25"/>'
ROTOR = (
    '<transmission name="gear"><type>transmission_interface/SimpleTransmission</type><joint name="coupler"/>'
    '<actuator name="motor"><drake:rotor_inertia value="0.125"/></actuator></transmission></robot>'
)


def mimicking(*changes: tuple[str, str]) -> ModelFile:
    text = model_of("four_bar", "urdf").text
    start = text.index("  <drake:ball")
    return changed(parse_model(Path("model.urdf"), text[:start] + "</robot>", "urdf"), ('<child link="follower"/>', MIMIC), *changes)


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("rotor", [0.0, 0.125])
def test_a_joint_that_mimics_is_coupled_where_the_system_asks_for_it(engine: str, rotor: float, capsys: pytest.CaptureFixture[str]) -> None:
    """Soft in MuJoCo, at any state; rigid in Pinocchio, where followers stand where leaders say."""
    changes = [("</robot>", ROTOR), ('effort="0"', 'effort="1"')] if rotor else []
    file = mimicking(*changes)
    loop = replace(
        FOUR_BAR,
        rows=lambda q, p: {"follower": (q[2] - sp.Rational(1, 4) - sp.Rational(3, 2) * q[1],)},
        energies=lambda q, v, p: tuple(of + add for of, add in zip(FOUR_BAR.energies(q, v, p), (rotor * v[1] ** 2 / 2, 0), strict=True)),
        independent=(0,),
    )
    states = off_the_constraint(COUNT)
    if engine == "pinocchio":
        states = [([q[0], q[1], 0.25 + 1.5 * q[1]], [v[0], v[1], 1.5 * v[1]], tau) for q, v, tau in states]
    found = answers(engine, file, loop.joints, states)
    assert loop.worst(truth(engine, file, loop), states, found) < BAR
    model: Any = load_engine(LIBRARY, engine).load(file, loop.joints, GRAVITY)
    require_balance_and_reproducer(model, file, states, capsys)
    q = arrays(states)[0]
    np.testing.assert_allclose(model.gaps(q)["follower"][:, 0], q[:, 2] - 0.25 - 1.5 * q[:, 1], atol=1e-13)


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
def test_a_joint_that_mimics_is_refused_where_nobody_asks_for_it(engine: str) -> None:
    with pytest.raises(Unsupported, match=r"line \d+: .*'?follower\W+ mimics"):
        load_engine(LIBRARY, engine).load(mimicking(), ("crank", "coupler"), GRAVITY)


def test_pinocchios_reader_wants_a_leader_before_its_follower_by_name() -> None:
    """In another branch; it goes through the joints of a link by name."""
    text = mimicking(('mimic joint="coupler"', 'mimic joint="crank"')).text
    sound, other = (parse_model(Path("model.urdf"), text.replace('"follower"', f'"{name}"'), "urdf") for name in ("follower", "arm"))
    load_engine(LIBRARY, "pinocchio").load(sound, FOUR_BAR.joints, GRAVITY)
    with pytest.raises(Unsupported, match="parent joint of the mimic joint is not in the kinematic tree"):
        load_engine(LIBRARY, "pinocchio").load(other, ("crank", "coupler", "arm"), GRAVITY)


def test_pinocchio_refuses_a_mimic_beside_a_loop() -> None:
    file = changed(model_of("four_bar", "urdf"), ('<child link="follower"/>', MIMIC))
    with pytest.raises(Unsupported, match="in a model with a loop, and constraintDynamics refuses that"):
        load_engine(LIBRARY, "pinocchio").load(file, FOUR_BAR.joints, GRAVITY)


PLANTED = {
    ("mjcf", "site"): ('pos="1.5 0 0"', 'pos="1.5000000015 0 0"'),
    ("mjcf", "other site"): ('site2="follower_end"', 'site2="foot"'),
    ("mjcf", "stiffness"): ('end"/>\n  </eq', 'end" solref="0.02000002 1"/>\n  </eq'),
    ("mjcf", "impedance"): ('end"/>\n  </eq', 'end" solimp="0.9000009"/>\n  </eq'),
    ("urdf", "point"): ('value="1.3 0 0"', 'value="1.3000000013 0 0"'),
    ("urdf", "exchanged points"): ('p_AP value="1.5 0 0"', 'p_AP value="1.3 0 0"'),
}


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
@pytest.mark.parametrize(("where", "change"), PLANTED.items(), ids=["-".join(where) for where in PLANTED])
def test_a_planted_fault_is_felt(engine: str, where: tuple[str, str], change: tuple[str, str]) -> None:
    model_format, what = where
    sound = model_of("four_bar", model_format)
    if what == "other site":
        sound = changed(sound, ('<site name="follower_end"', '<site name="foot" pos="1.2 0 0"/>\n        <site name="follower_end"'))
    is_soft = what in ("stiffness", "impedance")
    # On the constraint itself no state feels its stiffness.
    states = near_the_constraint("four_bar") if is_soft else states_of("four_bar")
    worst = FOUR_BAR.worst(truth(engine, sound, FOUR_BAR), states, answers(engine, changed(sound, change), FOUR_BAR.joints, states))
    # A rigid solver reads nothing of how soft a constraint is.
    assert (worst > WRONG) == (engine == "mujoco" or not is_soft)


@pytest.mark.parametrize(("engine", "model_format"), SUBJECTS)
def test_an_answer_is_a_function_of_its_state(engine: str, model_format: str) -> None:
    """MuJoCo's solver would start from the answer before."""
    q, v, tau = arrays(states_of("four_bar"))
    model = load_engine(LIBRARY, engine).load(model_of("four_bar", model_format), FOUR_BAR.joints, GRAVITY)
    first = model.forward_dynamics(q, v, tau)
    np.testing.assert_array_equal(first, model.forward_dynamics(q[::-1], v[::-1], tau[::-1])[::-1])
    np.testing.assert_array_equal(first, model.forward_dynamics(q, v, tau))


@pytest.mark.parametrize(("engine", "model_format"), SUBJECTS)
def test_terms_and_reproducer_hold_the_forces_of_constraints(engine: str, model_format: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = model_of("four_bar", model_format)
    model = load_engine(LIBRARY, engine).load(file, FOUR_BAR.joints, GRAVITY)
    require_balance_and_reproducer(model, file, states_of("four_bar"), capsys)


def solved(**told: Any) -> tuple[LoopConstraints, tuple[Array, Array, Array], Array]:
    """The four-bar's loop by a solver that is told so, its states, and the accelerations there."""
    model = load_engine(LIBRARY, "pinocchio").load(model_of("four_bar", "urdf"), FOUR_BAR.joints, GRAVITY)
    assert isinstance(model, PinocchioModel) and isinstance(model.constraints, LoopConstraints)
    constraints, columns = model.constraints.solved_by(Solver(**told)), model.columns(*arrays(states_of("four_bar")))
    return constraints, columns, constraints.accelerations(columns)


def error_of(answer: Array) -> float:
    return FOUR_BAR.worst(FOUR_BAR.rigid, states_of("four_bar"), answer)


def test_pinocchios_default_settings_give_nan_without_a_word() -> None:
    """Of a redundant row, which every planar loop closed by a point has; an answer that is not finite becomes an error of the record."""
    for told in ({"mu": None}, {"mu": 0.0, "iterations": 1}):
        assert np.isnan(solved(**told)[2]).all()


@pytest.mark.ci
def test_the_residual_of_pinocchios_iterations_tells_right_from_wrong_by_nothing() -> None:
    (right, columns, good), (wrong, _, bad) = (solved(mu=1e-6, iterations=count) for count in (50, 1))
    assert error_of(good) < BAR < 1e5 * BAR < error_of(bad)
    np.testing.assert_allclose(right.residuals(columns), wrong.residuals(columns), rtol=1e-4)
    lost, columns, answer = solved(algorithm="lcaba", mu=1e-10)
    assert error_of(answer) > 1e5 * BAR and lost.residuals(columns).max() < 1e-12


@pytest.mark.ci
@pytest.mark.parametrize("mu", [1e-2, 1e-6, 1e-10, 1e-14])
def test_the_limit_of_pinocchios_iterations_does_not_depend_on_mu(mu: float) -> None:
    many, one = (error_of(solved(mu=mu, iterations=count)[2]) for count in (100, 1))
    assert many < BAR and (mu < 1e-13 or one > BAR)


@pytest.mark.parametrize("mu", [1e-4, 1e-6, 1e-8])
def test_lcaba_loses_digits_in_proportion_to_one_over_mu(mu: float) -> None:
    """Iterations do not mend it: what rounding leaves of M + J' J / mu stays."""
    states = states_of("four_bar")
    rigid = np.array([[float(one) for one in FOUR_BAR.rigid([*q, *v, *tau, *FOUR_BAR.values])] for q, v, tau in states])
    error = np.abs(solved(algorithm="lcaba", mu=mu)[2] - rigid).max() / np.abs(rigid).max()
    assert 0.01 * 2.0**-53 / mu < error < 1e3 * 2.0**-53 / mu


def test_a_loop_closed_twice_is_closed_once() -> None:
    """Every row is redundant."""
    file = model_of("four_bar", "urdf")
    start = file.text.index("  <drake:ball_constraint name")
    closure = file.text[start : file.text.index("</robot>")]
    twice = parse_model(file.path, file.text.replace("</robot>", closure.replace('"closure"', '"again"') + "</robot>"), "urdf")
    assert error_of(answers("pinocchio", twice, FOUR_BAR.joints, states_of("four_bar"))) < BAR
