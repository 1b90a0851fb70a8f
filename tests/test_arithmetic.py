"""Arithmetic of the process: changed rounding is told in words and restored, and costs the engine that leaves it behind its own record."""

from __future__ import annotations

import ctypes
import math
import platform
import sys
from pathlib import Path

import pytest
from support import harness, make_library, records_of

from harness import arithmetic
from harness.arithmetic import KeptArithmetic

# Of ``fesetround``.
DOWNWARD, UPWARD, TOWARD_ZERO = (0x400, 0x800, 0xC00) if platform.machine() in {"x86_64", "AMD64"} else (0x800000, 0x400000, 0xC00000)
WORDS = {DOWNWARD: "rounding downward", UPWARD: "rounding upward", TOWARD_ZERO: "rounding toward zero"}
LIBRARY = {"linux": "libm.so.6", "darwin": "libSystem.dylib"}[sys.platform]
ROUND = f"ctypes.CDLL({LIBRARY!r}).fesetround({{}})"
# An engine of a bar pendulum, right but for what it leaves behind.
ENGINE = """
import ctypes
import sys

import numpy as np

from harness.engines import Engine

{at_import}


class Own(Engine):
    formats = ("equations",)
    requires = ("numpy", "numpy")

    def load(self, source, joints, gravity):
        {at_load}
        return Model(source.float64())


class Model:
    def __init__(self, kernel):
        self.kernel = kernel

    def loaded(self):
        return None

    def forward_dynamics(self, q, v, tau):
        found = self.kernel.accelerations(q, v, tau)
        {at_call}
        return found


ENGINE = Own()
"""


def engine(**places: str) -> str:
    return ENGINE.format(**{"at_import": "", "at_load": "pass", "at_call": "pass"} | places)


@pytest.mark.parametrize("direction", WORDS)
def test_a_direction_of_rounding_is_told_and_restored(direction: int) -> None:
    with KeptArithmetic() as arithmetic:
        ctypes.CDLL(LIBRARY).fesetround(direction)
    assert arithmetic.left == WORDS[direction]
    assert ctypes.CDLL(LIBRARY).fegetround() == 0 and 1.0 + 2.0**-53 == 1.0


def test_what_is_flushed_to_zero_is_told_and_restored() -> None:
    with KeptArithmetic() as arithmetic:
        flush_to_zero()
    assert arithmetic.left == "subnormal numbers flushed to zero"
    assert sys.float_info.min / 2 > 0.0


def flush_to_zero() -> None:
    is_x86 = platform.machine() in {"x86_64", "AMD64"}
    library, state = ctypes.CDLL(LIBRARY), ctypes.create_string_buffer(256)
    library.fegetenv(state)
    place, flag = (28, 1 << 15) if is_x86 else (0, 1 << 24)
    word = int.from_bytes(state[place : place + 4], "little") | flag
    state[place : place + 4] = word.to_bytes(4, "little")
    library.fesetenv(state)


def test_operations_that_raise_flags_change_nothing() -> None:
    with KeptArithmetic() as arithmetic:
        assert math.isinf(1e308 * float("1e10")) and 1.0 / 3.0 and math.exp(-800.0) == 0.0
    assert arithmetic.left == ""


@pytest.mark.ci
@pytest.mark.parametrize(("place", "said"), [("at_import", "aaa.py: leaves"), ("at_load", "loading it leaves"), ("at_call", "leaves")])
def test_who_leaves_other_rounding_behind_loses_the_own_record_alone(tmp_path: Path, place: str, said: str) -> None:
    planted = engine(**{place: ROUND.format(UPWARD)})
    verdicts, messages = checked(tmp_path, {"aaa": planted})
    alone, _ = checked(tmp_path / "alone", {})
    assert verdicts.pop("aaa") == ("error", None)
    assert said in messages["aaa"] and "rounding upward" in messages["aaa"]
    assert verdicts == alone


def test_a_system_file_that_leaves_other_rounding_behind_is_refused(tmp_path: Path) -> None:
    library = make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"])
    file = library / "systems" / "bar_pendulum.py"
    file.write_text(f"import ctypes\n{file.read_text()}\n{ROUND.format(UPWARD)}\n")
    records = tmp_path / "records.json"
    done = harness("check", "--library", str(library), "--states", "40", "--quantity", "accelerations", "--json", str(records))
    assert done.returncode == 2
    assert f"{file}: leaves rounding upward for everything behind it in the process" in done.stderr
    assert {one["verdict"] for one in records_of(records) if one["system"] == "spring_damper"} == {"agrees"}


@pytest.mark.ci
def test_who_wraps_angles_in_place_changes_no_input_of_another(tmp_path: Path) -> None:
    planted = engine(at_call="np.remainder(q, 2 * np.pi, out=q); v[:] = 1e9; tau[:] = -1e9")
    verdicts, _ = checked(tmp_path, {"aaa": planted})
    alone, _ = checked(tmp_path / "alone", {})
    assert verdicts.pop("aaa") == verdicts["lagrange"]
    assert verdicts == alone


def checked(folder: Path, engines: dict[str, str]) -> tuple[dict[str, tuple[str, float | None]], dict[str, str]]:
    """Verdict and worst error of each subject of a bar pendulum, which are asked after one another in this process; and messages."""
    library = make_library(folder / "library", ["bar_pendulum"], engines)
    records = folder / "records.json"
    harness("check", "bar_pendulum", "--library", str(library), "--states", "64", "--quantity", "accelerations", "--json", str(records))
    found = records_of(records)
    return (
        {one["subject"]: (one["verdict"], one["backward_error"]) for one in found},
        {one["subject"]: one["message"] for one in found},
    )


@pytest.mark.parametrize(("machine", "library"), [("riscv64", LIBRARY), (platform.machine(), "no_such_library.so")])
def test_where_the_control_word_is_not_known_nothing_is_told(machine: str, library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    known = arithmetic._environment()
    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(arithmetic, "_LIBRARIES", {platform.system(): library})
    monkeypatch.setattr(arithmetic, "_environment", arithmetic._environment.__wrapped__)
    with KeptArithmetic() as kept:
        assert known is not None and arithmetic._environment() is None
    assert kept.left == ""
