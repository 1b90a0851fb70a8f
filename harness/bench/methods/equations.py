"""The equations of motion themselves: SymPy's ``lambdify``, heyoka's machine code and certified balls.

``lambdify`` gets the equations as they are derived, with common subexpressions taken out, which is what a
SymPy user would do; M qdd = f is solved by LAPACK. heyoka compiles the harness's own program with an
unrolled solution. Of constraints it has them in two ways: with the forces by multipliers, and from the reduced equations.

Sources: SymPy documentation, ``lambdify``; Biscani, Izzo, heyoka.py documentation, ``cfunc``; Greenwood, Advanced Dynamics, section
4.3 (Maggi's equations).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from harness.bench.methods import Accelerations, Method, Prepared
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported
from harness.lagrange.derivation import load_system
from harness.library import CONSTRAINED, MECHANISMS
from harness.motion.taylor import named
from harness.programs.kernels import heyoka_expressions, solve_symmetric
from harness.programs.machine_code import load_heyoka
from harness.programs.mechanisms.constraint_forces import ACCELERATIONS, reduced_program
from harness.programs.mechanisms.kernel import Charts
from harness.programs.program import StraightLineProgram, position_count, right_hand_side
from harness.programs.states import States
from harness.truth.quantities.accelerations import reference_kernel

# Python needs minutes to derive and to compile more.
MOST_INSTRUCTIONS_PRINTED = 5000
# A state takes so long that a call's own cost is lost in it.
SLOW = 512
ONE_CHART = "in one chart of Euler angles, which loses digits where it is singular"
REDUCTION = "Maggi's equations, of the coordinates that no constraint determines; heyoka float64 has the forces by multipliers"
SEVERAL_CHARTS = "each state's chart of Euler angles was chosen beforehand"


def _lambdified(scene: Scene, modules: str) -> tuple[Callable[..., Any], str]:
    """A function of q, v, time and parameters that returns the entries of M by rows, then those of p - c - g; and a note."""
    import sympy as sp

    from harness.lagrange.equations import derive
    from harness.lagrange.euler_angles import change_of_variables, equations_in_joints
    from harness.lagrange.system import TIME

    mechanism = scene.mechanism
    instructions = len(mechanism.program.instructions)
    if instructions > MOST_INSTRUCTIONS_PRINTED:
        raise Unsupported(f"the equations take {instructions} operations; lambdify is tried up to {MOST_INSTRUCTIONS_PRINTED}")
    system, _ = load_system(scene.library.system_path(mechanism.name))
    equations = derive(system)
    change = change_of_variables(system, equations)
    terms = equations_in_joints(equations, change)
    # Nested lists would hide the subexpressions from ``cse``.
    arguments = [*change.positions, *equations.rates, TIME, *system.parameters]
    expressions = [*terms["mass"], *right_hand_side(terms)]
    function: Callable[..., Any] = sp.lambdify(arguments, expressions, modules=modules, cse=partial(sp.cse, order="none"))
    return function, ONE_CHART if mechanism.attitudes else ""


def _one_at_a_time(scene: Scene, states: States) -> Prepared:
    evaluate, note = _lambdified(scene, "math")
    parameters = list(scene.mechanism.parameter_values)
    rows = [row + parameters for row in np.hstack([states.q, states.v, states.time[:, None]]).tolist()]
    nv, forces, found = scene.mechanism.nv, states.tau, np.full_like(states.v, np.nan)

    def compute() -> None:
        for state, row in enumerate(rows):
            values = np.array(evaluate(*row))
            found[state] = np.linalg.solve(values[:-nv].reshape(nv, nv), values[-nv:] + forces[state])

    return Prepared(compute, lambda: found, note)


def _batch(scene: Scene, states: States) -> Prepared:
    evaluate, note = _lambdified(scene, "numpy")
    columns = [*np.ascontiguousarray(states.q.T), *np.ascontiguousarray(states.v.T), states.time, *scene.mechanism.parameter_values]
    n, nv = states.v.shape
    values, found = np.empty((n, nv * nv + nv)), np.full((n, nv), np.nan)

    def compute() -> None:
        for place, value in enumerate(evaluate(*columns)):
            values[:, place] = value
        force = values[:, -nv:] + states.tau
        found[:] = np.linalg.solve(values[:, :-nv].reshape(n, nv, nv), force[:, :, None])[:, :, 0]

    return Prepared(compute, lambda: found, note)


def _compiled(program: StraightLineProgram, wanted: Callable[[dict[str, Any], list[Any]], list[Any]], number: type) -> Callable[..., Any]:
    """heyoka's machine code for what is ``wanted`` of the program's outputs and inputs: (n wanted, n) of (number of inputs, n)."""
    inputs = named("z", len(program.inputs))
    function: Callable[..., Any] = load_heyoka().cfunc(wanted(heyoka_expressions(program, inputs), inputs), vars=inputs, fp_type=number)
    return function


def compiled_solution(program: StraightLineProgram, number: type) -> Callable[..., Any]:
    """heyoka's machine code for qdd, (nv, n), of the program's inputs, (number of inputs, n), in the type ``number``."""

    def solution(outputs: dict[str, Any], inputs: list[Any]) -> list[Any]:
        nv = len(outputs["velocity"])
        forces = inputs[position_count(program) + nv :][:nv]
        return solve_symmetric(outputs["mass"], right_hand_side(outputs, forces))

    return _compiled(program, solution, number)


def _machine_code(number: type, scene: Scene, states: States) -> Prepared:
    mechanism = scene.mechanism
    charts = mechanism.charts(linear_velocity_in_body=False)
    inputs = mechanism.inputs(states)
    parts: list[tuple[Any, Callable[..., Any], Accelerations, Accelerations]] = []
    for place, chosen in Charts(charts).split(states.q):
        columns: Accelerations = np.ascontiguousarray(inputs[:, chosen], dtype=number)
        outputs: Accelerations = np.full((mechanism.nv, len(chosen)), np.nan, dtype=number)
        parts.append((chosen, compiled_solution(charts[place], number), columns, outputs))

    def compute() -> None:
        for _, solve, columns, outputs in parts:
            solve(columns, outputs=outputs)

    def accelerations() -> Accelerations:
        found: Accelerations = np.empty((len(states), mechanism.nv), dtype=number)
        for chosen, _, _, outputs in parts:
            found[chosen] = outputs.T
        return found

    return Prepared(compute, accelerations, SEVERAL_CHARTS if len(charts) > 1 else "")


def _reduced(scene: Scene, states: States) -> Prepared:
    mechanism = scene.mechanism
    assert mechanism.constraints is not None
    solve = _compiled(reduced_program(mechanism.constraints), lambda outputs, inputs: outputs[ACCELERATIONS], float)
    columns, outputs = mechanism.inputs(states), np.full(states.v.T.shape, np.nan)
    return Prepared(lambda: solve(columns, outputs=outputs), lambda: outputs.T, REDUCTION)


def _balls(scene: Scene, states: States) -> Prepared:
    kernel = reference_kernel(scene.mechanism, linear_velocity_in_body=False)
    remark = "certified, with its data roundoff; the error is that of rounding to float64"
    return Prepared.keeping(lambda: kernel.evaluate(states), attrgetter("high"), remark)


def _method(name: str, prepare: Callable[[Scene, States], Prepared], loop: str, *of: str, most_states: int | None = None) -> Method:
    return Method(name, "equations", prepare, loop=loop, growth="up to 3", most_states=most_states, of=of)


# Of constraints the equations have the forces, by multipliers.
METHODS = (
    _method("lambdify, one state at a time", _one_at_a_time, "Python", MECHANISMS, most_states=SLOW),
    _method("lambdify, numpy batch", _batch, "NumPy", MECHANISMS),
    _method("heyoka float32", partial(_machine_code, np.float32), "machine code", MECHANISMS, CONSTRAINED),
    _method("heyoka float64", partial(_machine_code, float), "machine code", MECHANISMS, CONSTRAINED),
    _method("heyoka long double", partial(_machine_code, np.longdouble), "machine code", MECHANISMS, CONSTRAINED),
    _method("reduced equations float64", _reduced, "machine code", CONSTRAINED),
    _method("certified balls", _balls, "Python", MECHANISMS, CONSTRAINED, most_states=SLOW),
)
