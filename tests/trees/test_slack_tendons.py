"""Springs of tendons that are slack between two lengths, and the springlength that is none."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from support_robots import by_mujoco

from harness.errors import InvalidModel
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

SLIDING = """<mujoco><option gravity="0 0 0"/><worldbody><site name="hook"/>
<body name="mass"><joint name="along" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<site name="tip" pos="1 0 0"/></body></worldbody><tendon>{}</tendon></mujoco>"""
SPATIAL = '<spatial stiffness="6" springlength="0.5 1.5"><site site="hook"/><site site="tip"/></spatial>'
FIXED = '<fixed stiffness="6" springlength="-0.5 0.5"><joint joint="along" coef="1"/></fixed>'
# Stretches by 0.5 m of the position 1, shortened by 0.25 m at -0.75, and slack between, ends included.
POSITIONS, EXPECTED = [1.0, 0.5, 0.25, 0.0, -0.5, -0.75], [-1.5, 0.0, 0.0, 0.0, 0.0, 0.75]


def written(folder: Path, tendon: str) -> Path:
    path = folder / "sliding.xml"
    path.write_text(SLIDING.format(tendon))
    return path


@pytest.mark.parametrize("tendon", [SPATIAL, FIXED])
def test_a_spring_acts_beyond_either_length_and_not_between(tmp_path: Path, tendon: str) -> None:
    mechanism = mechanism_of(read_robot(written(tmp_path, tendon)))
    still = np.zeros((len(POSITIONS), 1))
    found = ReferenceKernel(mechanism).evaluate(States.at(np.array(POSITIONS)[:, None], still, still))
    assert np.abs(found.high[:, 0] - EXPECTED).max() < 1e-15
    # At the ends half an ulp more stretches it.
    assert (found.sensitivity[[1, 4]] > 0).all()


@pytest.mark.parametrize("tendon", [SPATIAL, FIXED, FIXED.replace("-0.5 0.5", "-0.5"), FIXED.replace("-0.5 0.5", "-0.99999")])
def test_mujoco_has_the_law(tmp_path: Path, tendon: str) -> None:
    """A negative length is one of a sum of positions, but for -1, which stands for what the joints' springs say."""
    path = written(tmp_path, tendon)
    path.write_text(path.read_text().replace('gravity="0 0 0"', 'gravity="1 0 -2"'))
    mechanism = mechanism_of(read_robot(path))
    states, model = generic_sample(mechanism, 64, 3), mujoco.MjModel.from_xml_path(str(path))
    reference = ReferenceKernel(mechanism).evaluate(states)
    assert reference.certified.all()
    assert compare(reference, by_mujoco(model, states)).backward_error.max() < AGREEMENT
    model.tendon_lengthspring += 1e-9
    assert compare(reference, by_mujoco(model, states)).backward_error.max() > AGREEMENT


def test_lengths_out_of_order_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidModel, match=r"springlength 1\.5 0\.5; expected the shorter one first"):
        read_robot(written(tmp_path, SPATIAL.replace("0.5 1.5", "1.5 0.5")))
