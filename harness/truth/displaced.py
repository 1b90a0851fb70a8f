"""States at which the law of constraints that give is felt, made of others: near closed constraints, off them, and beyond limits.

On the manifold no law is felt but for its impedance at distance 0: what brings a constraint back is zero there. So some of the states
that a declared truth is asked at are moved off it, by amounts that the state's own bits choose: one state is moved alike whoever asks,
alone or among others.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.engines.coordinates import multiplied
from harness.programs.evaluation import values
from harness.programs.mechanisms.mechanism import JACOBIAN, RESIDUAL, Constraints, Mechanism
from harness.programs.states import States
from harness.truth.compare import Flags
from harness.truth.declared import DeclaredMechanism, at_limits
from harness.truth.manifold import closes
from harness.truth.reference import ReferenceKernel

# Exponents of 10 of how far positions are moved [m or rad], or of the width in which an impedance varies; and rates, of their range.
_ANYWHERE, _WITHIN_WIDTH, _OF_RATES = (-7.0, -1.0), (-2.0, 0.5), (-3.0, 0.0)
# And of what rates are slowed to, of their own; and of what is left of rates and accelerations where dry friction gives.
_OF_SLOW_RATES, _OF_HELD = (-5.0, -1.0), (-6.0, -1.0)

# Of the way to closed constraints: steps, the longest [m or rad], singular values that count, and residuals that are none.
_STEPS, _LONGEST, _SINGULAR, _ARRIVED = 40, 0.5, 1e-8, 1e-9
# Limits that a state is beyond at most, and steps there, of which joints of one axis take one.
_MOST_LIMITS, _PRESSES = 3, 8
# Share of states at rest that move beyond limits.
_MOVING = 0.5


def opened(mechanism: DeclaredMechanism, states: States, share: float) -> States:
    """The states, of which a share of those that close the constraints is moved off them; one that is open stays as it is."""
    if not len(states) or not mechanism.laws:
        return states
    return _moved(mechanism, states, closes(mechanism, states, Mechanism.parameters_at(mechanism, states)), share)


def near(mechanism: DeclaredMechanism, states: States) -> States:
    """The states, led to where constraints are closed as far as steps of least length lead there, and moved off by a little of that."""
    constraints = mechanism.constraints
    assert constraints is not None
    at, every = states, np.ones((len(states), len(constraints.rows)))
    for _ in range(_STEPS):
        at, residual, usable = _nearer(mechanism, constraints, at, every, 0.0 * every, _LONGEST)
    arrived = usable & (np.abs(residual).max(axis=1, initial=0.0) <= _ARRIVED)
    q = np.where(arrived[:, None], at.q, states.q)
    return _moved(mechanism, replace(states, q=q), arrived, 1.0)


def pressed(mechanism: DeclaredMechanism, states: States, share: float = 1.0) -> States:
    """The states, a share of them beyond one to three limits that its own bits choose, by a little of what their impedances vary in.

    Half of those at rest move, since at rest no damping of a limit is felt.
    """
    rows = mechanism.softened
    if rows is None or not mechanism.pushing:
        return states
    chosen, depth = np.zeros((2, len(states), len(rows.rows)))
    laws, v, reach = dict(mechanism.laws), states.v.copy(), np.abs(np.array(mechanism.rate_ranges)).max(axis=1)
    for state in range(len(states)):
        random, owners = _random_of(states, state), set[str]()
        if share < 1.0 and not random.random() < share:
            continue
        for _, row in random.permutation(mechanism.pushing)[: random.integers(1, _MOST_LIMITS + 1)]:
            owner = rows.rows[row].rpartition(" limit of ")[2]
            # No state is beyond both ends of one range: pressed there it would come to rest between them.
            if owner in owners:
                continue
            owners.add(owner)
            law = laws[rows.rows[row]]
            beyond = law.impedance.width * 10 ** random.uniform(*_WITHIN_WIDTH) + 10 ** random.uniform(*_ANYWHERE)
            # One that acts ahead does so before its limit too.
            is_ahead = law.stiffness_ahead is not None and random.random() < 0.5
            chosen[state, row], depth[state, row] = 1.0, -beyond if is_ahead else beyond
        if not v[state].any() and random.random() < _MOVING:
            v[state] = 10 ** random.uniform(*_OF_RATES) * reach * random.uniform(-1.0, 1.0, mechanism.nv)
    at = states
    for _ in range(_PRESSES):
        at, _, usable = _nearer(mechanism, rows, at, chosen, -depth, math.inf)
    return replace(states, q=np.where((usable & np.isfinite(at.q).all(axis=1))[:, None], at.q, states.q), v=v)


def felt(mechanism: DeclaredMechanism, states: States, share: float) -> States:
    """The states, a share of them near closed equalities, and a share of all beyond limits; none of that where there is no such."""
    if mechanism.constraints is not None:
        chosen = np.array([_random_of(states, state).random() < share for state in range(len(states))], dtype=np.bool_)
        moved = near(mechanism, states[chosen])
        q, v = states.q.copy(), states.v.copy()
        q[chosen], v[chosen] = moved.q, moved.v
        states = replace(states, q=q, v=v)
    if not mechanism.pushing:
        return states
    found = _off_limits(mechanism, pressed(mechanism, states, share))
    # Far away positions are too coarse for the end of a range.
    coarse = np.asarray(at_limits(mechanism, found).any(axis=1))[:, None]
    return replace(found, q=np.where(coarse, states.q, found.q), v=np.where(coarse, states.v, found.v))


def _off_limits(mechanism: DeclaredMechanism, states: States) -> States:
    """The states, of which those are moved where limits have no law, by amounts that their own bits choose.

    That is where rounding decides whether one pushes, and where a length has no derivative, as the angle of a ball joint that is not
    turned.
    """
    rows = mechanism.softened
    if rows is None or not len(states):
        return states
    chosen, wanted = np.zeros((2, len(states), len(rows.rows)))
    _, _, usable = _nearer(mechanism, rows, states, chosen, wanted, math.inf)
    q = states.q.copy()
    for state in np.flatnonzero(~usable).tolist():
        random = _random_of(states, state)
        q[[state]] = _turned(mechanism, q[[state]], 10 ** random.uniform(*_ANYWHERE) * random.uniform(-1.0, 1.0, (1, mechanism.nv)))
    states = replace(states, q=q)
    chosen[at_limits(mechanism, states)] = 1.0
    for state in np.flatnonzero(chosen.any(axis=1)).tolist():
        random = _random_of(states, state)
        # Joints that follow one another are at their limits together.
        wanted[state] = random.choice((-1.0, 1.0)) * 10 ** random.uniform(*_ANYWHERE)
    moved, _, usable = _nearer(mechanism, rows, states, chosen, wanted, math.inf)
    return replace(states, q=np.where((usable & chosen.any(axis=1))[:, None], moved.q, states.q))


def slowed(mechanism: DeclaredMechanism, states: States) -> States:
    """The states at rates that their own bits choose, down to those that rigid dry friction may end within a step."""
    v = np.array([10 ** _random_of(states, state).uniform(*_OF_SLOW_RATES) * states.v[state] for state in range(len(states))])
    return replace(states, v=v.reshape(states.v.shape))


def held(reference: ReferenceKernel, states: States) -> States:
    """The states at a part of their rates, and under applied forces that leave as much of their accelerations; their own bits choose it.

    Dry friction gives there. Elsewhere it mostly slides, where nothing but its bound is felt.
    """
    left = np.array([10 ** _random_of(states, state).uniform(*_OF_HELD) for state in range(len(states))])[:, None]
    slow = replace(states, v=left * states.v)
    truth = reference.evaluate(slow)
    tau = slow.tau - (1.0 - left) * np.einsum("nki,nkj,nj->ni", truth.norm_factor, truth.norm_factor, truth.high)
    return replace(slow, tau=np.where(np.isfinite(tau), tau, slow.tau))


def _nearer(
    mechanism: DeclaredMechanism, rows: Constraints, at: States, chosen: Array, wanted: Array, longest: float
) -> tuple[States, Array, Flags]:
    """States after a step of least length to where the chosen rows leave what is wanted, (n, rows) both.

    And what they leave before it, and whether that and its Jacobian are finite.
    """
    with np.errstate(all="ignore"):
        found = values(rows.placing, mechanism.inputs(at, Mechanism.parameters_at(mechanism, at)))
        residual, jacobian = found[RESIDUAL].T, found[JACOBIAN].reshape(len(rows.rows), mechanism.nv, -1).transpose(2, 0, 1)
        usable: Flags = np.asarray(np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(residual).all(axis=1))
        inverse = np.linalg.pinv(np.where(usable[:, None, None], chosen[:, :, None] * jacobian, 0.0), rcond=_SINGULAR)
        step = -np.einsum("nij,nj->ni", inverse, np.where(usable[:, None], chosen * (residual - wanted), 0.0))
        length = np.linalg.norm(step, axis=1)
        shorter = np.where(length > longest, longest / length, 1.0)
        return replace(at, q=_turned(mechanism, at.q, step * shorter[:, None])), residual, usable


def _random_of(states: States, state: int) -> np.random.Generator:
    bits = b"".join(part[state].tobytes() for part in (states.q, states.v, states.tau))
    return np.random.default_rng(int.from_bytes(hashlib.blake2b(bits, digest_size=8).digest()))


def _turned(mechanism: Mechanism, q: Array, step: Array) -> Array:
    """Positions (n, nq) after a step along velocities, (n, nv); rotations turn about the body's own axes."""
    found, place = list[Array](), 0
    while place < mechanism.nv:
        first = sum(part.shape[1] for part in found)
        if place not in mechanism.attitudes:
            found.append(q[:, [first]] + step[:, [place]])
            place += 1
            continue
        turn = np.hstack([np.ones((len(q), 1)), step[:, place : place + 3] / 2])
        turned = multiplied(q[:, first : first + 4], turn)
        found.append(turned / np.linalg.norm(turned, axis=1, keepdims=True))
        place += 3
    return np.hstack(found)


def _moved(mechanism: DeclaredMechanism, states: States, chosen: Flags, share: float) -> States:
    """The states, of which a share of the chosen ones is moved by amounts that its own bits choose."""
    q, v = states.q.copy(), states.v.copy()
    reach = np.abs(np.array(mechanism.rate_ranges)).max(axis=1)
    for state in np.flatnonzero(chosen).tolist():
        random = _random_of(states, state)
        if random.random() < share:
            width = random.choice(mechanism.widths or [0.0])
            amount = width * 10 ** random.uniform(*_WITHIN_WIDTH) if width and random.random() < 0.5 else 10 ** random.uniform(*_ANYWHERE)
            q[[state]] = _turned(mechanism, q[[state]], amount * random.uniform(-1.0, 1.0, (1, mechanism.nv)))
            v[state] += 10 ** random.uniform(*_OF_RATES) * reach * random.uniform(-1.0, 1.0, mechanism.nv)
    return replace(states, q=q, v=v)
