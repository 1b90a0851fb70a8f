"""Terms of the equations of motion: certified ones against mpmath, engines' against those, and faults found in the right one."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN, is_misread

from harness import engines
from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, reference_kernel_of
from harness.engines import EQUATIONS, Model, Subject, Terms, Unsupported, driving_of, load_engine, subjects
from harness.engines.interface import acting_as
from harness.explain.terms import AT_REST, LOADED, MOVING, TermComparison, compare_terms, coordinate_names
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism, load_system
from harness.lagrange.expressions import assemble
from harness.lagrange.system import System
from harness.library import MODEL_SUFFIXES, names_in
from harness.programs.evaluation import jacobians
from harness.programs.loops.encoding import encode
from harness.programs.loops.interpreter import derivatives
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import upper_triangle
from harness.programs.states import States
from harness.truth import terms as term_reference
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.truth.terms import APPLIED, GRAVITY, MASS, PASSIVE, TERMS, VELOCITY, TermReference, certify_terms, dual_norm, term_errors
from harness.verdict import AGREEMENT, Verdict

SUBJECTS = subjects(BUILT_IN)
# A long chain takes minutes where a short one says the same.
LONG = names_in(BUILT_IN.systems / "chain.py")[2:]
NAMES = [name for name in BUILT_IN.system_names() if name not in LONG]
MODELLED = [name for name in NAMES if all(BUILT_IN.has_model(name, form) for form in MODEL_SUFFIXES)]
PLAIN = ("cart_pendulum", "furuta_pendulum", "collar", "cylindrical_arm", "acrobot")
DIGITS = 80
POSITIONS = 5
# Of the sum of an engine's terms, in the units of test_engine_properties.
BAR = 64.0
# The largest backward error of a term of a sound engine is 41: MuJoCo, reading a URDF, turns a body to its principal axes
# by a quaternion that is off unit length by 2e-15. No other is beyond 10.
SOUND = 45.0


def seed_of(name: str) -> int:
    return zlib.crc32(name.encode())


def kernel_of(mechanism: Mechanism, subject: Subject) -> ReferenceKernel:
    """The kernel of the subject's own truth, which for soft constraints follows from its file."""
    is_read = (mechanism.constraints or mechanism.bounded or mechanism.driving) is not None and subject.format != EQUATIONS
    model = read_model(BUILT_IN.model_path(mechanism.name, subject.format), subject.format) if is_read else None
    return reference_kernel_of(Assignment(BUILT_IN, subject, mechanism, model))


def load(subject: Subject, mechanism: Mechanism, change: Callable[[str], str] = lambda text: text) -> Model:
    """The subject's model of ``mechanism``, with its text changed."""
    engine = load_engine(BUILT_IN, subject.engine)
    if subject.format == EQUATIONS:
        return engine.load(Assignment(BUILT_IN, subject, mechanism, None).in_equations, mechanism.joints, mechanism.gravity)
    file = acting_as(read_model(BUILT_IN.model_path(mechanism.name, subject.format), subject.format), mechanism)
    return engine.load(file.with_text(change(file.text)), mechanism.joints, mechanism.gravity)


def judged(
    subject: Subject, mechanism: Mechanism, change: Callable[[str], str] = lambda text: text, seed: int = 0, count: int = POSITIONS
) -> TermComparison:
    states = generic_sample(mechanism, count, seed)
    return compare_terms(kernel_of(mechanism, subject), states, load(subject, mechanism, change), str(subject))


# The derivatives.


@pytest.mark.parametrize("name", ["arm_3r", "heavy_top", "collar"])
def test_derivatives_are_those_of_the_compiled_loop(name: str) -> None:
    """Of tau + passive - velocity - gravity - M a, put together from those of the outputs one by one."""
    mechanism = load_mechanism(BUILT_IN, name)
    charts = Charts(mechanism.charts(linear_velocity_in_body=False))
    for number, program in enumerate(charts.programs):
        encoded, states = encode(program), generic_sample(mechanism, 20, 1)
        assert encoded is not None
        # Beside a chart's singularity its derivatives lose digits by cancellation.
        inputs = mechanism.inputs(states[charts.regularity(states.q)[number] > 0.5])
        found = jacobians(program, inputs)
        accelerations = np.random.default_rng(2).standard_normal((mechanism.nv, inputs.shape[1]))
        residual = found["passive"] - found["velocity"] - found["gravity"]
        for entry, (i, j) in zip(found["mass"], upper_triangle(mechanism.nv), strict=True):
            residual[i] -= entry * accelerations[j]
            if i != j:
                residual[j] -= entry * accelerations[i]
        for i in range(mechanism.nv):
            residual[i, mechanism.nq + mechanism.nv + i] += 1
        expected = derivatives(encoded, inputs.T, accelerations.T)[0].transpose(1, 2, 0)
        assert np.abs(residual - expected).max() <= 1e-13 * np.abs(expected).max()


def test_derivatives_of_every_function_are_those_of_mpmath() -> None:
    a, b = sp.symbols("a b", positive=True)
    functions = [sp.sqrt, sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.exp, sp.log]
    expressions = [f(a * b) for f in functions]
    expressions += [sp.atan2(a, b), a**b, a / b, a - b, a + b, -a, (a + b) ** 3, b**-2, sp.sqrt(a * b) ** 3, sp.pi * a, sp.Integer(7)]
    values = (0.4, 0.7)
    found = jacobians(assemble([a, b], {"all": expressions}), np.array(values)[:, None])["all"][:, :, 0]
    for expression, row in zip(expressions, found, strict=True):
        for symbol, slope in zip((a, b), row, strict=True):
            assert slope == pytest.approx(float(expression.diff(symbol).evalf(30, subs=dict(zip((a, b), values, strict=True)))), rel=1e-14)


# The certified terms.


@pytest.mark.parametrize("name", PLAIN)
def test_certified_terms_and_their_data_roundoff_are_those_of_mpmath(name: str, exact_of: Callable[[System], Any]) -> None:
    """Values to 100 bits; sensitivities from central differences by every input, put together as the docstring says."""
    exact = exact_of(load_system(BUILT_IN.system_path(name))[0])
    mechanism, nv = load_mechanism(BUILT_IN, name), exact.nv
    states = generic_sample(mechanism, 2, seed_of(name))
    reference = certify_terms(ReferenceKernel(mechanism), states)
    assert all(certified.all() for certified in vars(reference.certified).values())
    equations = exact.equations
    terms = [equations.velocity_terms, equations.gravity_terms, equations.passive_forces]
    evaluate = exact.function([entry for term in (equations.mass_matrix, *terms) for entry in term])
    for index in range(len(states)):
        arguments = [mpmath.mpf(float(z)) for z in (*states.q[index], *states.v[index], *states.tau[index], 0.0)] + exact.parameters
        values = evaluate(arguments)
        with mpmath.workdps(DIGITS):
            step = mpmath.mpf(10) ** -25
            moved = [mpmath.matrix(nv * (nv + 3), 1) for _ in arguments]
            for k, z in enumerate(arguments):
                ahead, behind = (evaluate([*arguments[:k], z + s, *arguments[k + 1 :]]) for s in (step, -step))
                moved[k] = mpmath.matrix([(x - y) / (2 * step) for x, y in zip(ahead, behind, strict=True)]) * z
            mass = mpmath.matrix([values[i * nv : (i + 1) * nv] for i in range(nv)])
            inverse, rotating = mass**-1, exact.system.rotating
            reach = [mpmath.sqrt(inverse[i, i]) for i in range(nv)]

            def size(force: Any, inverse: Any = inverse) -> Any:
                return mpmath.sqrt((force.T * inverse * force)[0])

            v = mpmath.matrix(arguments[nv : 2 * nv])
            inertias = [mass[i, i] for i in range(nv) if rotating[i]]
            inertias.append(mpmath.fsum(mass[i, i] * arguments[i] ** 2 for i in range(nv) if not rotating[i]))
            lengths = [mpmath.sqrt(max(inertias) if rotating[i] else mass[i, i]) for i in range(nv)]
            of_mass = [
                [mpmath.fsum(abs(column[i * nv + j]) for column in moved) + lengths[i] * lengths[j] for j in range(nv)] for i in range(nv)
            ]
            shares = {
                VELOCITY: mpmath.fsum((lengths[i] * v[i]) ** 2 for i in range(nv))
                * mpmath.fsum(reach[i] for i in range(nv) if rotating[i]),
                GRAVITY: mechanism.gravity * mpmath.sqrt(mechanism.total_mass) * mpmath.fdot(lengths, reach),
                PASSIVE: 0,
            }
            for term, name_of in enumerate((VELOCITY, GRAVITY, PASSIVE)):
                first = nv * (nv + term)
                expected = mpmath.matrix(values[first : first + nv])
                sensitivity = mpmath.fsum(size(column[first : first + nv]) for column in moved) + shares[name_of]
                sensitivity += mpmath.fsum(abs(x) * r for x, r in zip(expected, reach, strict=True))
                high, low = (mpmath.matrix(getattr(part, name_of)[index].tolist()) for part in (reference.high, reference.low))
                assert size(high + low - expected) <= mpmath.mpf(2) ** -100 * sensitivity
                assert float(sensitivity) == pytest.approx(getattr(reference.sensitivity, name_of)[index], rel=1e-9, abs=1e-290)
            high, low = (mpmath.matrix(part.mass[index].tolist()) for part in (reference.high, reference.low))
            assert all(abs((high + low - mass)[i, j]) <= mpmath.mpf(2) ** -100 * of_mass[i][j] for i in range(nv) for j in range(nv))
            assert np.array(of_mass, dtype=float) == pytest.approx(reference.sensitivity.mass[index], rel=1e-9)


def test_dual_norm_is_the_energy_norm_of_the_accelerations() -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_3r")
    reference = certify_terms(ReferenceKernel(mechanism), generic_sample(mechanism, 4, 3))
    forces = np.random.default_rng(0).standard_normal((4, 3))
    moved = np.linalg.solve(reference.high.mass, forces[:, :, None])[:, :, 0]
    assert dual_norm(reference.norm_factor, forces) == pytest.approx(np.sqrt(np.einsum("ni,nij,nj->n", moved, reference.high.mass, moved)))


@pytest.mark.parametrize("name", ["arm_2r", "heavy_top"])
def test_batches_and_charts_keep_the_order_of_states(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    states = generic_sample(mechanism, 40, 8)
    kernel = ReferenceKernel(mechanism)
    whole = certify_terms(kernel, states)
    assert name == "arm_2r" or len(list(kernel.by_chart(states))) > 1
    monkeypatch.setattr(term_reference, "_MOST_AT_ONCE", 1)
    single = certify_terms(kernel, states)
    for term in TERMS:
        assert np.array_equal(getattr(whole.high, term), getattr(single.high, term))
        assert getattr(whole.sensitivity, term) == pytest.approx(getattr(single.sensitivity, term), rel=1e-12)
    alone = certify_terms(kernel, states[17:18])
    assert np.array_equal(alone.high.mass[0], whole.high.mass[17])
    assert len(whole) == 40 and len(certify_terms(kernel, states[:0])) == 0


def test_a_singular_mass_matrix_is_still_certified_and_forces_beside_it_are_not() -> None:
    """Nothing can be said of what a force does where it moves no mass."""
    mechanism = load_mechanism(BUILT_IN, "spherical_pendulum")
    program = assemble(
        [sp.Symbol(name) for name in mechanism.program.inputs],
        {
            "mass": [sp.Integer(3), sp.S.Zero, sp.Symbol(mechanism.program.inputs[0]) ** 2],
            "velocity": [sp.S.Zero] * 2,
            "gravity": [sp.sin(sp.Symbol(mechanism.program.inputs[0])), sp.S.One],
            "passive": [sp.S.Zero] * 2,
        },
    )
    kernel = ReferenceKernel(replace(mechanism, program=program))
    reference = certify_terms(kernel, States.at([[0.0, 0.3], [0.5, 0.3]], [[0.0, 0.0]] * 2, [[1.0, 1.0]] * 2))
    assert reference.certified.mass.tolist() == [True, True]
    assert reference.certified.gravity.tolist() == [False, True]


def test_states_that_are_no_numbers_are_marked() -> None:
    mechanism = load_mechanism(BUILT_IN, "cart_pendulum")
    reference = certify_terms(ReferenceKernel(mechanism), States.at([[0.1, np.nan], [0.1, 0.2]], [[0.0, 1.0]] * 2, [[0.0, 0.0]] * 2))
    assert reference.certified.gravity.tolist() == [False, True]
    assert reference.certified.mass.tolist() == [False, True]


# The engines.


def test_terms_of_sound_engines_agree_and_sum_to_nothing(modelled_name: str) -> None:
    """M qdd + velocity + gravity - passive - applied is 0 for the engine's own qdd, to what solving for it leaves.

    See test_engine_properties for the tolerance of the sum.
    """
    mechanism = load_mechanism(BUILT_IN, modelled_name)
    states = generic_sample(mechanism, POSITIONS, seed_of(modelled_name))
    references: dict[ReferenceKernel, TermReference] = {}
    for subject in SUBJECTS:
        if is_misread(subject, mechanism):
            continue
        try:
            model = load(subject, mechanism)
        except Unsupported:
            continue
        kernel = kernel_of(mechanism, subject)
        if kernel not in references:
            references[kernel] = certify_terms(kernel, states)
        terms = model.terms(states.q, states.v, states.tau, *driving_of(model, states))  # type: ignore[attr-defined]
        errors = {name: term_errors(name, references[kernel], terms)[1] for name in TERMS}
        assert all((error <= SOUND).all() for error in errors.values()), (str(subject), errors)
        assert np.array_equal(terms.applied, states.tau)
        assert np.array_equal(terms.mass, terms.mass.swapaxes(1, 2))
        accelerations = engines.accelerations(model, states)
        residual = np.einsum("nij,nj->ni", terms.mass, accelerations) + terms.velocity + terms.gravity - terms.passive - terms.applied
        size = size_of_sum(mechanism, states, terms, accelerations)
        if mechanism.constraints is not None:
            # What holds a constraint is as large as its stiffness makes of the roundings of accelerations.
            size += references[kernel].sensitivity.passive[:, None] * np.sqrt(np.diagonal(terms.mass, axis1=1, axis2=2))
        assert (np.abs(residual) <= BAR * UNIT_ROUNDOFF * size).all(), str(subject)


def size_of_sum(mechanism: Mechanism, states: States, terms: Terms, accelerations: Array) -> Array:
    root = np.sqrt(np.diagonal(terms.mass, axis1=1, axis2=2))
    twice_kinetic = np.einsum("ni,nij,nj->n", states.v, terms.mass, states.v)
    size = root * (root * np.abs(accelerations)).sum(axis=1)[:, None] + np.array(mechanism.rotating) * twice_kinetic[:, None]
    return size + sum(np.abs(getattr(terms, term)) for term in TERMS[1:])


@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("name", MODELLED)
def test_no_term_of_a_sound_engine_is_called_wrong(name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    for subject in SUBJECTS:
        if is_misread(subject, mechanism):
            continue
        try:
            model = load(subject, mechanism)
        except Unsupported:
            continue
        kernel = kernel_of(mechanism, subject)
        for seed in range(10):
            found = compare_terms(kernel, generic_sample(mechanism, 64, seed), model, str(subject))
            assert not found.wrong, (seed, found.sentences)


@pytest.mark.parametrize(("name", "seed"), [("andrews_squeezer", 7), ("rolling_disc_on_incline", 0)])
def test_no_term_of_a_sound_loop_is_called_wrong(name: str, seed: int) -> None:
    """Forces that balance an M of rounded entries, and a disc whose roll has a range and stands in no sine."""
    mechanism = load_mechanism(BUILT_IN, name)
    assert not judged(Subject("mujoco", "mjcf"), mechanism, seed=seed, count=64).wrong


@pytest.mark.parametrize(
    "name",
    [
        *("inertia_wheel_pendulum", "cart_pendulum", "furuta_pendulum", "gyroscope_gimbals"),
        pytest.param("puma_560", marks=pytest.mark.nightly),
    ],
)
def test_special_positions_do_not_make_a_sound_term_wrong(name: str) -> None:
    """Where algebra leaves nothing of a term, engines leave what their frames round; tiny velocities underflow."""
    mechanism = load_mechanism(BUILT_IN, name)
    values = [0.0, 5e-324, 1e-20, 1e-8, np.pi / 2, np.pi, -np.pi / 2, 1e3, 1e8]
    rates = [0.0, 5e-324, 1e-160, 1e-155, 1e-20, 3.0]
    draw = np.random.default_rng(4)
    q = draw.choice(values, size=(120, mechanism.nv))
    for place, bounds in enumerate(mechanism.position_ranges):
        q[:, place] = q[:, place] if bounds is None else np.clip(q[:, place], *bounds)
    states = States.at(q, draw.choice(rates, size=q.shape), draw.choice(rates, size=q.shape))
    for subject in SUBJECTS:
        found = compare_terms(kernel_of(mechanism, subject), states, load(subject, mechanism), str(subject))
        assert not found.wrong, found.sentences


# Planted faults.


@dataclass(frozen=True)
class Fault:
    """A change of one model's text, and the terms it must show in: term to (since, names of places); no other term."""

    system: str
    subject: str
    old: str
    new: str
    expected: Mapping[str, tuple[str, set[tuple[str, ...]]]]

    def __str__(self) -> str:
        return f"{self.system}-{self.subject}-{self.new}"

    def planted(self, text: str) -> str:
        assert text.count(self.old) == 1, self
        return text.replace(self.old, self.new)


SHOULDER, ELBOW = ("shoulder",), ("elbow",)
WHOLE = {("shoulder", "shoulder"), ("shoulder", "elbow"), ("elbow", "elbow")}
BOTH = {SHOULDER, ELBOW}
OF_THE_FOREARM = {MASS: (AT_REST, WHOLE), GRAVITY: (AT_REST, BOTH), VELOCITY: (MOVING, BOTH)}
FAULTS = [
    # A mass, of the last link and of the first.
    Fault("arm_2r", "mujoco/mjcf", 'mass="2"', 'mass="2.000000001"', OF_THE_FOREARM),
    Fault("arm_2r", "pinocchio/urdf", 'mass value="2"', 'mass value="2.1"', OF_THE_FOREARM),
    Fault("arm_2r", "mujoco/mjcf", 'mass="3"', 'mass="3.1"', {MASS: (AT_REST, {("shoulder", "shoulder")}), GRAVITY: (AT_REST, {SHOULDER})}),
    # A moment of inertia enters nothing else in the plane.
    Fault("arm_2r", "mujoco/mjcf", '1e-15 0.07 0.07', '1e-15 0.0700001 0.0700001', {MASS: (AT_REST, {("shoulder", "shoulder")})}),
    # The centre of mass.
    Fault(
        "arm_2r", "pinocchio/urdf", '<origin xyz="0.18 0 0"/>', '<origin xyz="0.18 0 0.001"/>',
        OF_THE_FOREARM,
    ),
    # Gravity: its size, and along another axis.
    Fault("cart_pendulum", "mujoco/mjcf", "0 0 -9.81", "0 0 -9.81000001", {GRAVITY: (AT_REST, {("pin",)})}),
    Fault("arm_2r", "mujoco/mjcf", "0 0 -9.81", "-9.81 0 0", {GRAVITY: (AT_REST, BOTH)}),
    # Dampers and springs, in both formats.
    Fault("furuta_pendulum", "mujoco/mjcf", 'damping="0.002"', 'damping="0.004"', {PASSIVE: (MOVING, {("arm",)})}),
    Fault("furuta_pendulum", "pinocchio/urdf", 'damping="0.0014"', 'damping="0"', {PASSIVE: (MOVING, {("pendulum",)})}),
    Fault("quarter_car", "mujoco/mjcf", 'stiffness="16000"', 'stiffness="16001"', {PASSIVE: (AT_REST, {("suspension",)})}),
    Fault("quarter_car", "pinocchio/urdf", "<springStiffness>160000<", "<springStiffness>160000.001<", {PASSIVE: (AT_REST, {("tyre",)})}),
    # A flipped axis changes the sign of everything that comes to that joint alone.
    Fault(
        "furuta_pendulum", "mujoco/mjcf", 'axis="0 0 1"', 'axis="0 0 -1"',
        {MASS: (AT_REST, {("arm", "pendulum")}), VELOCITY: (MOVING, {("arm",)})},
    ),
    # Armature is felt by its own entry only.
    Fault("furuta_pendulum", "mujoco/mjcf", 'damping="0.0014"', 'damping="0.0014" armature="1e-9"',
          {MASS: (AT_REST, {("pendulum", "pendulum")})}),
    # A ball joint has three coordinates.
    Fault(
        "heavy_top", "mujoco/mjcf", "0.125 0.125 0.125", "0.125 0.125 0.126",
        {MASS: (AT_REST, {("pivot about z", "pivot about z")}), VELOCITY: (MOVING, {("pivot about x",), ("pivot about y",)})},
    ),
]  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_planted_fault_is_found_in_its_terms_and_places(fault: Fault) -> None:
    mechanism = load_mechanism(BUILT_IN, fault.system)
    subject = next(subject for subject in SUBJECTS if str(subject) == fault.subject)
    found = judged(subject, mechanism, fault.planted)
    assert {finding.term: (finding.since, {place.names for place in finding.places}) for finding in found.wrong} == fault.expected
    for finding in found.wrong:
        assert finding.verdict == Verdict.DISAGREES
        assert finding.backward_error is not None and finding.backward_error > AGREEMENT
    kinds = [AT_REST, MOVING, LOADED]
    assert kinds.index(found.accelerations_since) >= min(kinds.index(finding.since) for finding in found.wrong)


def test_the_size_of_a_fault_is_told_in_data_roundoffs() -> None:
    """A mass larger by e moves gravity by e of it at least at the elbow, whose data roundoff is a few u of it."""
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    subject = Subject("mujoco", "mjcf")
    errors = []
    for change in (1e-9, 1e-6):
        found = judged(subject, mechanism, lambda text, change=change: text.replace('mass="2"', f'mass="{2 * (1 + change)!r}"'))
        errors.append(found.findings[TERMS.index(MASS)].backward_error)
    assert errors[1] == pytest.approx(1000 * errors[0], rel=1e-3)
    assert 1e-9 / UNIT_ROUNDOFF / 20 < errors[0] < 1e-9 / UNIT_ROUNDOFF


class Changed:
    """A sound model whose terms and accelerations pass through a function."""

    def __init__(self, model: Model, terms: Callable[[Terms], Terms], accelerations: Callable[[Array], Array] = lambda a: a) -> None:
        self._model, self._terms, self._accelerations = model, terms, accelerations

    def loaded(self) -> None:
        return None

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        return self._accelerations(self._model.forward_dynamics(q, v, tau))

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        return self._terms(self._model.terms(q, v, tau))  # type: ignore[attr-defined]


def compared(terms: Callable[[Terms], Terms], accelerations: Callable[[Array], Array] = lambda a: a) -> TermComparison:
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    model = Changed(load(Subject("pinocchio", "urdf"), mechanism), terms, accelerations)
    return compare_terms(ReferenceKernel(mechanism), generic_sample(mechanism, POSITIONS, 0), model, "changed")


def test_forces_on_the_wrong_joint_show_once_there_are_any() -> None:
    found = compared(lambda terms: replace(terms, applied=terms.applied[:, ::-1]))
    (finding,) = found.wrong
    assert (finding.term, finding.since, finding.wrong, finding.states) == (APPLIED, LOADED, POSITIONS, POSITIONS)
    assert {place.names for place in finding.places} == BOTH
    assert finding.sentence.startswith("applied forces: forces on ")
    assert "wherever forces are applied" in finding.sentence


def test_a_flipped_coriolis_force_shows_once_it_moves() -> None:
    (finding,) = compared(lambda terms: replace(terms, velocity=-terms.velocity)).wrong
    assert (finding.term, finding.since) == (VELOCITY, MOVING)
    assert (finding.wrong, finding.states) == (2 * POSITIONS, 2 * POSITIONS)
    assert "wherever it moves" in finding.sentence


def test_sound_terms_beside_wrong_accelerations_blame_what_is_no_term() -> None:
    found = compared(lambda terms: terms, lambda accelerations: accelerations * (1 + 1e-9))
    assert not found.wrong
    assert found.accelerations_since == AT_REST
    assert "every term agrees, but accelerations do not, at rest already: " in found.sentences[0]


def test_a_term_that_is_no_number_is_an_error() -> None:
    def spoilt(terms: Terms) -> Terms:
        gravity = terms.gravity.copy()
        gravity[3, 1] = np.nan
        return replace(terms, gravity=gravity)

    (finding,) = compared(spoilt).wrong
    assert (finding.term, finding.verdict, finding.wrong, finding.states) == (GRAVITY, Verdict.ERROR, 1, 3 * POSITIONS)
    assert finding.sentence == f"gravity: not finite at 1 of {3 * POSITIONS} states, at rest already"
    assert finding.backward_error is None
    assert finding.worst_state["q"] == generic_sample(load_mechanism(BUILT_IN, "arm_2r"), POSITIONS, 0).q[3].tolist()


@pytest.mark.ci
def test_digits_that_solving_loses_show_no_wrong_term() -> None:
    mechanism = load_mechanism(BUILT_IN, "chain_12")
    model = load(Subject("mujoco", "mjcf"), mechanism)
    found = compare_terms(ReferenceKernel(mechanism), straight(mechanism), model, "mujoco/mjcf", factorises=True)
    assert (found.wrong, found.loses_digits, found.accelerations_since) == ((), True, AT_REST)
    assert found.sentences == ("no term is wrong; solving for the accelerations loses digits, at rest already",)


def straight(mechanism: Mechanism) -> States:
    """A chain in one line, on which MuJoCo's factorisation loses digits."""
    states = generic_sample(mechanism, POSITIONS, 0)
    position = np.zeros_like(states.q)
    position[:, 0] = np.linspace(0.5, 2.5, POSITIONS)
    return States(position, states.v, states.tau, states.time)


def test_an_engine_without_terms_is_judged_by_its_accelerations_alone() -> None:
    mechanism = load_mechanism(BUILT_IN, "arm_2r")
    model = load(Subject("pinocchio", "urdf"), mechanism)

    class Silent:
        loaded, forward_dynamics = model.loaded, model.forward_dynamics

    found = compare_terms(ReferenceKernel(mechanism), generic_sample(mechanism, POSITIONS, 0), Silent(), "silent")
    assert (found.findings, found.accelerations_since, found.sentences) == ((), "", ("the engine states no terms",))


def test_it_is_said_in_plain_data_and_a_sentence() -> None:
    mechanism, subject = load_mechanism(BUILT_IN, "arm_2r"), Subject("mujoco", "mjcf")
    found = judged(subject, mechanism, lambda text: text.replace('"1e-15 0.04 0.04"', '"1e-15 0.0400001 0.0400001"'), seed=1)
    (finding,) = found.wrong
    assert finding.sentence.startswith("mass matrix: entries (elbow, elbow), ")
    assert " are wrong at every state; " in finding.sentence
    plain = found.as_json()
    assert plain["sentences"] == [finding.sentence]
    assert plain["findings"][0]["places"][0]["names"] == ("elbow", "elbow")
    assert set(plain["findings"][0]["worst_state"]) == {"q", "v", "tau"}
    assert judged(subject, mechanism, seed=1).sentences == ("every term agrees",)


def test_one_wrong_entry_is_named_alone() -> None:
    mechanism = load_mechanism(BUILT_IN, "furuta_pendulum")
    damping = 'damping="0.002"'
    found = judged(Subject("mujoco", "mjcf"), mechanism, lambda text: text.replace(damping, f'{damping} armature="0.1"'), seed=1)
    assert len(found.sentences) == 1
    assert found.sentences[0].startswith("mass matrix: entry (arm, arm) is wrong at every state; ")


def test_names_of_coordinates_tell_those_of_one_joint_apart() -> None:
    assert coordinate_names(load_mechanism(BUILT_IN, "arm_2r")) == ["shoulder", "elbow"]
    assert coordinate_names(load_mechanism(BUILT_IN, "heavy_top")) == [f"pivot about {axis}" for axis in "xyz"]
    free = coordinate_names(load_mechanism(BUILT_IN, "free_body"))
    assert free == [*(f"body along {axis}" for axis in "xyz"), *(f"body about {axis}" for axis in "xyz")]
