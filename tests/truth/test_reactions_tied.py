"""Reactions under constraints: the certified ones against bodies kept free, and engines rigid and by their declared law."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN, CALLED_HERE, MODELLED, is_tied
from free_bodies import free_bodies
from support import make_library

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, truth_of
from harness.engines import Model, NotOffered, Subject, Unsupported, load_engine
from harness.errors import InvalidModel
from harness.files.model_file import parse_model, read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.trees.robot import tree_of
from harness.truth.compare import compare
from harness.truth.quantities import Truth
from harness.truth.sampling import generic_sample, sample
from harness.verdict import AGREEMENT

BITS = 192
SEED = 5
STATES = 16
TIED = [name for name in MODELLED if is_tied(name)]
SUBJECTS = [Subject(engine, model_format) for engine in ("mujoco", "pinocchio") for model_format in ("mjcf", "urdf")]


def asked(name: str, subject: Subject, text: str = "") -> tuple[Truth, Model]:
    """The truth of a subject's reactions, and its model, of another text where one is given."""
    mechanism, path = load_mechanism(BUILT_IN, name), BUILT_IN.model_path(name, subject.format)
    read = parse_model(path, text, subject.format) if text else read_model(path, subject.format)
    truth = truth_of(Assignment(BUILT_IN, subject, mechanism, read, quantity="reactions"))
    return truth, load_engine(CALLED_HERE, subject.engine).load(read, mechanism.joints, mechanism.gravity)


def verdicts_of(name: str, subject: Subject, states: int = STATES) -> set[str]:
    truth, model = asked(name, subject)
    drawn = sample(load_mechanism(BUILT_IN, name), states, SEED)
    return set(compare(truth.evaluate(drawn), truth.answers(model, drawn)).verdicts.tolist())


@pytest.mark.parametrize("name", ["four_bar", "cycloid_bead"])
def test_certified_reactions_are_those_of_bodies_kept_free(name: str) -> None:
    mechanism = load_mechanism(BUILT_IN, name)
    truth, _ = asked(name, Subject("pinocchio", "urdf"))
    declared = read_model(BUILT_IN.model_path(name, "mjcf"), "mjcf")
    equations = free_bodies(tree_of(declared, mechanism.gravity), mechanism.joints, constraints=declared.constraints)
    states = generic_sample(mechanism, 3, SEED)
    certified = truth.evaluate(states)
    assert certified.certified.all()
    order = [block.split("'")[1] for block in truth.blocks[: len(equations.joints)]]
    with flint.ctx.workprec(BITS):
        bound = equations.bind()
        for row in range(len(states)):
            found = bound.solve([*states.q[row].tolist(), *states.v[row].tolist(), *states.tau[row].tolist(), 0.0])
            for block, (kind, joint) in enumerate((kind, joint) for kind in ("forces", "moments") for joint in order):
                first = 3 * equations.joints.index(joint)
                left = [
                    float(ball - flint.arb(float(high)) - flint.arb(float(low)))
                    for ball, high, low in zip(
                        found[kind][first : first + 3], certified.high[row, block], certified.low[row, block], strict=True
                    )
                ]
                allowed = 1e-6 * UNIT_ROUNDOFF * (certified.sensitivity[row, block] + certified.share[row, block])
                assert np.linalg.norm(left) <= allowed, (kind, joint)


@pytest.mark.parametrize("subject", SUBJECTS, ids=str)
def test_engines_agree_on_a_loop(subject: Subject) -> None:
    assert verdicts_of("four_bar", subject) == {"agrees"}


@pytest.mark.parametrize("subject", SUBJECTS, ids=str)
@pytest.mark.parametrize("name", TIED)
def test_engines_agree_on_every_mechanism_with_constraints_that_they_answer(name: str, subject: Subject) -> None:
    try:
        assert verdicts_of(name, subject, 64) == {"agrees"}
    except (NotOffered, Unsupported):
        assert subject.engine == "pinocchio"


def test_redundant_rows_leave_rigid_reactions_open_and_a_law_settles_them() -> None:
    with pytest.raises(NotOffered, match="rows of its constraints follow from others"):
        asked("parallelogram", Subject("pinocchio", "urdf"))
    assert verdicts_of("parallelogram", Subject("mujoco", "mjcf")) == {"agrees"}


@pytest.mark.ci
def test_mujocos_solver_balances_a_loop_of_light_bodies() -> None:
    """By its default tolerance it does not: 3500 data roundoffs."""
    truth, model = asked("andrews_squeezer", Subject("mujoco", "mjcf"))
    # At the 500 sampled states there are two that show it.
    states = sample(load_mechanism(BUILT_IN, "andrews_squeezer"), 500, 0)
    assert compare(truth.evaluate(states), truth.answers(model, states)).backward_error.max() < AGREEMENT


class WithoutLoops:
    """An engine that leaves what its constraints do out of its reactions."""

    def __init__(self, model: Any) -> None:
        self._model = model

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        constraints, solve = self._model.constraints, self._model.constraints.with_forces_on_bodies

        def without(inputs: tuple[Array, ...]) -> tuple[Array, list[Any]]:
            accelerations, forces = solve(inputs)
            return accelerations, [0 * force for force in forces]

        constraints.with_forces_on_bodies = without
        found: Array = self._model.reactions(q, v, tau)
        del constraints.with_forces_on_bodies
        return found


def test_a_constraint_force_that_is_left_out_disagrees_and_so_does_a_rigid_answer_to_a_soft_question() -> None:
    truth, model = asked("four_bar", Subject("pinocchio", "urdf"))
    states = generic_sample(load_mechanism(BUILT_IN, "four_bar"), STATES, SEED)
    certified = truth.evaluate(states)
    spoiled = compare(certified, truth.answers(WithoutLoops(model), states))  # type: ignore[arg-type]
    assert set(spoiled.verdicts.tolist()) == {"disagrees"}
    soft, _ = asked("four_bar", Subject("mujoco", "urdf"))
    rigid = compare(soft.evaluate(states), truth.answers(model, states))
    assert set(rigid.verdicts.tolist()) == {"disagrees"} and (rigid.backward_error > 1e9).all()


@pytest.mark.parametrize("subject", [Subject("pinocchio", "urdf"), Subject("mujoco", "urdf")], ids=str)
@pytest.mark.parametrize(
    ("old", "new"),
    [('<mass value="1.2"/>', '<mass value="1.2000000001"/>'), ('p_AP value="1.5 0 0"', 'p_AP value="1.5000000001 0 0"')],
)
def test_a_fault_of_the_tenth_digit_in_a_loop_disagrees(subject: Subject, old: str, new: str) -> None:
    text = BUILT_IN.model_path("four_bar", "urdf").read_text()
    assert text.count(old) == 1
    truth, model = asked("four_bar", subject, text.replace(old, new))
    states = generic_sample(load_mechanism(BUILT_IN, "four_bar"), STATES, SEED)
    found = compare(truth.evaluate(states), truth.answers(model, states))
    assert "disagrees" in found.verdicts.tolist()


def test_a_declared_file_that_moves_otherwise_is_no_truth(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["four_bar"])
    path = root / "mjcf" / "four_bar.xml"
    text = path.read_text()
    assert 'mass="1.2"' in text
    path.write_text(text.replace('mass="1.2"', 'mass="1.2001"'))
    library = Library.at(root)
    mechanism, subject = load_mechanism(library, "four_bar"), Subject("mujoco", "urdf")
    read = read_model(library.model_path("four_bar", "urdf"), "urdf")
    truth = truth_of(Assignment(library, subject, mechanism, read, quantity="reactions"))
    with pytest.raises(InvalidModel, match="data roundoffs from those of the energies"):
        truth.evaluate(generic_sample(mechanism, 4, SEED))
