"""The processor's arithmetic: rounding to nearest and gradual underflow, which every certified number assumes.

Any program in this process can change both for all that comes behind it: a library that is linked with -ffast-math does when it is
loaded. What is not the harness's own is called within ``KeptArithmetic``.

Source: ISO C, section 7.6 (fenv.h); Intel 64 and IA-32 Architectures Software Developer's Manual, vol. 1, section 10.2.3 (MXCSR); Arm
Architecture Reference Manual for A-profile, FPCR.
"""

from __future__ import annotations

import ctypes
import functools
import platform
from dataclasses import dataclass
from typing import Any

# What its author does about it.
SAFE_LINKING = "a library that is linked with -ffast-math does that; link it without"
# More than any ``fenv_t`` has.
_MOST_BYTES = 256


@dataclass(frozen=True)
class _ControlWord:
    """The 32-bit word of a ``fenv_t`` that says how floating-point instructions round: its place [bytes] and meaning.

    Attributes:
        flags: bits that any operation may raise. rounding: lowest of the two bits that name the direction, with what all values but 0 say.
        flushing: bits by which subnormal numbers count as zero.
    """

    place: int
    flags: int
    rounding: int
    directions: tuple[str, str, str]
    flushing: int


_X86 = _ControlWord(28, 0x3F, 1 << 13, ("downward", "upward", "toward zero"), 1 << 15 | 1 << 6)
_ARM = _ControlWord(0, 0, 1 << 22, ("upward", "downward", "toward zero"), 1 << 24)
_WORDS = {"x86_64": _X86, "AMD64": _X86, "aarch64": _ARM, "arm64": _ARM}
_LIBRARIES = {"Linux": "libm.so.6", "Darwin": "libSystem.dylib"}


@functools.cache
def _environment() -> tuple[Any, _ControlWord] | None:
    """The C library with ``fegetenv`` and ``fesetenv``, and the control word; None where neither is known."""
    word, name = _WORDS.get(platform.machine()), _LIBRARIES.get(platform.system())
    try:
        return None if word is None or name is None else (ctypes.CDLL(name), word)
    except OSError:
        return None


class KeptArithmetic:
    """A context that ends with the arithmetic that it began with.

    Attributes:
        left: in words, what the arithmetic was otherwise at the end; "" where it was the same, or where it cannot be told.
    """

    left: str = ""

    def __enter__(self) -> KeptArithmetic:
        self._before = ctypes.create_string_buffer(_MOST_BYTES)
        if (known := _environment()) is not None:
            known[0].fegetenv(self._before)
        return self

    def __exit__(self, *exception: object) -> None:
        if (known := _environment()) is None:
            return
        library, word = known
        after = ctypes.create_string_buffer(_MOST_BYTES)
        library.fegetenv(after)
        was, now = (int.from_bytes(bits[word.place : word.place + 4], "little") & ~word.flags for bits in (self._before.raw, after.raw))
        if was != now:
            library.fesetenv(self._before)
            self.left = _in_words(now, word)


def _in_words(control: int, word: _ControlWord) -> str:
    direction = control // word.rounding % 4
    found = [f"rounding {word.directions[direction - 1]}"] if direction else []
    found += ["subnormal numbers flushed to zero"] if control & word.flushing else []
    return " and ".join(found) or "another floating-point environment"
