"""Accelerations with a proven bound of their error, and their sensitivity, by one compiled loop over a program's instructions.

The loops are compiled once for all mechanisms, kept beside heyoka's machine code, and loaded in milliseconds. Compiling takes a third of a
second for each of the two modules, of which trees need ``loops`` alone; the object file that is kept belongs to one processor and one
version of LLVM. An entry that is damaged is made anew.

Proofs and sources: docs/inside/numerics.md, "Accelerations".
"""

from __future__ import annotations

import base64
import ctypes
import functools
import hashlib
import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array, Indices, Rows
from harness.programs.loops.encoding import Encoded, EncodedProgram, encode, encode_program
from harness.programs.numbers import LANES
from harness.programs.program import StraightLineProgram
from harness.storage import Kept, machine_code_directory, read_entry, sources_digest, write_entry
from harness.version import version_of

if TYPE_CHECKING:
    from harness.programs.loops.language import Writer

# LLVM's passes that make the loops faster, none of which changes a rounding. Its own pipeline leaves them no faster and takes four
# times as long, as it unrolls loops whose bodies hold hundreds of instructions.
_PASSES = ("sroa", "new_gvn", "instruction_combine", "simplify_cfg")
# Of the processor's instructions.
_LEVEL = 2


@dataclass(frozen=True)
class Filtered(Rows):
    """Results of the loop at n states.

    Attributes:
        high, low: (n, nv); the accelerations are high + low. radius: (n, nv) bounds of their errors; infinite or NaN for none.
        scale: (n, nv), factor: (n, nv, nv); M = diag(scale) L L' diag(scale) in float64. NaN where M has no factor.
        terms: (n, 3, nv) velocity, gravity and passive forces.
        sensitivity: (n,) sum over inputs z of |dqdd/dz z|_M. doubt: (n,) a bound of its error.
        spread: (n,) a bound of a further error, over the sensitivity times the root of the condition number of M scaled.
    """

    high: Array
    low: Array
    radius: Array
    scale: Array
    factor: Array
    terms: Array
    sensitivity: Array
    doubt: Array
    spread: Array


@dataclass(frozen=True)
class Norms(Rows):
    """Norms of n states in the metric of M.

    Attributes:
        norm_factor: (n, nv, nv) upper triangular R with |x|_M = |R x|. condition: (n,) of M scaled to unit diagonal.
        radius: (n,) of the errors' bounds. motion, instability: (n,) see ``harness.truth.reference.Reference``.
    """

    norm_factor: Array
    condition: Array
    radius: Array
    motion: Array
    instability: Array


def evaluate(program: Encoded, inputs: Array, scales: Array) -> Filtered:
    """Everything at ``inputs``, (n, number of inputs), whose changes for the sensitivity are ``scales`` of the same shape."""
    n, nv = len(inputs), program.force.size
    blocks = -(-n // LANES)
    solution, radius, scale, factor, terms, sensitivity, doubt, spread = (
        np.empty((blocks, *shape, LANES)) for shape in ((nv, 2), (nv,), (nv,), (nv, nv), (3, nv), (), (), ())
    )
    weights, work = np.zeros((nv + 2, _whole(nv))), np.zeros((7, nv + 3, nv + 3, LANES))
    loop("evaluate")(
        *_program(n, program), program.mass, int(program.has_system), program.terms, program.gamma, in_lanes(inputs), solution, radius,
        scale, factor, terms, work, spread, in_lanes(scales), sensitivity, doubt, weights,
    )  # fmt: skip
    accelerations = by_state(solution, n)
    rest = (by_state(found, n) for found in (radius, scale, factor, terms, sensitivity, doubt, spread))
    return Filtered(np.ascontiguousarray(accelerations[..., 0]), np.ascontiguousarray(accelerations[..., 1]), *rest)


@dataclass(frozen=True)
class Bounded(Rows):
    """Numbers that are within ``bound`` of high + low, (n, numbers) each; NaN or infinite bounds are none."""

    high: Array
    low: Array
    bound: Array

    def of(self, numbers: slice) -> Bounded:
        """The same of some of the numbers."""
        return Bounded(self.high[:, numbers], self.low[:, numbers], self.bound[:, numbers])

    @property
    def reach(self) -> Array:
        """(n, numbers) within what of ``high`` they are."""
        return np.asarray((np.abs(self.low) + self.bound) * (1 + 1e-10))

    @property
    def is_nearest(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(n, numbers) whether ``high`` is proved to be the float64 number nearest to each."""
        # Half the gap to the next number towards zero, which is never the wider one.
        half = np.spacing(np.nextafter(np.abs(self.high), 0.0)) / 2
        exact = np.isfinite(self.high) & (self.low == 0) & (self.bound == 0)
        with np.errstate(all="ignore"):
            return np.asarray((self.reach < half) | exact)


# Programs of one file with other numbers are the same.
_ENCODED: Kept[Encoded | None] = Kept(16)
_ENCODED_PROGRAMS: Kept[tuple[EncodedProgram, dict[str, Indices]] | None] = Kept(64)


def encoded(program: StraightLineProgram) -> Encoded | None:
    """As of ``encoding.encode``."""
    return _ENCODED.get(program.key, lambda: encode(program))


def solutions(program: Encoded, inputs: Array) -> Bounded:
    """The accelerations of ``evaluate`` alone, for inputs (number of inputs, n)."""
    n, nv = inputs.shape[1], program.force.size
    blocks = -(-n // LANES)
    solution, radius = np.empty((blocks, nv, 2, LANES)), np.empty((blocks, nv, LANES))
    loop("solve", "sides")(
        n, len(program.instructions), program.inputs, len(program.constants), nv, program.instructions, program.constants,
        np.zeros((program.places, 3, LANES)), program.system, program.force, in_lanes(inputs.T), np.zeros((7, nv + 3, nv + 3, LANES)),
        solution, radius,
    )  # fmt: skip
    found = by_state(solution, n)
    return Bounded(*(np.ascontiguousarray(one) for one in (found[..., 0], found[..., 1], by_state(radius, n))))


def bounded_outputs(program: StraightLineProgram, inputs: Array, bounds: Array | None = None) -> Bounded | None:
    """The outputs of a program one after the other, for inputs, (number of inputs, n), exact or within ``bounds`` of the same shape.

    None where the program holds a function that the loops have no code for.
    """
    found = _outputs("outputs", program, 3, inputs, np.zeros_like(inputs) if bounds is None else bounds)
    return None if found is None else Bounded(*(np.ascontiguousarray(found[..., part]) for part in range(3)))


def moved_outputs(program: StraightLineProgram, inputs: Array, scales: Array) -> tuple[Array, Array] | None:
    """Outputs in float64, and how far they move, as of ``evaluation.values_and_spread``, (n, outputs) each; None as of ``bounded_outputs``.

    NaN where an angle is too large for the loops.
    """
    found = _outputs("spread", program, 2, inputs, scales)
    return None if found is None else (found[..., 0], found[..., 1])


def approximate_outputs(program: StraightLineProgram, inputs: Array) -> dict[str, Array] | None:
    """The outputs by their names, (outputs of that name, n), in float64, to some units in the last place of what they are made of."""
    found = _outputs("values", program, 1, inputs)
    if found is None:
        return None
    ends = np.cumsum([len(indices) for indices in program.outputs.values()])[:-1]
    return dict(zip(program.outputs, np.split(found[..., 0].T, ends), strict=True))


def _outputs(name: str, program: StraightLineProgram, width: int, *rows: Array) -> Array | None:
    """Numbers that a loop gives of each output, (n, outputs, width), for rows of inputs, (number of inputs, n) each."""
    written = _ENCODED_PROGRAMS.get(program.key, lambda: encode_program(program))
    if written is None:
        return None
    encoded, places = written[0], np.concatenate(list(written[1].values()))
    n = rows[0].shape[1]
    found = np.empty((-(-n // LANES), len(places), width, LANES))
    loop(name, "loops" if name == "outputs" else "sides")(
        n, len(encoded.instructions), encoded.inputs, len(encoded.constants), len(places), encoded.instructions, encoded.constants,
        np.zeros((encoded.places, width, LANES)), places, found, *(in_lanes(one.T) for one in rows),
    )  # fmt: skip
    return by_state(found, n)


def derivatives(program: Encoded, inputs: Array, accelerations: Array, scale: Array | None = None) -> tuple[Array, Array]:
    """d(f - M a)/dz, (n, nv, number of inputs), at accelerations a, (n, nv), held fixed; and (n, number of inputs) how large it is.

    With ``scale``, (n, nv), the vector of what the derivatives by one input, each over its scale, are wrong by is at most
    ``Encoded.gamma`` times as long as that is large.
    """
    n, nv = len(inputs), program.force.size
    found, scale = np.zeros((n, program.inputs, nv + 1)), np.ones((n, nv)) if scale is None else scale
    loop("derive")(*_program(n, program), in_lanes(inputs), in_lanes(accelerations), in_lanes(scale), found)
    return found[:, :, :-1].transpose(0, 2, 1), found[:, :, -1]


def measure(scale: Array, factor: Array, vectors: Sequence[Array], rotating: Array, roundings: float) -> Norms:
    """Norms for M = diag(scale) L L' diag(scale), (n, nv) and (n, nv, nv).

    ``vectors`` are those whose norms are taken: accelerations, radii and velocities, (n, nv) each, and the separate forces, (n, 4, nv).
    ``rotating``, (nv,), is 1 for the coordinates that take part in ``Norms.motion``; ``roundings`` is a factor of the instability.
    """
    n, nv = scale.shape
    norm_factor = np.empty((n, nv, nv))
    condition, radius, motion, instability = (np.empty(_whole(n)) for _ in range(4))
    columns = np.zeros((nv + 1, _whole(nv), LANES))
    given = (np.ascontiguousarray(values) for values in (scale, factor, *vectors, rotating))
    loop("measure")(
        n, nv, roundings, *given, norm_factor, condition, radius, motion, instability, np.zeros((nv, nv)), np.zeros((2, nv)), columns
    )  # fmt: skip
    return Norms(norm_factor, *(one[:n] for one in (condition, radius, motion, instability)))


def _program(n: int, program: Encoded) -> tuple[object, ...]:
    """The arguments of a loop over n states that are of its program: sizes, the program, and room for the results at four states."""
    nv, rows = program.force.size, int(program.rows.max()) + 1
    room = np.zeros((program.places, 3, LANES)), np.zeros((rows, _whole(nv))), np.zeros(rows)
    sizes = n, len(program.instructions), nv, program.inputs, len(program.constants)
    return *sizes, program.instructions, program.constants, program.system, program.force, program.rows, *room


def in_lanes(rows: Array) -> Array:
    """Rows of states, (n, k), as four states side by side, (blocks, k, lanes); the last state fills up the last block."""
    if len(rows) % LANES:
        rows = np.concatenate([rows, np.repeat(rows[-1:], LANES - len(rows) % LANES, axis=0)])
    return np.ascontiguousarray(rows.reshape(-1, LANES, rows.shape[1]).transpose(0, 2, 1))


def by_state(found: Array, n: int) -> Array:
    """Results of the loop with a state in each lane, (blocks, ..., lanes), by states, (n, ...)."""
    return np.ascontiguousarray(np.moveaxis(found, -1, 1).reshape(len(found) * LANES, *found.shape[1:-1])[:n])


def _whole(count: int) -> int:
    """Numbers of as many whole vectors of the processor as hold ``count``."""
    return -(-count // LANES) * LANES


@functools.cache
def loop(name: str, module: str = "loops") -> Callable[..., None]:
    """One of ``LOOPS`` of a module, for numbers and contiguous arrays in the order of its signature, whose types it trusts."""
    return _callable(_loops(module), name)


def compiled(write: Callable[[Writer], None], signature: Mapping[str, str]) -> Callable[..., None]:
    """A function of one's own, for arguments like those of ``loop``; it is not kept."""
    from harness.programs.loops.language import module_of

    return _callable(_engine(_object_file(module_of({"function": (write, signature)}))), "function")


def _callable(engine: Any, name: str) -> Callable[..., None]:
    function = ctypes.CFUNCTYPE(None)(engine.get_function_address(name))

    def call(*arguments: Any) -> None:
        # The engine holds the machine code.
        assert engine
        function(*(_argument(argument) for argument in arguments))

    return call


def _argument(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return ctypes.c_void_p(value.ctypes.data)
    return ctypes.c_double(value) if isinstance(value, float) else ctypes.c_int64(value)


def _entry(module: str) -> Path:
    binding = _binding()
    machine = f"{binding.get_default_triple()} {binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}"
    digest = hashlib.sha256(sources_digest("programs") + f"{machine} {version_of('llvmlite')}".encode())
    return machine_code_directory() / f"certify-{module}-{digest.hexdigest()[:32]}.txt"


def kept(module: str = "loops") -> str | None:
    """The object file of a module's loops in base 64, as the cache has it; None where it does not."""
    return read_entry(_entry(module))


def _object_file(text: str) -> bytes:
    """The machine code of a module of LLVM's."""
    binding, target = _binding(), _target()
    module = binding.parse_assembly(text)
    module.verify()
    passes = binding.create_new_module_pass_manager()
    for name in _PASSES:
        getattr(passes, f"add_{name}_pass")()
    passes.run(module, binding.create_pass_builder(target, binding.create_pipeline_tuning_options()))
    made: bytes = target.emit_object(module)
    return made


@functools.cache
def _binding() -> Any:
    import llvmlite.binding as binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding


def _target() -> Any:
    binding = _binding()
    target = binding.Target.from_default_triple()
    return target.create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=_LEVEL, codemodel="jitdefault", jit=True
    )


def _engine(machine_code: bytes) -> Any:
    """An engine that holds an object file."""
    binding = _binding()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _target())
    engine.add_object_file(binding.ObjectFileRef.from_data(machine_code))
    engine.finalize_object()
    return engine


@functools.cache
def _loops(module: str) -> Any:
    """The engine of a module's loops, as they are kept or made anew."""
    text = kept(module)
    if text is None:
        from harness.programs.loops.language import module_of

        written = importlib.import_module(f"harness.programs.loops.{module}")
        text = base64.b64encode(_object_file(module_of(written.LOOPS, written.PARTS))).decode()
        write_entry(_entry(module), text)
    return _engine(base64.b64decode(text))
