"""A stronger layer over a stage, by which each tree of its bodies becomes an articulation of PhysX.

An articulation begins with a body that floats, or that a joint to the world fixes where the stage has it, whatever that joint would let it
do and wherever its frames are. A tree that hangs on the world is given a base before that joint. A link hangs by one joint: between several
joints of a body stand bodies of hardly any mass.

Source: ovphysx documentation, Articulations: articulation root.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from pxr import Sdf, Usd, UsdGeom, UsdPhysics

from harness.files.usd import ROOTS

_BASE, _ANCHOR, _BETWEEN = "/harness_base_{}", "/harness_anchor_{}", "/harness_between_{}"
# Far below what float32 feels of a robot [kg, kg m^2].
_HARDLY_ANY = 1e-12


class _TyingJoint(NamedTuple):
    """A joint of an articulation, with the bodies of its ends; None for the world."""

    joint: UsdPhysics.Joint
    ends: tuple[Sdf.Path | None, Sdf.Path | None]


def write_anchored(path: Path, over: Path, floating: Collection[str], has_gravity: bool) -> None:
    """Write the layer ``over`` over the stage at ``path``.

    Args:
        floating: paths of the bodies that float, each the first of its tree.
    """
    below, layer = Usd.Stage.Open(str(path)), Sdf.Layer.CreateNew(str(over))
    layer.subLayerPaths.append(str(path.resolve()))
    stage = Usd.Stage.Open(layer)
    # A stage has these of its strongest layer alone.
    UsdGeom.SetStageUpAxis(stage, UsdGeom.GetStageUpAxis(below))
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.GetStageMetersPerUnit(below))
    UsdPhysics.SetStageKilogramsPerUnit(stage, UsdPhysics.GetStageKilogramsPerUnit(below))
    bodies = [prim.GetPath() for prim in stage.Traverse() if _moves(prim)]
    links = list(_links(stage, {*bodies}))
    for prim in list(stage.Traverse()):
        for schema in ROOTS & {*prim.GetAppliedSchemas(), *prim.GetPrimTypeInfo().GetAppliedAPISchemas()}:
            prim.RemoveAppliedSchema(schema)
    for number, tree in enumerate(_trees(bodies, links)):
        if hanging := [link for link in links if None in link.ends and not tree.isdisjoint(link.ends)]:
            root = _anchored(stage, hanging[0], number)
        else:
            root = stage.GetPrimAtPath(next(body for body in tree if str(body) in floating))
        UsdPhysics.ArticulationRootAPI.Apply(root)
    _split(stage, links)
    for prim in [prim for prim in map(stage.GetPrimAtPath, bodies) if not _weighs(prim)]:
        _weigh(prim, _HARDLY_ANY)
    for scene in [UsdPhysics.Scene(prim) for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene)]:
        # With it, the scene's own gravity is lost: docs/issues/physx-gravity-of-scenes-of-newton.md.
        scene.GetPrim().RemoveAppliedSchema("NewtonSceneAPI")
        if not has_gravity:
            scene.CreateGravityMagnitudeAttr(0.0)
    layer.Save()


def _moves(prim: Usd.Prim) -> bool:
    body = UsdPhysics.RigidBodyAPI(prim)
    return bool(body) and body.GetRigidBodyEnabledAttr().Get() is not False and not body.GetKinematicEnabledAttr().Get()


def _links(stage: Usd.Stage, bodies: Collection[Sdf.Path]) -> Iterator[_TyingJoint]:
    def holder(relation: Usd.Relationship) -> Sdf.Path | None:
        path = next(iter(relation.GetTargets()), Sdf.Path.absoluteRootPath)
        return next((one for one in path.GetAncestorsRange() if one in bodies), None)

    for prim in stage.Traverse():
        joint = UsdPhysics.Joint(prim)
        if joint and joint.GetJointEnabledAttr().Get() is not False and not joint.GetExcludeFromArticulationAttr().Get():
            yield _TyingJoint(joint, (holder(joint.GetBody0Rel()), holder(joint.GetBody1Rel())))


def _trees(bodies: Collection[Sdf.Path], links: Collection[_TyingJoint]) -> list[set[Sdf.Path | None]]:
    """The bodies that joints tie together, in the order of the stage."""
    trees: list[set[Sdf.Path | None]] = [{body} for body in bodies]
    for link in (link for link in links if None not in link.ends):
        first, second = (next(tree for tree in trees if end in tree) for end in link.ends)
        if first is not second:
            first |= second
            trees.remove(second)
    return trees


def _anchored(stage: Usd.Stage, link: _TyingJoint, number: int) -> Usd.Prim:
    """The fixed joint of a base that a joint to the world hangs on from now on."""
    joint, side = link.joint, link.ends.index(None)
    relation = _bodies_of(joint)[side]
    # No acceleration depends on what is fixed.
    base = _body(stage, _BASE.format(number), next(iter(relation.GetTargets()), None), 1.0)
    relation.SetTargets([base])
    anchor = UsdPhysics.FixedJoint.Define(stage, _ANCHOR.format(number))
    anchor.CreateBody1Rel().SetTargets([base])
    return anchor.GetPrim()


def _split(stage: Usd.Stage, links: Collection[_TyingJoint]) -> None:
    """Put a body before each joint but the first of those that lead to one body, in the order of the stage.

    It stands where that body does while all are at zero: there both frames of a joint are one.
    """
    leading: dict[Sdf.Path, _TyingJoint] = {}
    number = 0
    for link in links:
        body = link.ends[1]
        if body in leading and {*leading[body].ends} == {*link.ends}:
            number += 1
            between = _body(stage, _BETWEEN.format(number), body, _HARDLY_ANY)
            before, joint = leading[body].joint, link.joint
            _bodies_of(before)[1].SetTargets([between])
            _bodies_of(joint)[0].SetTargets([between])
            joint.CreateLocalPos0Attr(joint.GetLocalPos1Attr().Get())
            joint.CreateLocalRot0Attr(joint.GetLocalRot1Attr().Get())
        if body is not None:
            leading[body] = link


def _bodies_of(joint: UsdPhysics.Joint) -> tuple[Usd.Relationship, Usd.Relationship]:
    return joint.GetBody0Rel(), joint.GetBody1Rel()


def _body(stage: Usd.Stage, path: str, at: Sdf.Path | None, mass: float) -> Sdf.Path:
    """The path of a new body of so many kg and kg m^2, which stands where the prim ``at`` does, or in the world's origin."""
    body = UsdGeom.Xform.Define(stage, path)
    if at is not None:
        body.AddTransformOp().Set(UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath(at)))
    UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    _weigh(body.GetPrim(), mass)
    return body.GetPath()


def _weigh(body: Usd.Prim, mass: float) -> None:
    weight = UsdPhysics.MassAPI.Apply(body)
    weight.CreateMassAttr(mass)
    weight.CreateDiagonalInertiaAttr((mass, mass, mass))


def _weighs(body: Usd.Prim) -> bool:
    """True for a body with a mass, or with colliders that weigh."""
    if body.HasAPI(UsdPhysics.MassAPI) and (UsdPhysics.MassAPI(body).GetMassAttr().Get() or 0) > 0:
        return True
    # Lazily: what another body holds is that one's.
    parts = iter(Usd.PrimRange(body))
    for part in parts:
        if part != body and part.HasAPI(UsdPhysics.RigidBodyAPI):
            parts.PruneChildren()
        elif part.HasAPI(UsdPhysics.CollisionAPI):
            return True
    return False
