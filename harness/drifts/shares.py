"""The division of a gap among its causes, from the motions of a plan."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.comparison.shares import Chosen, EnergyNorm, along, exchanges, leads_through
from harness.drifts.plan import Plan
from harness.engines.coordinates import multiplied
from harness.files.joint_kinds import JointKind
from harness.programs.states import LARGEST_STATE
from harness.results.cause import DriftCause
from harness.results.drift import ENGINE, FELT_ROUNDING, CauseShare, DriftRecord, DriftSide, SideDifference

# A recorded motion: q (k, nq) and v (k, nv).
Track = tuple[Array, Array]
# A motion between both sides breaks down where it is farther or faster than they are by this factor: its integrator is unstable there.
_BREAKS_DOWN = 100.0


def drift_of(
    plan: Plan,
    tracks: Mapping[Chosen, Track],
    own: Track,
    rounded: tuple[Sequence[Track], Sequence[Track]],
    mass: Array,
    about: tuple[tuple[DriftSide, DriftSide], Mapping[DriftCause, Sequence[SideDifference]], list[int]],
) -> DriftRecord:
    """The record of a drift; ``mass`` of the first motion, (k, nv, nv); ``about``: the sides, what differs, and the times that are told.

    Motions between both sides that break down are left out with all orders that come through them. Where no other order is left, and
    where a side breaks down, times from which on that happens are.
    """
    sides, differences, told = about
    motions = [*tracks.values(), own, *rounded[0], *rounded[1]]
    norms = [EnergyNorm(each) for each in mass]
    kept = _kept(plan, tracks, own, norms)
    size = min(_sound(track) for track in (*kept.values(), own, *rounded[0], *rounded[1]))
    origin = tracks[0]
    at = {chosen: displacements(plan.kinds, origin, track)[:size] for chosen, track in kept.items()}
    gap = displacements(plan.kinds, origin, own)[:size]
    norms = norms[:size]
    sizes = np.array([norm.sizes(each) for norm, each in zip(norms, gap, strict=True)]).reshape(size, 2)
    start = tuple(np.tile(each, (size, 1)) for each in (plan.request.q, plan.request.v))
    way = displacements(plan.kinds, (start[0], start[1]), (origin[0][:size], origin[1][:size]))
    noise = np.zeros(size)
    for base, others in zip((origin, own), rounded, strict=True):
        for other in others:
            moved = displacements(plan.kinds, base, other)[:size]
            noise = np.maximum(noise, [norm.sizes(each)[0] for norm, each in zip(norms, moved, strict=True)])
    # What rounding has made once stays possible.
    noise = np.maximum.accumulate(noise)
    # Before a difference acts, as behind the limit of a force, the gap is rounding too.
    clear = noise < FELT_ROUNDING * sizes[:, 0]
    beside = np.flatnonzero(clear | (sizes[:, 0] == 0))
    end = int(beside[-1]) + 1 if len(beside) else 0
    products = np.array([norm.product(each, each) for norm, each in zip(norms, gap, strict=True)]).reshape(size, 2)
    shares = []
    for name, terms in _terms(plan, at, gap).items():
        # (terms, k, 2): scalar products of what an exchange does, or the orders of a pair do, with the gap.
        along_gap = np.array([[norm.product(*each) for norm, *each in zip(norms, term, gap, strict=True)] for _, term in terms])
        along_gap = along_gap.reshape(len(terms), size, 2)
        weights = np.array([weight for weight, _ in terms])
        parts, wholes = _ratio(along_gap, products), _ratio(along_gap[:, clear].sum(axis=1), products[clear].sum(axis=0))
        mean, whole = np.tensordot(weights, parts, 1), weights @ wholes
        positions, velocities = (
            [float(part[half]) if clear[place] and products[place, half] else None for place, part in enumerate(mean)] for half in (0, 1)
        )
        shares.append(
            CauseShare(
                name=name,
                whole=float(whole[0]) if products[clear, 0].any() else None,
                whole_velocities=float(whole[1]) if products[clear, 1].any() else None,
                whole_error=float(_error(plan, wholes[:, 0])),
                positions=positions,
                velocities=velocities,
                error=np.broadcast_to(_error(plan, parts[:, :, 0]), size).tolist(),
                differences=tuple(differences.get(DriftCause(name), ())) if name != ENGINE else (),
            )
        )
    sounds = [_sound(track) for track in (origin, own)]
    broken = [float(plan.times[sound]) if sound < len(plan.times) else None for sound in sounds]
    return DriftRecord(
        first=replace(sides[0], broken=broken[0]),
        second=replace(sides[1], broken=broken[1]),
        joints=list(plan.request.joints),
        times=plan.times[:size].tolist(),
        told=[place for place in told if place < size],
        of_positions=sizes[:, 0].tolist(),
        of_velocities=sizes[:, 1].tolist(),
        moved=[norm.sizes(each)[0] for norm, each in zip(norms, way, strict=True)],
        rounding=noise.tolist(),
        horizon=float(plan.times[end]) if end < size else None,
        shares=tuple(shares),
        motions=len(motions),
        left_out=len(tracks) - len(kept),
        orders=len(plan.orders),
        uncontrolled=plan.uncontrolled,
    )


def _kept(plan: Plan, tracks: Mapping[Chosen, Track], own: Track, norms: Sequence[EnergyNorm]) -> Mapping[Chosen, Track]:
    """The motions through which causes are exchanged."""
    start = tuple(np.tile(each, (len(plan.times), 1)) for each in (plan.request.q, plan.request.v))

    def farthest(track: Track) -> Array:
        """The largest distance from the start, of positions and of velocities."""
        sound = _sound(track)
        moved = displacements(plan.kinds, (start[0][:sound], start[1][:sound]), (track[0][:sound], track[1][:sound]))
        return np.asarray(np.max([norm.sizes(each) for norm, each in zip(norms, moved, strict=False)], axis=0, initial=0.0))

    sides = np.maximum(farthest(tracks[0]), farthest(own))
    lasting = min(_sound(tracks[0]), _sound(own))
    kept = {
        chosen: track
        for chosen, track in tracks.items()
        if chosen in (0, (1 << len(plan.causes)) - 1) or (_sound(track) >= lasting and (farthest(track) <= _BREAKS_DOWN * sides).all())
    }
    passable = any(_passes(kept, order) for order in plan.orders) if plan.orders else leads_through(kept, len(plan.causes))
    return kept if passable else tracks


def _passes(kept: Collection[Chosen], order: Sequence[int]) -> bool:
    return all(chosen in kept for _, chosen in along(order))


def _ratio(parts: Array, whole: Array) -> Array:
    return np.divide(parts, whole, out=np.zeros_like(parts), where=whole > 0)


def _error(plan: Plan, parts: Array) -> Array:
    """Standard error of the mean over pairs of orders; 0 where no order is sampled."""
    sampled = bool(plan.orders) and len(parts) > 1
    return parts.std(axis=0, ddof=1) / np.sqrt(len(parts)) if sampled else np.zeros(parts.shape[1:])


def _terms(plan: Plan, at: Mapping[Chosen, Array], gap: Array) -> dict[str, list[tuple[float, Array]]]:
    """Vectors (k, 2 nv) with weights, whose sum is the share of each cause; of sampled orders, a vector for each pair of orders."""
    count = len(plan.causes)
    if plan.orders:
        sound = ([one for one in plan.orders[place : place + 2] if _passes(at, one)] for place in range(0, len(plan.orders), 2))
        pairs = [pair for pair in sound if pair]
        sampled: list[list[tuple[float, Array]]] = [[] for _ in plan.causes]
        for pair in pairs:
            sums = [np.zeros_like(gap) for _ in plan.causes]
            for order in pair:
                for place, chosen in along(order):
                    sums[place] += (at[chosen | 1 << place] - at[chosen]) / len(pair)
            for place, vector in enumerate(sums):
                sampled[place].append((1 / len(pairs), vector))
        found = dict(zip(plan.causes, sampled, strict=True))
    else:
        found = {cause: exchanges(at, place, count) for place, cause in enumerate(plan.causes)}
    return {**{cause.value: terms for cause, terms in found.items()}, ENGINE: [(1.0, gap - at[(1 << count) - 1])]}


def _sound(track: Track) -> int:
    """Number of recorded times before the motion breaks down."""
    # What is not finite is not less.
    broken = np.flatnonzero(~(np.abs(np.hstack(track)) < LARGEST_STATE).all(axis=1))
    return int(broken[0]) if len(broken) else len(track[0])


def displacements(kinds: Sequence[JointKind], start: Track, end: Track) -> Array:
    """(k, 2 nv) from states to others: of positions, a rotation as its vector in the body's frame, and of velocities."""
    found, place = [], 0
    for kind in kinds:
        nq = kind.positions
        one, other = (track[0][:, place : place + nq] for track in (start, end))
        place += nq
        if kind.has_attitude:
            found += [other[:, :-4] - one[:, :-4], _turns(one[:, -4:], other[:, -4:])]
        else:
            found.append(other - one)
    return np.hstack([*found, end[1] - start[1]])


def _turns(start: Array, end: Array) -> Array:
    """(k, 3) rotation vectors from unit quaternions to others."""
    turn = multiplied(start * [1, -1, -1, -1], end)
    turn *= np.where(turn[:, :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, turn[:, :1])
    return np.asarray(turn[:, 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0))
