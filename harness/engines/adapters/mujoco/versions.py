"""Differences between the versions of MuJoCo that the harness knows, from 3.3 on.

Source: MuJoCo's changelog, and the versions themselves.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines import NotOffered, Unsupported
from harness.files.document.xml import parse_document
from harness.files.model_file import ROOT_TAGS, ModelFile

# The first version that knows all that the harness lets stand in a model.
_KNOWS_ALL = (4, 0)
# The first version whose steps are those that ``steps`` declares: RK4 of 3.13 turns free bodies by another rule.
_DECLARES_STEPS = (4, 0)
# Stages that were switched off together, as "passive", before each had a flag, and the attribute of what they compute.
_FLAGS = {"spring": "stiffness", "damper": "damping"}


def release() -> tuple[int, int]:
    """Major and minor version; ``mj_version`` counts 3.9.0 as 390, and 3.12.1 as 3012001."""
    major, minor, *_ = map(int, mujoco.mj_versionString().split("."))
    return major, minor


def batch(model: Any, count: int) -> Any:
    """A ``mujoco.batch.Batch`` of ``count`` states on one thread; for versions without that module, the same by a loop."""
    try:
        import mujoco.batch
    except ModuleNotFoundError:
        return _Loop(model, count)
    return mujoco.batch.Batch(model, nsim=count, nthread=1)


def delete(spec: Any, part: Any) -> None:
    """Take a part out of an ``MjSpec``, which parts did themselves before the spec did."""
    if hasattr(spec, "delete"):
        spec.delete(part)
    else:
        part.delete()


def coefficients(linear: float) -> Any:
    """A stiffness or damping as ``MjSpec`` takes it: the coefficients of a polynomial, and a number before it had these."""
    takes_number = isinstance(mujoco.MjSpec().worldbody.add_body().add_joint().stiffness, float)
    return linear if takes_number else [linear, 0.0, 0.0]


def read_mjcf(file: ModelFile) -> Any:
    """The ``MjModel`` of an MJCF. Versions that have no flags for springs and dampers read it without, where it has none to switch off.

    Raises:
        Unsupported: the file has an element or attribute that this version does not know, and newer ones do.
        ValueError: MuJoCo refuses it. MemoryError: as ``compiling``.
    """
    try:
        with compiling():
            return mujoco.MjModel.from_xml_string(_without_unknown_flags(file))
    except ValueError as error:
        if release() < _KNOWS_ALL and "unrecognized" in str(error):
            raise Unsupported(f"MuJoCo {mujoco.mj_versionString()} reads no such file: {' '.join(str(error).split())}") from error
        raise


@contextmanager
def compiling() -> Iterator[None]:
    """Raises MemoryError where MuJoCo's compiler finds no more memory, which it says by a ValueError as it refuses a file."""
    try:
        yield
    except ValueError as error:
        words = " ".join(str(error).split())
        if "could not allocate memory" in words.lower():
            raise MemoryError(words) from error
        raise


def require_declared_steps() -> None:
    """Raises NotOffered where the rules that are declared for integrators are not of this version."""
    if release() < _DECLARES_STEPS:
        raise NotOffered(f"no rules of integrators are declared for MuJoCo {mujoco.mj_versionString()}")


def stages_off(holds_constraints: bool, acting: Collection[str] = ()) -> int:
    """The bits that switch off all stages but passive forces, the constraints of a file where it holds some, and those of ``acting``."""
    unused = {"contact", "sensor", "autoreset", "actuation", *(("limit", "frictionloss") if holds_constraints else ("constraint",))}
    return sum(int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{stage.upper()}")) for stage in unused.difference(acting))


def inputs_of(model: Any, count: int) -> tuple[Any, Any]:
    """The places of the control and of the activation of each actuator, (count,), -1 for none; each had one control before 4.0."""
    return getattr(model, "actuator_ctrladr", np.arange(count)), model.actuator_actadr


def inputs_in_place(model: Any, count: int, driving: Sequence[Array]) -> list[Array]:
    """Controls and activations, (count, ...) each, in the places of a model; zeros without ``driving``, as of ``EngineQuestion``."""
    found = [np.zeros((count, size)) for size in (model.nu, model.na)]
    for own, given, places in zip(found, driving, inputs_of(model, model.nu), strict=False):
        known = np.flatnonzero(places[: given.shape[1]] >= 0)
        own[:, places[known]] = given[:, known]
    return found


def flag(stage: str) -> int:
    """The bit that switches springs or dampers off, "spring" or "damper"; where they have none, that of both together."""
    flags = mujoco.mjtDisableBit
    return int(getattr(flags, f"mjDSBL_{stage.upper()}", None) or flags.mjDSBL_PASSIVE)


def keep_what_is_on(model: Any) -> None:
    """Have what is switched off of springs and dampers weigh nothing, and both switched on: MJX leaves out both where one is off.

    Source: mujoco/mjx/_src/passive.py, ``passive``; https://github.com/google-deepmind/mujoco/pull/3440.
    """
    flags = mujoco.mjtDisableBit
    for bit, kind in ((flags.mjDSBL_SPRING, "stiffness"), (flags.mjDSBL_DAMPER, "damping")):
        if model.opt.disableflags & bit:
            for owner in ("jnt", "dof", "tendon"):
                if hasattr(model, f"{owner}_{kind}"):
                    getattr(model, f"{owner}_{kind}")[:] = 0.0
            model.opt.disableflags &= ~int(bit)


def _without_unknown_flags(file: ModelFile) -> str:
    unknown = {flag: what for flag, what in _FLAGS.items() if not hasattr(mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}")}
    if not unknown:
        return file.text
    root = parse_document(file.path, file.text, ROOT_TAGS["mjcf"]).root
    for flag, what in unknown.items():
        if not any(what in element.attrib for element in root.iter("*")):
            for element in root.iterfind("option/flag"):
                element.attrib.pop(flag, None)
    return str(etree.tostring(root, encoding="unicode"))


def fill_mass_matrix(model: Any, data: Any, mass: Array) -> None:
    """Write M, (nv, nv), into ``mass``: ``mj_fullM``, which took the sparse matrix before it took the data."""
    try:
        mujoco.mj_fullM(model, data, mass)
    except TypeError:
        mujoco.mj_fullM(model, mass, data.qM)


class _Loop:
    """``mj_forward`` at one state after another, behind the two methods of a batch that the harness calls."""

    def __init__(self, model: Any, count: int) -> None:
        self.nsim = count
        self._model, self._data = model, mujoco.MjData(model)
        self._fields: dict[str, Array] = {}

    def bind(self, name: str) -> Array:
        """The field of ``MjData`` of every state, (count, size)."""
        if name not in self._fields:
            self._fields[name] = np.tile(getattr(self._data, name), (self.nsim, 1))
        return self._fields[name]

    def forward(self) -> None:
        answers = self.bind("qacc")
        inputs = [(getattr(self._data, name), values) for name, values in self._fields.items() if name != "qacc"]
        for state, answer in enumerate(answers):
            for field, values in inputs:
                field[:] = values[state]
            mujoco.mj_forward(self._model, self._data)
            answer[:] = self._data.qacc
