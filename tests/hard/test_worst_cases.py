"""Reproducers run with nothing but the engine, and print what the engine answers in the harness beside the certified value."""

from __future__ import annotations

import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue import CALLED_HERE
from studies import assignment_of

from harness.crosscheck.assignment import Assignment, load_audited, reference_kernel_of
from harness.files.model_file import parse_model
from harness.files.text.scan import compact
from harness.hard.worst_cases import reproduce
from harness.truth.sampling import generic_sample

# One of each kind of model: hinges, a written family, a ball joint, a free joint, springs between points, springs in joints.
PAIRS = [
    ("arm_2r", "mujoco/mjcf"),
    ("chain_3", "mujoco/mjcf"),
    ("heavy_top", "mujoco/mjcf"),
    ("collar", "mujoco/mjcf"),
    ("chain_3", "pinocchio/urdf"),
    ("heavy_top", "pinocchio/urdf"),
    ("free_body", "pinocchio/urdf"),
    ("collar", "pinocchio/urdf"),
    ("heavy_top", "mujoco/urdf"),
    ("collar", "mujoco/urdf"),
    ("tora", "mujoco/urdf"),
    ("stanford_arm", "pinocchio/mjcf"),
    ("spring_pendulum", "pinocchio/mjcf"),
    ("free_body", "pinocchio/mjcf"),
]


def run(program: str, folder: Path) -> tuple[list[float], list[float], list[str]]:
    """The two lists a program prints, and the modules it has loaded."""
    text = program + "import sys; print(sorted(name for name in sys.modules if '.' not in name))\n"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60, check=True, cwd=folder)
    engine, certified, modules = map(ast.literal_eval, done.stdout.splitlines())
    return engine, certified, modules


def in_engines_order(assignment: Assignment, values: Any) -> list[float]:
    model: Any = load_audited(replace(assignment, library=CALLED_HERE))
    ordered = np.zeros(len(values))
    ordered[model.addresses[1]] = values
    return [float(value) for value in ordered]


@pytest.mark.ci
@pytest.mark.parametrize(("name", "subject"), PAIRS)
def test_a_reproducer_prints_both_values_with_the_engine_alone(name: str, subject: str, tmp_path: Path) -> None:
    assignment = assignment_of(name, subject)
    state = generic_sample(assignment.mechanism, 3, 5)[2:]
    program = reproduce(assignment, state)
    assert len(program.splitlines()) == 3
    engine, certified, modules = run(program, tmp_path)
    answer = load_audited(assignment).forward_dynamics(state.q, state.v, state.tau)[0]
    assert engine == in_engines_order(assignment, answer)
    assert certified == in_engines_order(assignment, reference_kernel_of(assignment).evaluate(state).high[0])
    others = {"harness", "sympy", "heyoka", "flint", *({"mujoco", "pinocchio"} - {assignment.subject.engine})}
    assert not others & set(modules)


@pytest.mark.ci
def test_a_wrong_model_is_reproduced_as_wrong(tmp_path: Path) -> None:
    """The program holds the model that was compared, not the library's."""
    right = assignment_of("arm_2r", "mujoco/mjcf")
    assert right.model is not None
    text = right.model.text.replace('"0.22 0 0"', '"0.221 0 0"')
    assert text != right.model.text
    wrong = replace(right, model=parse_model(right.model.path, text, "mjcf"))
    engine, certified, _ = run(reproduce(wrong, generic_sample(right.mechanism, 1, 6)), tmp_path)
    assert np.abs(np.array(engine) / certified - 1).max() > 1e-5


def test_equations_have_no_reproducer() -> None:
    assignment = assignment_of("arm_2r", "lagrange")
    assert reproduce(assignment, generic_sample(assignment.mechanism, 1, 0)) == ""


def test_a_compact_model_keeps_every_number() -> None:
    text = '<!-- a\n > b -->\n<mujoco>\n  <body pos="0 0\n  0.1"/> <!-- c --> <x/>\n</mujoco>\n'
    assert compact(text) == '<mujoco><body pos="0 0 0.1"/><x/></mujoco>'
