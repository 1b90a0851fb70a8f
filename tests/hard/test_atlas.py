"""The atlas tells sound engines from unstable and wrong ones, and leaves no family in silence.

Three engines are planted as a library's own: one that solves with an explicit inverse of M, one that rounds M to
single precision, and one in which a single Coriolis term has the wrong sign.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from catalogue import PLAIN, TREES
from studies import silent
from support import completed

from harness.engines import EQUATIONS, Subject, engine_paths, load_engine, select_subjects, subjects
from harness.engines.engine import run_engine_file
from harness.errors import InvalidInput, InvalidRequest
from harness.hard.atlas import AtlasStudy, HardExpectation, Key, judged, load_hard_expectations
from harness.hard.cases import hard_cases
from harness.hard.measurement import measure
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.atlas import HardPoint, HardRow
from harness.results.records import ACCELERATIONS
from harness.truth.compare import Comparison, compare
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.workers import Workers

ENGINE = """
import os
import numpy as np
from harness.programs.kernels import Float64Kernel
from harness.programs.states import States

class Model:
    def __init__(self, mechanism):
        self.mechanism, self.kernel = mechanism, KERNELS.setdefault(mechanism.name, Float64Kernel(mechanism.program))

    def loaded(self):
        return None

    def terms(self, q, v, tau):
        return self.kernel.terms(self.mechanism.inputs(States.at(q, v, tau)))

    def forward_dynamics(self, q, v, tau):
        terms = self.terms(q, v, tau)
        M, force = terms["mass"], tau + terms["passive"] - terms["velocity"] - terms["gravity"]
        {body}

from harness.engines import Engine

class Engine(Engine):
    requires = ("numpy", "numpy")
    formats = ("equations",)
    factorises_mass_matrix = True

    def load(self, source, joints, gravity):
        return Model(source)

KERNELS = {{}}
ENGINE = Engine()
"""
SOLVE = "return np.linalg.solve(M, force[:, :, None])[:, :, 0]"
# The velocity terms are a quadratic form of v, and a Coriolis term is twice one of its products of two rates.
FLIP = f"""
        found = coriolis_term(self.mechanism, self.terms, q)
        if found is not None:
            i, j, k, coefficient = found
            force[:, i] += 2 * coefficient * v[:, j] * v[:, k]
        {SOLVE}

def coriolis_term(mechanism, terms, q):
    n = mechanism.nv
    rest = np.zeros((len(q), n))
    def velocity(*rates):
        v = rest.copy()
        v[:, list(rates)] = 1.0
        return terms(q, v, rest)["velocity"]
    for j in range(n):
        for k in range(j):
            product = velocity(j, k) - velocity(j) - velocity(k) + velocity()
            for i in range(n):
                if np.abs(product[:, i]).max() > 1e-9 * np.abs(velocity(j, k)).max():
                    return i, j, k, product[:, i]
"""
BODIES = {
    "inverting": "return np.einsum('nij,nj->ni', np.linalg.inv(M), force)",
    "single": "M = M.astype(np.float32).astype(np.float64); " + SOLVE,
    "flipped": FLIP.strip(),
    "sound": SOLVE,
    "silent": "return np.full_like(v, np.nan)",
    "aborting": "os.abort()",
}
EASY = ["bar_pendulum", "double_pendulum", "arm_2r", "cart_pendulum", "spring_pendulum", "coupled_oscillators"]


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The built-in library with the planted engines beside the harness's own."""
    folder = tmp_path_factory.mktemp("engines")
    for name, body in BODIES.items():
        (folder / f"{name}.py").write_text(ENGINE.format(body=body))
    return dataclasses.replace(Library.built_in(), engines=folder)


@dataclasses.dataclass
class Sampled:
    """A system with its truth at sampled states."""

    mechanism: Mechanism
    states: States
    reference: Reference

    def judge(self, library: Library, engine: str) -> Comparison:
        loaded = load_engine(library, engine).load(self.mechanism, self.mechanism.joints, self.mechanism.gravity)
        return compare(self.reference, loaded.forward_dynamics(self.states.q, self.states.v, self.states.tau), factorises=True)


def _sampled(name: str) -> Sampled:
    mechanism = load_mechanism(Library.built_in(), name)
    states = generic_sample(mechanism, 64, 1)
    return Sampled(mechanism, states, ReferenceKernel(mechanism).evaluate(states))


@pytest.fixture(scope="module", params=EASY)
def easy(request: pytest.FixtureRequest) -> Sampled:
    return _sampled(str(request.param))


def _row(library: Library, case: str, engine: str) -> HardRow:
    return measure(case, Subject(engine, EQUATIONS), ACCELERATIONS, library, silent)


@pytest.mark.ci
def test_an_explicit_inverse_agrees_on_easy_systems(planted: Library, easy: Sampled) -> None:
    assert set(easy.judge(planted, "inverting").verdicts) == {"agrees"}


@pytest.mark.parametrize("case", ["massless_knee", "zero_length_link", "gimbal_lock"])
def test_an_explicit_inverse_is_unstable_where_the_mass_matrix_is_ill_conditioned(planted: Library, case: str) -> None:
    row = _row(planted, case, "inverting")
    # Beyond 1e-3 / u too few digits are left, and beyond 1/u LAPACK calls the matrix singular and gives nothing.
    ill_conditioned = [point for point in row.points if point.condition is not None and 1e8 < point.condition < 1e12]
    assert len(ill_conditioned) > 3
    assert {point.verdict for point in ill_conditioned} == {"unstable"}


@pytest.mark.ci
def test_single_precision_disagrees_wherever_the_mass_matrix_is_not_exact_in_it(planted: Library, easy: Sampled) -> None:
    _judge_single_precision(planted, easy)


@pytest.mark.ci
def test_a_flipped_coriolis_term_disagrees_wherever_there_is_one(planted: Library, easy: Sampled) -> None:
    _judge_flipped(planted, easy)


def _judge_single_precision(planted: Library, system: Sampled) -> None:
    """State by state; an M that single precision holds agrees."""
    states = system.states
    mass = load_engine(planted, "sound").load(system.mechanism, (), 0.0).terms(states.q, states.v, states.tau)["mass"]  # type: ignore[attr-defined]
    exact = (mass == mass.astype(np.float32)).all(axis=(1, 2))
    verdicts = system.judge(planted, "single").verdicts
    assert set(verdicts[exact]) <= {"agrees"}
    # Where the force happens to vanish, so does what the rounding does.
    assert set(verdicts[~exact]) <= {"disagrees"}


def _judge_flipped(planted: Library, system: Sampled) -> None:
    """A sound copy agrees; the flipped one disagrees at every state where the term is felt, if there is a term."""
    states = system.states
    assert set(system.judge(planted, "sound").verdicts) <= {"agrees", "unstable"}
    verdicts = system.judge(planted, "flipped").verdicts
    model = run_engine_file(engine_paths(planted)["flipped"], "flipped").load(system.mechanism, (), 0.0)
    scope = model.forward_dynamics.__globals__  # type: ignore[attr-defined]
    found = scope["coriolis_term"](system.mechanism, model.terms, states.q)  # type: ignore[attr-defined]
    if found is None:
        assert set(verdicts) == {"agrees"}
    else:
        assert "disagrees" in verdicts
        assert (verdicts == "disagrees").mean() > 0.9


@pytest.mark.ci
def test_the_easy_systems_have_all_kinds(planted: Library) -> None:
    """Or the two tests above could pass for want of anything to see."""
    exact = _sampled("coupled_oscillators").judge(planted, "flipped")
    assert set(exact.verdicts) == {"agrees"}
    assert "disagrees" in _sampled("arm_2r").judge(planted, "flipped").verdicts


@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("name", [name for name in PLAIN if name in TREES and not name.startswith("chain")])
def test_planted_engines_over_the_catalogue(planted: Library, name: str) -> None:
    """The planted engines know one chart, so systems that need several are none of theirs; a constraint may hide what is planted."""
    system = _sampled(name)
    _judge_flipped(planted, system)
    verdicts = system.judge(planted, "single").verdicts
    assert set(verdicts) <= {"agrees", "disagrees"}


@pytest.mark.ci
def test_growth_is_fitted_and_every_point_is_certified(planted: Library) -> None:
    """A double pendulum's knee that loses its mass costs a factorisation half a digit of data roundoff a decade."""
    row = _row(planted, "massless_knee", "sound")
    assert row.growth is not None and row.digits_growth is not None
    assert row.growth == pytest.approx(-0.5, abs=0.1)
    assert row.digits_growth == pytest.approx(-1.0, abs=0.1)
    assert all(point.certified == point.states > 0 for point in row.points)
    assert all(point.unstable_bound is not None and point.unstable_bound > 64 for point in row.points)
    conditions = [point.condition for point in row.points]
    assert conditions == sorted(conditions, key=lambda condition: -(condition or 0.0))


@pytest.mark.ci
def test_a_refused_model_is_told_in_the_engines_words() -> None:
    row = measure("vanishing_cart", Subject("mujoco", "mjcf"), ACCELERATIONS, Library.built_in(), silent)
    refused = [point for point in row.points if point.verdict == "unsupported"]
    assert [point.knob for point in refused] == [point.knob for point in row.points if point.knob < 1e-15]
    assert refused and all("larger than mjMINVAL" in point.reason for point in refused)
    assert row.verdict == "unsupported"


@pytest.mark.ci
def test_answers_that_are_not_finite_are_an_error(planted: Library) -> None:
    row = _row(planted, "stiff_damper", "silent")
    assert row.verdicts == {"error": 30}
    assert all("not finite" in point.reason for point in row.points)


def test_why_a_state_is_undecided() -> None:
    mechanism = load_mechanism(Library.built_in(), "double_pendulum")
    singular = np.array([[0.0, 1.25, 1.5, 2.0, 9.81]])
    reference = ReferenceKernel(mechanism).evaluate(States.at([0.3, 0.0], [1.0, 1.0], [0.0, 0.0]), singular)
    assert not reference.certified.any()
    assert "singular" in next(reference.why_undecided())


@pytest.mark.ci
def test_a_crash_costs_one_row(planted: Library) -> None:
    subject, sound = Subject("aborting", EQUATIONS), Subject("sound", EQUATIONS)
    with Workers(count=1, time_limit=60) as workers:
        study = AtlasStudy(planted, ["stiff_damper"], [str(subject), str(sound)])
        found = {row.subject: row for row in completed(study, workers).rows}
    assert found["sound"].verdicts == {"agrees": 30} and found["sound"].as_expected
    assert found["aborting"].verdict == "error" and not found["aborting"].as_expected
    [point] = found["aborting"].points
    assert "SIGABRT" in point.reason and point.knob == hard_cases()["stiff_damper"].values[0]


def test_no_such_case() -> None:
    with pytest.raises(InvalidRequest, match="no hard case is called 'soft'"):
        AtlasStudy(Library.built_in(), ["soft"])


def _row_of(**verdicts: int) -> HardRow:
    points = [
        HardPoint(knob=1.0, system="s", verdict=verdict, backward_error=1000.0, reason="" if verdict in ("agrees", "unstable") else "told")
        for verdict, count in verdicts.items()
        for _ in range(count)
    ]
    return HardRow(case="c", title="", subject="e", knob="k", unit="", points=points, verdict="")


def expectation(
    backward_error: float | None = None, verdict: str = "unstable", median: float | None = None, share: float | None = None
) -> HardExpectation:
    return HardExpectation(
        case="c", subject="e", verdict=verdict, reason="why", remedy="cure", link="link", backward_error=backward_error,
        median_backward_error=median, share=share,
    )  # fmt: skip


UNSTABLE: Mapping[Key, HardExpectation] = {("c", "e", "unstable"): expectation(2000.0)}


@pytest.mark.parametrize(
    ("row", "expected", "problem"),
    [
        (_row_of(agrees=3), {}, ""),
        (_row_of(agrees=2, unstable=1), UNSTABLE, ""),
        (_row_of(unstable=1), {}, "unstable at 1 points, which no entry expects"),
        (_row_of(undecided=2), {}, "undecided at 2 points"),
        (_row_of(unsupported=2), {}, "unsupported at 2 points"),
        (_row_of(unstable=1, disagrees=1), UNSTABLE, "disagrees at 1 points"),
        (_row_of(agrees=3), UNSTABLE, "the entry for unstable holds at no point any more"),
        (_row_of(unstable=1), {("c", "e", "unstable"): expectation(500.0)}, "the entry explains 500"),
        (
            _row_of(unstable=1),
            {("c", "e", "unstable"): expectation(2000.0, median=900.0)},
            "median backward error 1e+03; the entry explains 900",
        ),
        (
            _row_of(agrees=1, unstable=1),
            {("c", "e", "unstable"): expectation(2000.0, share=0.4)},
            "at 50% of the points; the entry explains 40%",
        ),
        (_row_of(agrees=1, unstable=1), {("c", "e", "unstable"): expectation(2000.0, share=0.5)}, ""),
    ],
)
def test_what_is_not_as_expected(row: HardRow, expected: Mapping[Key, HardExpectation], problem: str) -> None:
    problems = judged(row, expected).problems
    assert not problems if not problem else problem in "; ".join(problems)


def test_a_point_without_a_reason_is_silence() -> None:
    row = dataclasses.replace(_row_of(), points=[HardPoint(knob=2.0, system="s", verdict="undecided")])
    expected = {("c", "e", "undecided"): expectation(verdict="undecided")}
    assert judged(row, expected).problems == ["undecided at k = 2 without a reason"]


BOUNDS = "must have backward_error and median_backward_error and share"
ENTRY = '[[expected]]\ncase = "stiff_damper"\nsubject = "lagrange"\nverdict = "unstable"\nreason = "r"\nremedy = "u"\nlink = "l"\n'


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (ENTRY, BOUNDS),
        (ENTRY + "backward_error = 1.0\n", BOUNDS),
        (
            ENTRY.replace("unstable", "disagrees") + "backward_error = 1.0\nshare = 0.5\n",
            BOUNDS,
        ),
        (ENTRY + "backward_error = 1.0\nmedian_backward_error = 1.0\nshare = 2.0\n", "`float` <= 1.0"),
        (ENTRY.replace("stiff_damper", "stiff_dumper") + "backward_error = 1.0\n", "did you mean 'stiff_damper'"),
        (ENTRY.replace('remedy = "u"\n', "") + "backward_error = 1.0\n", "missing required field `remedy`; expected the texts"),
        (ENTRY.replace('"unstable"', '"agrees"') + "backward_error = 1.0\n", "names verdict 'agrees'"),
        (
            (ENTRY + "backward_error = 1.0\nmedian_backward_error = 1.0\nshare = 0.5\n") * 2,
            "repeats stiff_damper, lagrange, accelerations, unstable",
        ),
        (
            ENTRY.replace('"unstable"', '"undecided"') + "backward_error = 1.0\n",
            "undecided is not compared",
        ),
        ("[[", "cannot be read as TOML"),
    ],
)
def test_a_malformed_file_of_expectations_is_refused(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "expected.toml"
    path.write_text(text)
    with pytest.raises(InvalidInput, match=problem):
        load_hard_expectations(["lagrange"], path=path)


def test_the_harnesss_own_expectations_can_be_read() -> None:
    known = [str(subject) for subject in subjects(Library.built_in())]
    expected = load_hard_expectations(known)
    assert expected and all(entry.backward_error is None or entry.backward_error > 64 for entry in expected.values())


@pytest.mark.parametrize("case", ["near_equilibrium", "collapsed_spring", "spherical_pole", "massless_knee"])
@pytest.mark.parametrize("subject", select_subjects(Library.built_in(), (), native_only=True), ids=str)
def test_a_family_is_as_expected(case: str, subject: Subject) -> None:
    _check_family(case, subject)


@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("case", hard_cases())
def test_every_family_is_as_expected(case: str) -> None:
    for subject in select_subjects(Library.built_in(), hard_cases()[case].subjects, native_only=True):
        _check_family(case, subject)


def _check_family(case: str, subject: Subject) -> None:
    known = [str(subject) for subject in subjects(Library.built_in())]
    expected = load_hard_expectations(known)
    row = judged(measure(case, subject, ACCELERATIONS, Library.built_in(), silent), expected)
    assert row.problems == []
    assert all(point.certified == point.states or point.reason for point in row.points)
