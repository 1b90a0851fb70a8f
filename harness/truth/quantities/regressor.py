"""The joint torque regressor: the derivatives of inverse dynamics by ten inertial parameters of each body.

It holds no inertia: geometry, positions and motion are all that it takes. The parameters are those of the file that the engine reads,
about its own anchors and along its own axes, so that each reader is asked about the numbers of its file.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.engines import Model, NotOffered, answer_of
from harness.trees.quantities.regressor import PARAMETERS, carrying_joints, regressor
from harness.truth.quantities import Quantity, Truth, TruthBasis
from harness.truth.quantities._file_truth import AskedMotion, FileTruth


def _truth(basis: TruthBasis) -> Truth:
    mechanism, read = basis.mechanism, basis.read
    if mechanism.constraints is not None:
        raise NotOffered("the applied forces of a mechanism under constraints are not determined by its accelerations")
    carrying = carrying_joints(basis.robot_of(read).tree, tuple(dict.fromkeys(mechanism.joints)))

    def answers(model: Model, asked: AskedMotion) -> Array:
        shape = (len(asked.q), asked.v.shape[1], len(asked.joints), len(PARAMETERS))
        found = answer_of(model, "regressor", (asked.q, asked.v, asked.qdd), shape)
        return np.ascontiguousarray(found[:, :, [asked.joints.index(name) for name in carrying]].transpose(0, 2, 3, 1))

    return FileTruth(replace(basis, declared=read), regressor, answers)


# To write and to compile its programs takes seconds.
REGRESSOR = Quantity("regressor", _truth, is_quick=False)
