"""Equalities that nearly hold: positions cancel in what they leave, which an engine forms and no derivative feels."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from studies import assignment_of

from harness.arrays import Array
from harness.comparison.robot_library import resolved
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.solvers import endings_of
from harness.engines import Model, Subject
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.states import States
from harness.truth import residual_share
from harness.truth.sampling import sample

FIRM = Path(__file__).parent.parent / "comparison" / "files" / "firm.xml"
# Its loop is open by 1.4e-7 m there, and its lengths are of 0.2 to 0.4 m.
NEARLY_CLOSED = States.at(
    [0.0004599904670633973, -0.00046004912376446685, 0.00045930287044409384],
    [-0.02355705079415706, -0.023509558018192104, 0.03882730336939576],
    [0.0, -1e-08, 0.0],
)


def firm() -> tuple[Assignment, Model]:
    """A loop that MuJoCo closes, and MuJoCo with a solver that goes to the end."""
    library = resolved(Library.built_in(), [str(FIRM)], acts=True)
    own = Assignment(library, Subject("mujoco", "mjcf"), load_mechanism(library, str(FIRM)), None, str(FIRM))
    ended, _, _ = next(endings_of(own, load_audited(own)))
    return own, ended


def test_an_answer_whose_positions_cancel_agrees_by_the_share_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    own, ended = firm()
    found = own.truth.asked_and_judged(own.truth.evaluate(NEARLY_CLOSED), NEARLY_CLOSED, ended)
    assert (found.verdicts[0], found.granted[0]) == ("agrees", True) and found.backward_error[0] < 8

    def nothing(mechanism: object, inputs: Array, norm_factor: Array) -> Array:
        return np.zeros(len(norm_factor))

    monkeypatch.setattr(residual_share, "residual_share", nothing)
    found = own.truth.asked_and_judged(own.truth.evaluate(NEARLY_CLOSED), NEARLY_CLOSED, ended)
    assert not found.granted[0] and found.backward_error[0] > 64


def test_the_share_is_what_a_rounding_of_all_positions_does_to_an_engine() -> None:
    """MuJoCo's second anchor, moved in its compiled model along the axes in which the loop is open."""
    own, _ = firm()
    truth, step = own.truth.evaluate(NEARLY_CLOSED), 2.0**-30
    answers = []
    for moved in ([0, 0, 0], [step, 0, 0], [0, 0, step]):
        model = mujoco.MjModel.from_xml_path(str(FIRM))
        model.opt.tolerance, data = 0.0, mujoco.MjData(model)
        model.eq_data[0, 3:6] += moved
        data.qpos, data.qvel, data.qfrc_applied = NEARLY_CLOSED.q[0], NEARLY_CLOSED.v[0], NEARLY_CLOSED.tau[0]
        mujoco.mj_forward(model, data)
        answers.append(data.qacc.copy())
    by_metre = [truth.lengths((answer - answers[0])[None])[0] / step for answer in answers[1:]]
    # In each axis positions of both points, of 0.4 m and 0.2 m, and what they are sums of.
    assert 0.8 * by_metre[0] + 0.4 * by_metre[1] < truth.share[0] < 8 * sum(by_metre)


@pytest.mark.parametrize("name", ["four_bar", "parallelogram"])
def test_elsewhere_the_share_is_no_larger_than_what_data_do(name: str) -> None:
    own = assignment_of(name, "mujoco/mjcf")
    truth = own.truth.evaluate(own.truth.asked_at(sample(own.mechanism, 200, 0)))
    assert np.median(truth.share / truth.sensitivity) < 4
