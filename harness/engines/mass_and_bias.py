"""Accelerations of engines that give a mass matrix and bias forces, and leave the equations of motion to their callers.

M qdd + bias = tau + springs and dampers is solved by a factorisation of M. What an engine gives stands in the harness's order and
axes when it comes here. ``FloatingBase`` is for engines all of whose models have a base that floats: a model that hangs on the
world is the rows of its joints; one on a ball joint, those and the base's rotation.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines import LoadedModel, Terms, Unsupported
from harness.engines.rotations import BALL, FREE, Columns, cross_matrix, rotation
from harness.engines.supplied_forces import SuppliedForces
from harness.files.tree import WORLD
from harness.models.model_file import ROOT_TAGS, ModelFile
from harness.models.xml import describe, literal_tag, parse_document


class MassAndBias:
    """A loaded model of such an engine. What begins with an underscore and is abstract is the engine's part."""

    factorises_mass_matrix = True

    def __init__(self, file: ModelFile, columns: Columns) -> None:
        self.columns = columns
        self.supplied = SuppliedForces(file, columns)

    @abstractmethod
    def loaded(self) -> LoadedModel:
        """See ``harness.engines.Model``."""

    @abstractmethod
    def _go_to(self, q: Array, v: Array) -> None:
        """Take one state."""

    @abstractmethod
    def _mass(self) -> Array:
        """M, (nv, nv), without what the file's reflected inertias add."""

    @abstractmethod
    def _bias(self) -> Array:
        """(nv,) [N or N m]: what tau has to be so that no acceleration results."""

    @abstractmethod
    def _parts_of_bias(self) -> tuple[Array, Array]:
        """The two terms of it, of velocity and of gravity, neither of them as what is left of a difference."""

    @abstractmethod
    def _link(self, body: str) -> tuple[Array, Array, Array]:
        """A link: the rotation of its frame to the world (3, 3), its origin (3,), and the Jacobian (6, nv) of the origin's velocity and
        the angular velocity, along the world's axes."""

    def _point(self, body: str, local: Array) -> tuple[Array, Array]:
        if body == WORLD:
            return local, np.zeros((3, self.columns.nv))
        turn, origin, jacobian = self._link(body)
        arm = turn @ local
        return origin + arm, jacobian[:3] - cross_matrix(arm) @ jacobian[3:]

    def _passive(self, q: Array, v: Array) -> Array:
        return self.supplied.at(q, v, self._point)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        answer = np.empty(v.shape)
        for state, (position, velocity, force) in enumerate(zip(q, v, tau, strict=True)):
            self._go_to(position, velocity)
            right = force + self._passive(position, velocity) - self._bias()
            try:
                answer[state] = np.linalg.solve(self._mass() + np.diag(self.supplied.armature), right)
            except np.linalg.LinAlgError:
                answer[state] = np.nan
        return answer

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        """The terms that ``forward_dynamics`` solves with; passive is what the harness supplies."""
        mass, (velocity, gravity, passive) = np.empty((*v.shape, v.shape[1])), np.empty((3, *v.shape))
        for state, (position, rate) in enumerate(zip(q, v, strict=True)):
            self._go_to(position, rate)
            mass[state] = self._mass() + np.diag(self.supplied.armature)
            passive[state] = self._passive(position, rate)
            velocity[state], gravity[state] = self._parts_of_bias()
        return Terms(mass, velocity, gravity, passive, tau.copy())


class FloatingBase(MassAndBias):
    """A model of a URDF whose base floats in the engine; its velocities are the base's, along the world's axes, then the joints'.

    Attributes:
        places: the engine's first column of each joint: those of one degree of freedom stand behind the six of the base.
    """

    def __init__(self, file: ModelFile, joints: Sequence[str], root: str | None, own_joints: Sequence[str]) -> None:
        sizes = dict.fromkeys(joints, (1, 1)) | ({} if root is None else {root: BALL if root == file.ball_joint else FREE})
        super().__init__(file, Columns(joints, sizes))
        self._root = root
        self.places = {name: 6 + number for number, name in enumerate(own_joints)}
        if root is not None:
            self.places[root] = 3 if self.columns.sizes[root] == BALL else 0
        self.base, self.base_velocity = np.eye(4), np.zeros(6)
        self.positions, self.velocities = np.zeros(len(own_joints)), np.zeros(len(own_joints))
        self._turn = np.zeros((self.columns.nv, 6 + len(own_joints)))

    @abstractmethod
    def _take(self) -> None:
        """Take ``base``, ``base_velocity``, ``positions`` and ``velocities``."""

    @abstractmethod
    def _mass_matrix(self) -> Array:
        """(6 + n, 6 + n), in the engine's order."""

    @abstractmethod
    def _bias_forces(self) -> Array:
        """(6 + n,), in the engine's order."""

    @abstractmethod
    def _velocity_and_gravity(self) -> tuple[Array, Array]:
        """The parts of the bias forces, each (6 + n,)."""

    @abstractmethod
    def _frame(self, body: str) -> tuple[Array, Array]:
        """The pose (4, 4) of a link and its Jacobian (6, 6 + n) along the world's axes."""

    def _go_to(self, q: Array, v: Array) -> None:
        for name in self.columns.sizes:
            given = q[self.columns.spans(name)[0]]
            if name == self._root:
                self.base[:3, :3] = rotation(given[-4:])
                self.base[:3, 3] = given[:-4] if len(given) > 4 else 0.0
            else:
                self.positions[self.places[name] - 6] = given[0]
        self._turn = self.columns.turn(q, self.places, 6 + len(self.positions), rotation_first=False)
        own = v @ self._turn
        self.base_velocity, self.velocities = own[:6], own[6:]
        self._take()

    def _mass(self) -> Array:
        return np.asarray(self._turn @ self._mass_matrix() @ self._turn.T)

    def _bias(self) -> Array:
        return np.asarray(self._turn @ self._bias_forces())

    def _parts_of_bias(self) -> tuple[Array, Array]:
        velocity, gravity = self._velocity_and_gravity()
        return self._turn @ velocity, self._turn @ gravity

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        pose, jacobian = self._frame(body)
        return pose[:3, :3], pose[:3, 3], jacobian @ self._turn.T


def take_root_off(file: ModelFile, engine: str) -> tuple[str, str | None]:
    """The text of a URDF without a free or ball joint from the world to its root link, and without that world; and the joint's name.

    Raises:
        Unsupported: constraints, and joints that such an engine does not have.
    """
    if file.constraints:
        shown = "; ".join(f"line {one.line}: {one.kind} constraint {one.name!r}" for one in file.constraints)
        raise Unsupported(f"{engine} reads no constraints and couples no joints: {shown}")
    document = parse_document(file.path, file.text, ROOT_TAGS["urdf"])
    root = document.root
    carried = {joint.find("child").get("link") for joint in root.iterfind("joint")}
    name: str | None = None
    for joint in list(root.iterfind("joint")):
        kind, parent, origin = joint.get("type"), joint.find("parent").get("link"), joint.find("origin")
        moved = origin is not None and any(float(word) for text in origin.attrib.values() for word in text.split())
        alone = len(root.findall(f"joint/parent[@link='{parent}']")) == 1
        if kind == "floating" and parent == WORLD and parent not in carried and alone and not moved:
            name = str(joint.get("name"))
            (world,) = (link for link in root.iterfind("link") if link.get("name") == WORLD)
            root.remove(joint)
            root.remove(world)
        elif kind not in ("fixed", "revolute", "continuous", "prismatic"):
            raise Unsupported(f"line {document.lines[joint]}: {describe(joint)} is {kind}, which {engine} has at the root of a model alone")
    for joint in [element for element in root.iterchildren("*") if literal_tag(element) == "drake:joint"]:
        name = str(joint.get("name"))
        root.remove(joint)
    return (file.text if name is None else etree.tostring(root, encoding="unicode")), name


def moving_mass(file: ModelFile, root: str | None, masses: dict[str, float]) -> float:
    """The mass of the links that move, of the engine's ``masses`` by link [kg]: those behind a joint that is not fixed."""
    document = parse_document(file.path, file.text, ROOT_TAGS["urdf"])
    fixed = {joint.find("child").get("link"): joint.find("parent").get("link") for joint in document.root.iterfind("joint[@type='fixed']")}
    still = {link.get("name") for link in document.root.iterfind("link")} if root is None else set[str]()
    still -= {joint.find("child").get("link") for joint in document.root.iterfind("joint")}

    def moves(link: str) -> bool:
        while link in fixed:
            link = fixed[link]
        return link not in still

    return sum(mass for link, mass in masses.items() if moves(link))
