"""Answers at light links far from the centre of their tree are unstable where that explains their error, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from catalogue import BUILT_IN, ROBOTS

from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.compare import Comparison, compare
from harness.truth.far_links import TREE, WORLD, FarLinks
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample, sample
from harness.verdict import Verdict

ARM = next(path for path in ROBOTS if path.name == "arm.urdf")


def test_what_the_distance_explains_is_unstable_and_the_rest_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = read_robot(ARM)
    mechanism = mechanism_of(robot)
    states = sample(mechanism, 4, 0)
    truth = ReferenceKernel(mechanism).evaluate(states)
    far = FarLinks(robot)
    # Two of the four disagree, and of these, as of the others, the distance explains one.
    wrong = np.array([True, True, False, False])
    answers = truth.high * np.where(wrong, 1.001, 1.0)[:, None]
    monkeypatch.setattr(far, "explain", lambda *given: np.array([True, False, True, False]))

    def judged(accelerations: np.ndarray) -> tuple[Comparison, list[str]]:
        found = compare(truth, accelerations)
        return found, far.excused(found, truth, states, accelerations).verdicts.tolist()

    assert judged(answers)[1] == [Verdict.UNSTABLE.value, Verdict.DISAGREES.value, Verdict.AGREES.value, Verdict.AGREES.value]
    found, verdicts = judged(truth.high)
    assert verdicts == found.verdicts.tolist() == [Verdict.AGREES.value] * 4


def test_an_error_is_explained_in_proportion_to_mass_and_arm() -> None:
    """One unit roundoff of m r^2 in M; 0.1 % of an acceleration is no rounding."""
    robot = read_robot(ARM)
    mechanism = mechanism_of(robot)
    states = sample(mechanism, 4, 0)
    truth = ReferenceKernel(mechanism).evaluate(states)
    far = FarLinks(robot)
    assert far.masses.shape == far.arms.shape == (mechanism.nv,)
    # Each link of an arm carries those behind it, which are further from the centre of all.
    assert (np.diff(far.masses) < 0).all() and (np.diff(far.arms) > 0).all() and far.arms[0] < 1e-15
    assert far.explain(truth, states, truth.high).all()
    assert not far.explain(truth, states, truth.high * 1.001).any()


def test_what_rates_explain_grows_with_their_square() -> None:
    """Where they are so fast that accelerations and weight are nothing beside them."""
    robot = read_robot(ARM)
    mechanism = mechanism_of(robot)
    states = generic_sample(mechanism, 4, 0)
    truth, far = ReferenceKernel(mechanism).evaluate(states), FarLinks(robot)

    def largest(scale: float) -> np.ndarray:
        """The longest error along the first velocity that is explained, by halving an interval of exponents."""
        faster, low, high = replace(states, v=scale * states.v), np.full(4, -30.0), np.full(4, 30.0)
        for _ in range(40):
            middle = (low + high) / 2
            is_explained = far.explain(truth, faster, truth.high + 10 ** middle[:, None] * np.eye(mechanism.nv)[0])
            low, high = np.where(is_explained, middle, low), np.where(is_explained, high, middle)
        return 10**low

    np.testing.assert_allclose(largest(2e9) / largest(1e9), 4.0, rtol=1e-6)


def test_away_from_the_origin_of_the_world_errors_in_float32_grow_with_the_square_of_the_distance() -> None:
    """Of a body that floats, for an engine that forms inertias about that origin; about the centre of its tree nothing moves away."""
    robot = read_robot(BUILT_IN.model_path("quadrotor", "mjcf"))
    mechanism = mechanism_of(robot)
    states = generic_sample(mechanism, 4, 0)
    near, far = (replace(states, q=np.hstack([distance * np.eye(4)[:, :3], states.q[:, 3:]])) for distance in (1.0, 10.0))
    about_world, about_tree = FarLinks(robot, WORLD, 2.0**-24), FarLinks(robot, TREE, 2.0**-24)

    def explained(links: FarLinks, states: States, error: float) -> bool:
        truth = ReferenceKernel(mechanism).evaluate(states)
        return bool(links.explain(truth, states, truth.high * (1 + error))[:3].all())

    assert about_world.moving == [0, 1, 2] and about_tree.moving == []
    errors = [next(error for error in 10.0 ** -np.arange(0, 16, 0.25) if explained(about_world, one, error)) for one in (near, far)]
    assert 10 < errors[1] / errors[0] <= 200
    assert not explained(about_tree, far, errors[1]) and not explained(FarLinks(robot, WORLD), far, errors[1])
