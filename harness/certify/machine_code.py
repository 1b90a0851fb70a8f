"""The machine code of ``harness.certify.loops``: compiled once for all mechanisms, kept beside heyoka's, and called without numba.

numba compiles without fastmath: nothing is contracted, reassociated or left out, so that a proof about roundings holds for the
machine code. It takes seconds to compile and one to import; what it makes is kept as one object file per loop, which
llvmlite loads in milliseconds. An entry that is damaged is made anew.
"""

from __future__ import annotations

import base64
import ctypes
import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from harness.equations.machine_code import machine_code_directory
from harness.storage import read_entry, sources_digest, write_entry
from harness.version import version_of


@functools.cache
def loop(name: str) -> Callable[..., None]:
    """A loop of ``harness.certify.loops.intermediate_representation``, for numbers and contiguous arrays, whose types it trusts."""
    symbol, _, text = (kept(name) or _compiled(name)).partition("\n")
    address = _engine(name, base64.b64decode(text)).get_function_address(symbol)
    function = ctypes.CFUNCTYPE(None)(address)

    def call(*arguments: Any) -> None:
        function(*(_argument(argument) for argument in arguments))

    return call


def _argument(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return ctypes.c_void_p(value.ctypes.data)
    return ctypes.c_double(value) if isinstance(value, float) else ctypes.c_int64(value)


def _entry(name: str) -> Path:
    binding = _binding()
    machine = f"{binding.get_default_triple()} {binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}"
    digest = hashlib.sha256(sources_digest("certify") + f"{machine} {version_of('numba')} {version_of('llvmlite')}".encode())
    return machine_code_directory() / f"{name}-{digest.hexdigest()[:32]}.txt"


def kept(name: str) -> str | None:
    """The name of a loop's machine code, and behind it the object file, as the cache has them; None where it does not."""
    return read_entry(_entry(name))


def _compiled(name: str) -> str:
    """What ``kept`` gives, made anew and kept."""
    from harness.certify.loops import intermediate_representation

    symbol, text = intermediate_representation(name)
    made = f"{symbol}\n{base64.b64encode(_target().emit_object(_binding().parse_assembly(text))).decode()}"
    write_entry(_entry(name), made)
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
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=3, codemodel="jitdefault", jit=True
    )


@functools.cache
def _engine(name: str, machine_code: bytes) -> Any:
    """An engine that holds an object file, and lives as long as the process."""
    binding = _binding()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _target())
    engine.add_object_file(binding.ObjectFileRef.from_data(machine_code))
    # numba's own runtime is named by the code for exceptions and for arrays that it allocates: there are none.
    abort = ctypes.cast(ctypes.CDLL(None).abort, ctypes.c_void_p).value
    for symbol in ABSENT:
        if binding.address_of_symbol(symbol) is None:
            binding.add_symbol(symbol, abort)
    engine.finalize_object()
    return engine


ABSENT = (
    "numba_gil_ensure", "numba_gil_release", "numba_unpickle", "numba_runtime_build_excinfo_struct", "numba_do_raise", "NRT_Free",
    "NRT_MemInfo_call_dtor",
)  # fmt: skip
