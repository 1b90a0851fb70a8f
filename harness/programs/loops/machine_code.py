"""The machine code of ``harness.programs.loops.loops`` and ``harness.programs.loops.closing``, compiled once for all mechanisms.

It is kept beside heyoka's, and loaded in milliseconds. Compiling takes a third of a second for each of the two, of which trees need the
first alone; the object file that is kept belongs to one processor and one version of LLVM. An entry that is damaged is made anew.
"""

from __future__ import annotations

import base64
import ctypes
import functools
import hashlib
import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.programs.machine_code import machine_code_directory
from harness.storage import read_entry, sources_digest, write_entry
from harness.version import version_of

if TYPE_CHECKING:
    from harness.programs.loops.language import Writer

# LLVM's passes that make the loops faster, none of which changes a rounding. Its own pipeline leaves them no faster and takes four
# times as long, as it unrolls loops whose bodies hold hundreds of instructions.
_PASSES = ("sroa", "new_gvn", "instruction_combine", "simplify_cfg")
# Of the processor's instructions.
_LEVEL = 2


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
