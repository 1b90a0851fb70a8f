"""Engines as strangers write them by accident: each costs its own record at most, and every other one stays as it is to the last bit."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from support import engine_source, harness, make_library, records_of

# The bar of ``bar_pendulum``: inertia about the pin, weight times distance, damping of the pin.
RIGHT = "(tau - 0.3 * v - 2.0 * 9.81 * 0.75 * np.sin(q)) / 1.625"
ANSWER = f"return {RIGHT}"
ANOTHER_ROUNDING = "ctypes.CDLL(None).fesetround(0x800 if os.uname().machine == 'x86_64' else 0x400000)"


def own(answer: str = ANSWER, top: str = "") -> str:
    """An engine file, its answer a body of any number of lines."""
    return engine_source(answer.replace("\n", "\n        "), top)


# Source of each, its verdict, and words of its record.
LATER = """
def later():
    time.sleep(0.001)
    for x in (q, v, tau):
        x[:] = 1.0
threading.Thread(target=later).start()
return found
"""
MUTE = """
class Mute(Exception):
    def __str__(self):
        raise KeyError("gone")
raise Mute
"""
FORK = """
if not os.path.exists(mark):
    open(mark, "w").close()
    if os.fork() == 0:
        os._exit(0)
"""
STRANGERS = {
    "wraps_in_place": (own(f"np.remainder(q, 2 * np.pi, out=q)\n{ANSWER}"), "agrees", ""),
    "overwrites": (own(f"found = {RIGHT}\nq[:], v[:], tau[:] = 1.0, 1.0, 1.0\nreturn found"), "agrees", ""),
    "computes_in_float32": (
        own(f"q, v, tau = (x.astype(np.float32) for x in (q, v, tau))\nreturn ({RIGHT}).astype(float)"),
        "disagrees",
        "",
    ),
    "sets_numpy": (own(top="np.seterr(divide='raise'); np.random.seed(0); np.set_printoptions(precision=2)"), "agrees", ""),
    "patches_einsum": (own(top="np.einsum = lambda *arguments, **options: 0.0"), "agrees", ""),
    "patches_norms": (own(f"np.linalg.solve = np.linalg.norm = np.dot = None\n{ANSWER}"), "agrees", ""),
    "lowers_recursion": (own(f"sys.setrecursionlimit(60)\n{ANSWER}"), "agrees", ""),
    "empties_path": (own(top="sys.path.clear()"), "agrees", ""),
    "empties_modules": (
        own(f"sys.modules.pop('harness.truth.compare', None); sys.modules.pop('numpy.linalg', None)\n{ANSWER}"),
        "agrees",
        "",
    ),
    "takes_descriptors": (own(top="import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (8, 8))"), "agrees", ""),
    "rounds_upward": (own(f"{ANOTHER_ROUNDING}\n{ANSWER}"), "error", "forward_dynamics leaves rounding upward"),
    "raises_without_words": (own(MUTE), "error", "Mute: its message cannot be had: str() raises KeyError"),
    "keeps_its_buffer": (own(f"buffer[: len(q)] = {RIGHT}\nreturn buffer[: len(q)]", "buffer = np.empty((10000, 1))"), "agrees", ""),
    "goes_on_in_a_thread": (own(f"found = {RIGHT}{LATER}", "import threading"), "agrees", ""),
    "moves_away": (own(top="os.chdir('/'); os.environ.clear()"), "agrees", ""),
    "ignores_signals": (own(top="import gc, signal; gc.disable(); signal.signal(signal.SIGTERM, signal.SIG_IGN)"), "agrees", ""),
    "forks_once": (own(f"{FORK}{ANSWER}", "mark = __file__ + '.mark'"), "agrees", ""),
}
OTHERS = ("lagrange", "mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf")


def fast_math_library(folder: Path) -> str:
    """An engine whose library is linked with -ffast-math, which flushes subnormal numbers to zero for the whole process."""
    source = folder / "fast.c"
    source.write_text("double twice(double x) { return 2 * x; }\n")
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    assert compiler, "a C compiler is needed: install gcc or clang"
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-ffast-math", "-o", "fast.so", "fast.c"], cwd=folder, check=True)
    return own(top=f"ctypes.CDLL({str(folder / 'fast.so')!r})")


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, Any], str]:
    """Records by subject of the harness's own engines alone, and beside all strangers; and what the latter run wrote to standard error."""
    folder = tmp_path_factory.mktemp("strangers")
    engines = {name: source for name, (source, _, _) in STRANGERS.items()} | {"links_fast_math": fast_math_library(folder)}
    # Before the others by name: what is left behind would meet them all.
    library = make_library(folder / "library", ["bar_pendulum"], {f"a_{name}": source for name, source in engines.items()})
    alone, beside = (checked_by(library, folder, subjects) for subjects in (OTHERS, ()))
    return alone[0], beside[0], beside[1]


def checked_by(library: Path, folder: Path, subjects: tuple[str, ...] = ()) -> tuple[dict[str, Any], str]:
    """Records by subject of a check of one mechanism, and what it wrote to standard error."""
    options = [word for one in subjects for word in ("--subject", one)]
    options += ["--library", str(library), "--states", "60", "--seed", "3", "--quantity", "accelerations", "--workers", "1"]
    done = harness("check", "bar_pendulum", *options, "--json", "out.json", isolated=True, cwd=folder)
    return {record["subject"].removeprefix("a_"): record for record in records_of(folder / "out.json")}, done.stderr


def without_times(record: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in record.items() if "seconds" not in name and name not in ("replay", "faster")}


@pytest.mark.ci
@pytest.mark.parametrize("subject", OTHERS)
def test_strangers_change_no_other_record(checked: tuple[dict[str, Any], dict[str, Any], str], subject: str) -> None:
    alone, beside, said = checked
    assert alone[subject]["verdict"] == "agrees"
    assert without_times(beside[subject]) == without_times(alone[subject])
    assert "Traceback" not in said


@pytest.mark.ci
@pytest.mark.parametrize("name", [*STRANGERS, "links_fast_math"])
def test_a_stranger_costs_its_own_record_at_most(checked: tuple[dict[str, Any], dict[str, Any], str], name: str) -> None:
    _, verdict, words = STRANGERS.get(name, ("", "error", "subnormal numbers flushed to zero"))
    record = checked[1][f"{name}/mjcf"]
    assert record["verdict"] == verdict, record["message"]
    assert words in record["message"]


# A package that stands before MuJoCo's own on the search path, does something to its process, and then is MuJoCo.
PACKAGE = """
import os, sys
here = os.path.dirname(os.path.dirname(__file__))
sys.path[:] = [place for place in sys.path if place != here]
del sys.modules["mujoco"]
import mujoco, mujoco.batch
import ctypes, resource
import numpy as np

{what}
"""
UPWARD_IN_BATCHES = f"""
class Batch(mujoco.batch.Batch):
    def forward(self, *arguments):
        super().forward(*arguments)
        {ANOTHER_ROUNDING}

mujoco.batch.Batch = Batch
"""
NO_MEMORY = """
def refuse(text):
    raise MemoryError("no arena")

mujoco.MjModel.from_xml_string = mujoco.MjSpec.from_string = refuse
"""
# What it does, its verdict, words of its record.
OWN = {
    "flushes_subnormals": ("ctypes.CDLL({fast!r})", "error", "subnormal numbers flushed to zero"),
    "rounds_upward": (ANOTHER_ROUNDING, "error", "rounding upward"),
    "rounds_upward_in_batches": (UPWARD_IN_BATCHES, "error", "forward_dynamics leaves rounding upward"),
    "patches_numpy": ("np.einsum = lambda *arguments, **options: 0.0\nnp.linalg.norm = np.linalg.solve = None", "", ""),
    "lowers_limits": ("sys.setrecursionlimit(60); resource.setrlimit(resource.RLIMIT_NOFILE, (8, 8)); sys.path.clear()", "", ""),
    "empties_modules": ("sys.modules.pop('numpy.linalg', None); sys.modules.pop('harness.truth.compare', None)", "", ""),
    "finds_no_memory": (NO_MEMORY, "error", "no arena"),
}


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Records where MuJoCo is not asked, as where it gives no answer: the search for bad states is led by those that do."""
    folder = tmp_path_factory.mktemp("others")
    subjects = tuple(one for one in OTHERS if not one.startswith("mujoco"))
    return checked_by(make_library(folder / "library", ["bar_pendulum"]), folder, subjects)[0]


@pytest.mark.ci
@pytest.mark.parametrize("name", OWN)
def test_a_hostile_program_behind_an_engine_file_of_the_harness_costs_its_own_records(
    checked: tuple[dict[str, Any], dict[str, Any], str],
    others: dict[str, Any],
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    what, verdict, words = OWN[name]
    if "{fast" in what:
        fast_math_library(tmp_path)
        what = what.format(fast=str(tmp_path / "fast.so"))
    package = tmp_path / "before" / "mujoco"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(PACKAGE.format(what=what))
    monkeypatch.syspath_prepend(package.parent)
    records, _ = checked_by(make_library(tmp_path / "library", ["bar_pendulum"]), tmp_path)
    alone = others if verdict else checked[0]
    for subject in OTHERS:
        if verdict and subject.startswith("mujoco"):
            assert records[subject]["verdict"] == verdict and words in records[subject]["message"], records[subject]["message"]
        else:
            assert without_times(records[subject]) == without_times(alone[subject])
