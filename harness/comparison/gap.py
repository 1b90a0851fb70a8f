"""The gap between two computed motions, and what each cause has in it.

Proofs and sources: docs/inside/numerics.md, "The gap between two motions".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.shares import EnergyNorm, exchanges
from harness.engines.coordinates import multiplied
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import AskedJoint, by_joint, in_columns
from harness.engines.tree_request import asked_joints
from harness.errors import InvalidRequest
from harness.files.rules import StepRule
from harness.files.tree import Tree
from harness.programs.evaluation import values
from harness.programs.program import upper_triangle
from harness.results.gap import DYNAMICS, INTEGRATOR, STEP, Gap, Mover, Share
from harness.trees.recursion import StepForces
from harness.trees.steps import DeclaredMotion

CAUSES = (DYNAMICS, INTEGRATOR, STEP)
# Bits of what is worked out of ends: more than any end is known to.
_BITS = 4096


@dataclass(frozen=True, eq=False)
class Motion:
    """One of the two motions.

    Attributes:
        forces: of the equations; v and q as those of the other. rule: with its step length. mover: as the record has it.
        q, v: where the engine ended, (nq,) and (nv,).
    """

    forces: StepForces
    rule: StepRule
    mover: Mover
    q: Array
    v: Array


# Positions and velocities as ``arb``.
End = tuple[Sequence[Any], Sequence[Any]]


def gap_of(first: Motion, second: Motion, q: Array, v: Array, attitudes: Sequence[int]) -> Gap:
    """The gap between two motions from q (nq,) and v (nv,), and its shares; ``attitudes`` as of ``steps_program``.

    Raises:
        ValueError: a declared motion is not certain.
    """
    import flint

    ends: dict[tuple[Any, ...], End] = {}

    def end(chosen: Sequence[Motion]) -> End:
        """The declared end with equations, integrator and step of these motions."""
        of_forces, of_rule, of_length = chosen
        rule = replace(of_rule.rule, length=of_length.rule.length)
        steps = of_length.mover.steps
        key = of_forces.forces.program.key, of_forces.forces.parameters, rule, steps
        if key not in ends:
            ends[key] = DeclaredMotion(of_forces.forces, attitudes, rule).end(q.tolist(), v.tolist(), steps)
        return ends[key]

    origin = end((first,) * 3)
    with flint.ctx.workprec(_BITS):

        def coordinates(of: End) -> Array:
            return np.array([*_displacement(origin[0], of[0], attitudes), *(a - b for a, b in zip(of[1], origin[1], strict=True))])

        subsets = range(1 << len(CAUSES))
        at = {bits: coordinates(end([second if bits >> place & 1 else first for place in range(len(CAUSES))])) for bits in subsets}
        reached = [coordinates(([*map(flint.arb, motion.q.tolist())], [*map(flint.arb, motion.v.tolist())])) for motion in (first, second)]
        terms = {
            cause: [(weight, _floats(change)) for weight, change in exchanges(at, place, len(CAUSES))] for place, cause in enumerate(CAUSES)
        }
        rounding = [_floats(-reached[0]), _floats(reached[1] - at[subsets[-1]])]
        gap = _floats(reached[1] - reached[0])
        travelled = _floats(-coordinates((q.tolist(), v.tolist())))
    norm = _norm(first, [float(ball) for ball in origin[0]], len(v))
    found = []
    for cause, weighted in terms.items():
        mean = np.sum([weight * change for weight, change in weighted], axis=0)
        found.append(_share(norm, cause, mean, gap, [change for _, change in weighted]))
    found += [_share(norm, f"{which} engine beside its rule", part, gap) for which, part in zip(("first", "second"), rounding, strict=True)]
    speed = norm.sizes(np.concatenate([np.zeros(len(v)), [float(ball) for ball in origin[1]]]))[1]
    of_positions, of_velocities = norm.sizes(gap)
    return Gap(
        first=first.mover,
        second=second.mover,
        start={"q": q.tolist(), "v": v.tolist()},
        of_positions=of_positions,
        of_velocities=of_velocities,
        moved=norm.sizes(travelled)[0],
        speed=speed,
        shares=tuple(found),
    )


def _floats(balls: Array) -> Array:
    return np.array([float(ball) for ball in balls])


def _displacement(start: Sequence[Any], end: Sequence[Any], attitudes: Sequence[int]) -> list[Any]:
    """The tangent vector, (nv,), from positions to others: a rotation as its vector in the body's frame."""
    found: list[Any] = []
    place = 0
    while place < len(start):
        if len(found) in attitudes:
            found += _turn(start[place : place + 4], end[place : place + 4])
            place += 4
        else:
            found.append(end[place] - start[place])
            place += 1
    return found


def _turn(start: Sequence[Any], end: Sequence[Any]) -> list[Any]:
    import flint

    (w, *a), (u, *b) = ([flint.arb(x) for x in quaternion] for quaternion in (start, end))
    scalar = w * u + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    crossed = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    vector = [w * y - u * x - z for x, y, z in zip(a, b, crossed, strict=True)]
    square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    if square.contains(0):
        return [2 * x / scalar for x in vector]
    sine = square.sqrt()
    sign = 1 if scalar > 0 else -1
    factor = 2 * sign * flint.arb.atan2(sine, sign * scalar) / sine
    return [factor * x for x in vector]


def _norm(motion: Motion, q: Sequence[float], nv: int) -> EnergyNorm:
    """The norm at the end of a motion."""
    inputs = [*q, *[0.0] * (2 * nv + 1), *map(float, motion.forces.parameters)]
    entries = values(motion.forces.program, np.array(inputs)[:, None])["mass"][:, 0]
    mass = np.zeros((nv, nv))
    for (i, j), entry in zip(upper_triangle(nv), entries, strict=True):
        mass[i, j] = mass[j, i] = entry
    return EnergyNorm(mass)


def _share(norm: EnergyNorm, name: str, vector: Array, gap: Array, alternatives: Sequence[Array] = ()) -> Share:
    """The part of a vector along the gap; ``alternatives`` stand for the same in other orders."""
    parts = [norm.part(of, gap) for of in (vector, *alternatives)]
    (positions, velocities), (of_positions, of_velocities) = parts[0].tolist(), norm.sizes(vector)
    return Share(
        name=name,
        positions=positions,
        velocities=velocities,
        of_positions=of_positions,
        of_velocities=of_velocities,
        by_order=float(np.ptp(parts[1:], axis=0).max()) if alternatives else 0.0,
    )


# Steps from an engine's accelerations

LENGTH = 0.002
_HALF = Fraction(1, 2)
EULER = StepRule("Euler", LENGTH)
RUNGE_KUTTA = StepRule(
    "RK4",
    LENGTH,
    stages=((_HALF,), (Fraction(0), _HALF), (Fraction(0), Fraction(0), Fraction(1))),
    weights=(Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6)),
)
OWN_RULES = (EULER, RUNGE_KUTTA)


def advanced(loaded: LoadedFile, joints: Sequence[AskedJoint], q: Array, v: Array, rule: StepRule, steps: int) -> tuple[Array, Array]:
    """q (nq,) and v (nv,) over ``joints`` after so many steps by a rule of ``OWN_RULES``, without applied forces.

    Raises:
        ValueError: the rule has stages, and a joint turns about a point.
    """
    if rule.stages and any(joint.kind.has_attitude for joint in joints):
        raise ValueError(f"{rule.name} of one's own is written for hinges and slides alone")
    accelerate = _accelerations_of(loaded, joints)
    for _ in range(steps):
        if rule.stages:
            q, v = _runge_kutta(accelerate, q, v, rule)
        else:
            v = v + rule.length * accelerate(q, v)
            q = _moved(joints, q, rule.length * v)
    return q, v


def in_their_order(
    names: Sequence[str], joints: Sequence[AskedJoint], start: tuple[Array, Array], move: Callable[[Array, Array], tuple[Array, Array]]
) -> tuple[Array, Array]:
    """States, (..., nq) and (..., nv), over joints in the order of ``names``, that ``move`` makes of one over ``joints``."""
    by_name = {joint.name: joint for joint in joints}
    own = {joint.name: joint for joint in in_columns([by_name[name] for name in names])}
    places = [[place for joint in joints for place in getattr(own[joint.name], part)] for part in ("positions", "velocities")]
    found = []
    for part, moved in zip(places, move(start[0][places[0]], start[1][places[1]]), strict=True):
        ordered = np.empty_like(moved)
        ordered[..., part] = moved
        found.append(ordered)
    return found[0], found[1]


def refuse_own_frames(path: Path, tree: Tree) -> None:
    """Raises InvalidRequest of a tree whose free joint is not measured in the world."""
    if not all(joint.is_measured_in_the_world for joint in asked_joints(tree)):
        raise InvalidRequest(f"{path.name} measures a free joint in a frame of its own; put it into the world")


def _accelerations_of(loaded: LoadedFile, joints: Sequence[AskedJoint]) -> Callable[[Array, Array], Array]:
    def accelerations(q: Array, v: Array) -> Array:
        found = by_joint(loaded.joints, loaded.forward_dynamics(q[None], v[None], np.zeros((1, len(v)))))
        return np.concatenate([found[joint.name][0] for joint in joints])

    return accelerations


def _runge_kutta(accelerate: Callable[[Array, Array], Array], q: Array, v: Array, rule: StepRule) -> tuple[Array, Array]:
    rates, accelerations = [v], [accelerate(q, v)]
    for weights in rule.stages:
        at_q, at_v = (start + rule.length * _mixed(weights, slopes) for start, slopes in ((q, rates), (v, accelerations)))
        rates.append(at_v)
        accelerations.append(accelerate(at_q, at_v))
    return q + rule.length * _mixed(rule.weights, rates), v + rule.length * _mixed(rule.weights, accelerations)


def _mixed(weights: Sequence[Fraction], vectors: Sequence[Array]) -> Array:
    return np.asarray(sum(float(weight) * vector for weight, vector in zip(weights, vectors, strict=True)))


def _moved(joints: Sequence[AskedJoint], q: Array, way: Array) -> Array:
    """Positions after a way along the velocities: a rotation turns about the body's axes."""
    found = q.copy()
    for joint in joints:
        positions, velocities = list(joint.positions), list(joint.velocities)
        if joint.kind.has_attitude:
            half = way[velocities[-3:]] / 2
            angle = np.linalg.norm(half)
            turn = np.array([np.cos(angle), *(half * np.sinc(angle / np.pi))])
            found[positions[-4:]] = multiplied(q[positions[-4:]], turn)
            positions, velocities = positions[:-4], velocities[:-3]
        found[positions] += way[velocities]
    return found
