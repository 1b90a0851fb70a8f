"""The inverse weights by which MuJoCo scales soft constraints, from a model file alone: diagonals of J M^-1 J' in its zero position.

There every joint has its reference, so that every body stands where its pose says. Everything is evaluated in balls.

Source: MuJoCo documentation, Computation, section Parameters; MuJoCo 4.0, engine_setconst.c (set0), for the means that are taken.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from harness.files.equalities import Polygon, Tendon, TendonLinkage
from harness.files.model_file import ModelFile, document_of
from harness.files.rules import InverseWeight
from harness.files.tree import WORLD, Body, Tree
from harness.programs.evaluation import mass_matrix
from harness.programs.terms import Term, Vector, cross
from harness.storage import Kept
from harness.trees import recursion
from harness.trees.bodies.inertias import bounded
from harness.trees.bodies.rigid import Rigid, Spatial, joined, spatial
from harness.trees.bodies.spatial import placed, unit
from harness.trees.nodes import standing
from harness.trees.robot import tree_of
from harness.trees.row import Row, jacobian_of
from harness.trees.rows import untied
from harness.trees.world_motion import World, in_world

_BITS = 192


def inverse_weights(model: ModelFile, wanted: Iterable[InverseWeight]) -> dict[InverseWeight, float]:
    """Each inverse weight, rounded once [1/kg, or 1/(kg m^2)]; 0 for what no joint moves.

    Raises:
        InvalidModel: as ``read_robot``. ValueError: the zero position has no inverse of M.
    """
    tendons = (tendon for one in model.constraints if isinstance(one.says, TendonLinkage) for tendon in one.says.tendons)
    # Gravity has no part in it.
    return inverse_weights_of(tree_of(model, 0.0), wanted, _fuses(model), tendons)


def inverse_weights_of(
    tree: Tree, wanted: Iterable[InverseWeight], fuses: bool, tendons: Iterable[Tendon] = ()
) -> dict[InverseWeight, float]:
    """Those of a tree of bodies; ``fuses`` says whether an engine makes bodies that no joint moves one with their parents.

    Raises:
        ValueError: as ``inverse_weights``.
    """
    wanted = list(dict.fromkeys(wanted))
    # A tree that touches in many ways is asked about the same bodies each time, and a file that a campaign changes about its constraints
    # by each law in turn.
    world, known = _KNOWN.get((tree, fuses), lambda: (_standing(tree), {}))
    missing = [one for one in wanted if one.kind == "tendon" or one not in known]
    if missing:
        known |= _worked_out(_AtZero(world, fuses, {one.name: one for one in tendons}), missing)
    return {one: known[one] for one in wanted}


_KNOWN: Kept[tuple[World, dict[InverseWeight, float]]] = Kept(16)


def _standing(tree: Tree) -> World:
    """The motion of a tree in its zero position."""
    tree = replace(tree := bounded(tree), bodies=tuple(map(_where_it_starts, tree.bodies)))
    return in_world(standing(untied(tree, [joint.name for joint in tree.joints])))


def _worked_out(at_zero: _AtZero, wanted: Sequence[InverseWeight]) -> dict[InverseWeight, float]:
    import flint

    nodes = at_zero.world.kinematics
    bodies = {body.name: body for body in nodes.tree.bodies}
    outputs: dict[str, Iterable[Term]] = {"mass": recursion.mass_matrix(nodes)}
    for number, one in enumerate(wanted):
        outputs[str(number)] = [at_zero.rigid(bodies[one.of]).mass] if one.kind == "mass" else at_zero.jacobian(one)
    with flint.ctx.workprec(_BITS):
        found = nodes.builder.evaluated(outputs, _BITS)
        mass = mass_matrix(found["mass"], nodes.nv)
        weights = {}
        for number, one in enumerate(wanted):
            own = found[str(number)]
            weights[one] = float(1 / own[0]) if one.kind == "mass" else _mean_diagonal(mass, own)
        return weights


def _where_it_starts(body: Body) -> Body:
    """A body on a free joint with the pose that the file gives it, which in any other position has no part."""
    return replace(body, pose=body.start, start=()) if body.start else body


@dataclass(frozen=True)
class _AtZero:
    """One tree in its zero position; ``fuses`` as of ``inverse_weights_of``."""

    world: World
    fuses: bool
    tendons: Mapping[str, Tendon]

    def jacobian(self, wanted: InverseWeight) -> list[Term]:
        """The rows of J of an inverse weight, one after another."""
        return [entry for row in self._rows(wanted) for entry in jacobian_of(self.world, row)]

    def _rows(self, wanted: InverseWeight) -> list[Row]:
        builder, nodes = self.world.kinematics.builder, self.world.kinematics
        if wanted.kind == "tendon":
            return [self._tendon(self.tendons[wanted.of])]
        if wanted.kind in ("joint", "turn"):
            # Of a free joint the translations, as those of its first velocity.
            columns = nodes.coordinates.columns[wanted.of][:3] if wanted.kind == "joint" else nodes.coordinates.columns[wanted.of][-3:]
            return [self._row(columns=[(column, builder.one)]) for column in columns]
        if wanted.kind == "rotation":
            return [self._row([(nodes.frames[wanted.of][0], spatial(axis, builder.still))]) for axis in builder.identity]
        centre = builder.still
        if nodes.frames[wanted.of][0] >= 0:
            centre = self._position(wanted.of) if wanted.kind == "position" else self._centre(wanted.of)
        return [self._row([self._force(wanted.of, centre, axis)]) for axis in builder.identity]

    def _row(self, acts: Iterable[tuple[int, Spatial]] = (), columns: Iterable[tuple[int, Term]] = ()) -> Row:
        zero = self.world.kinematics.builder.zero
        return Row("", zero, zero, tuple(one for one in acts if one[0] >= 0), tuple(columns))

    def _force(self, body: str, point: Vector, force: Vector) -> tuple[int, Spatial]:
        """A force at a point of a body, on the node that moves it."""
        number, _ = self.world.kinematics.frames[body]
        arm = point if number < 0 else point - self.world.moving[number].position
        return number, spatial(cross(arm, force), force)

    def rigid(self, body: Body) -> Rigid:
        """A body about the world's origin."""
        frame, nodes = self.world.frame_of(body.name), self.world.kinematics
        return joined(nodes.builder, (part.moved(frame) for part in nodes.weights.parts(body)))

    def _centre(self, name: str) -> Vector:
        """The centre of mass of a body with all that an engine makes one with it."""
        tree, carriers = self.world.kinematics.tree, {WORLD: WORLD}
        for body in tree.bodies:
            carriers[body.name] = carriers[body.parent] if self.fuses and not body.joints else body.name
        bodies = [body for body in tree.bodies if carriers[body.name] == carriers[name]]
        if all(body.is_massless for body in bodies):
            return self.world.frame_of(name).shift
        whole = joined(self.world.kinematics.builder, map(self.rigid, bodies))
        return whole.first / whole.mass

    def _position(self, name: str) -> Vector:
        """The point that the position of a body in its parent is in its own frame."""
        kinematics = self.world.kinematics
        [body] = [one for one in kinematics.tree.bodies if one.name == name]
        return placed(kinematics.builder, body.pose[-1:], self.world.frame_of(name)).shift

    def _tendon(self, tendon: Tendon) -> Row:
        nodes, builder = self.world.kinematics, self.world.kinematics.builder
        if not isinstance(tendon, Polygon):
            return self._row(columns=((nodes.coordinates.columns[name][0], builder.number(multiple)) for name, multiple in tendon.terms))
        places = [(body, placed(builder, pose, self.world.frame_of(body)).shift) for body, pose in tendon.points]
        acts = []
        for (first, start), (second, end) in itertools.pairwise(places):
            along = unit(end - start)
            acts += [self._force(second, end, along), self._force(first, start, -along)]
        return self._row(acts)


def _fuses(model: ModelFile) -> bool:
    """True where MuJoCo makes bodies that no joint moves one with their parents; in a URDF with constraints it is told not to."""
    if model.format == "urdf":
        return False
    root = document_of(model).root
    return [compiler.get("fusestatic") for compiler in root.iterfind("compiler[@fusestatic]")][-1:] == ["true"]


def _mean_diagonal(mass: Any, entries: list[Any]) -> float:
    """The mean of the diagonal of J M^-1 J', J by rows in ``entries``."""
    import flint

    size = mass.nrows()
    jacobian = flint.arb_mat(len(entries) // size, size, entries)
    try:
        weights = jacobian * mass.solve(jacobian.transpose())
    except ZeroDivisionError:
        raise ValueError("the mass matrix has no inverse in the zero position of the model") from None
    return float(sum((weights[i, i] for i in range(weights.nrows())), flint.arb(0)) / weights.nrows())
