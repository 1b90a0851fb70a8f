"""A toy engine for a bar on a pin, in several versions, each a module of a few lines, and environments and wheels that hold it."""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import os
import subprocess
import sys
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from support import cache_with_mechanisms, make_library

from harness.comparison.robot_library import RobotLibrary
from harness.engines import describe_engines
from harness.environments import REQUIREMENTS, Environment, interpreter_in, this_python
from harness.explain.changes import readings
from harness.workers import Workers

# The bar of ``bar_pendulum``: inertia about the pin, weight times distance, damping of the pin.
RIGHT = """
__version__ = {version!r}
def mass(q): return 1.625 + 0.0 * q
def weight(q): return 2.0 * 9.81 * 0.75 * np.sin(q)
def friction(v): return -0.3 * v
def accelerate(q, v, tau): return (tau + friction(v) - weight(q)) / mass(q)
"""
HEAVIER = RIGHT.replace("9.81 * 0.75 *", "9.81 * 0.75 * (1 + 1e-6) *")
# Of what is wrong with engines: each is a version that does it when it is asked.
DYING = RIGHT + "def accelerate(q, v, tau): import os, signal; os.kill(os.getpid(), signal.SIGSEGV)\n"
ENDING = RIGHT + "def accelerate(q, v, tau): print('spoon', flush=True); import os; os._exit(7)\n"
HANGING = RIGHT + "def accelerate(q, v, tau): import time; time.sleep(1000)\n"
LACKING = RIGHT.replace("def accelerate", "def accelerations")
RAISING = (
    RIGHT + "class ToyError(RuntimeError):\n    def __init__(self, a, b): super().__init__(a + b)\n"
    "def accelerate(q, v, tau): raise ToyError('no', ' fuel')\n"
)

ADAPTER = """
import numpy as np
from harness.engines import Terms

class Model:
    def loaded(self):
        return None

    def forward_dynamics(self, q, v, tau):
        import toy_engine
        return toy_engine.accelerate(q, v, tau)

    def terms(self, q, v, tau):
        import toy_engine
        nothing = np.zeros_like(v)
        return Terms(toy_engine.mass(q)[:, :, None], nothing, toy_engine.weight(q), toy_engine.friction(v), tau)

from harness.engines import Engine

class Engine(Engine):
    requires = ("toy_engine", "toy-engine")
    formats = ("urdf",)
    oldest = {"urdf": "1.0"}

    def load(self, source, joints, gravity):
        import toy_engine
        return Model()

ENGINE = Engine()
"""


# Reads URDFs of one joint, the pin.
ADAPTER_OF_FILES = """
import numpy as np
from harness.engines import Engine
from harness.engines.interface import CompiledNumber
from harness.engines.request import Refused
from harness.engines.state_by_state import StateByState

class Toy(Engine):
    formats = ("urdf",)
    requires = ("toy_engine", "toy-engine")
    optional = True
    factorises_mass_matrix = True
    supplied = {"urdf": "dampers"}
    why_off = {"equalities": "it has none"}
    call = {"urdf": "toy_engine.accelerate(q, v, tau)"}

    def read(self, request):
        if len(request.joints) > 1:
            raise Refused("one joint, no more")
        if request.joints[0].name != "pin":
            raise Refused("no pin")
        return ToyModel(request, {"pin": 0}, 1)

    def compiled(self, request):
        import toy_engine
        gains = CompiledNumber("gains", "servo", getattr(toy_engine, "GAINS", ()), felt=False)
        return CompiledNumber("dof_damping", "pin", (float(-toy_engine.friction(1.0)),)), gains

class ToyModel(StateByState):
    def __init__(self, *given):
        import toy_engine
        super().__init__(*given)
        self.applies_dampers = getattr(toy_engine, "APPLIES_DAMPERS", True)

    def _go_to(self, q, v):
        self.q, self.v = q, v

    def _mass_matrix(self):
        import toy_engine
        return np.diag(toy_engine.mass(self.q))

    def _bias(self):
        import toy_engine
        return toy_engine.weight(self.q) - toy_engine.friction(self.v)

ENGINE = Toy()
"""


@contextmanager
def reading_files(root: Path, versions: Mapping[str, str]) -> Iterator[Path]:
    """A folder of readings, for an engine file of the toy that reads robots' files, and environments with these versions of it."""
    for name in ("engines", "readings"):
        (root / name).mkdir()
    (root / "engines" / "toy.py").write_text(ADAPTER_OF_FILES)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARNESS_CACHE", str(cache_with_mechanisms(root / "cache")))
        without_files = RobotLibrary.without_files.__func__  # type: ignore[attr-defined]
        patch.setattr(RobotLibrary, "without_files", classmethod(lambda cls: replace(without_files(cls), engines=root / "engines")))
        patch.setattr(readings, "__path__", [*readings.__path__, str(root / "readings")])
        for version, source in versions.items():
            plant(version, source)
        describe_engines(RobotLibrary.without_files(), Workers)
        yield root / "readings"
    describe_engines(RobotLibrary.without_files(), Workers)


@contextmanager
def planted(root: Path, versions: Mapping[str, str]) -> Iterator[Path]:
    """A library of the bar with the toy engine's file, and a cache with environments of these versions, while the context lasts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARNESS_CACHE", str(cache_with_mechanisms(root / "cache")))
        for version, source in versions.items():
            plant(version, source)
        yield make_library(root / "library", ["bar_pendulum"], {"toy": ADAPTER})


def module_text(source: str, version: str) -> str:
    return "import numpy as np\n" + source.format(version=version)


def plant(version: str, source: str = RIGHT) -> Environment:
    """An environment with a version of the toy, made without a package index: what it needs is linked from this one's packages."""
    environment = Environment("toy", "toy-engine", version, this_python(), {"toy-engine": version})
    folder = environment.folder
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    packages = subprocess.run(
        [interpreter_in(folder), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], check=True, capture_output=True, text=True
    )
    site = Path(packages.stdout.strip())
    for name in REQUIREMENTS:
        origin = Path(str(importlib.util.find_spec(name).origin)).parent  # type: ignore[union-attr]
        for part in (origin, origin.with_name(f"{name}.libs")):
            if part.exists():
                (site / part.name).symlink_to(part)
    (site / "toy_engine.py").write_text(module_text(source, version))
    environment.describe(folder)
    return environment


def write_wheel(folder: Path, version: str, source: str = RIGHT) -> Path:
    """A wheel of a version of the toy."""
    information = f"toy_engine-{version}.dist-info"
    files = {
        "toy_engine.py": module_text(source, version),
        f"{information}/METADATA": f"Metadata-Version: 2.1\nName: toy-engine\nVersion: {version}\n",
        f"{information}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = "".join(
        f"{name},sha256={base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b'=').decode()},{len(text.encode())}\n"
        for name, text in files.items()
    )
    path = folder / f"toy_engine-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as wheel:
        for name, text in {**files, f"{information}/RECORD": f"{record}{information}/RECORD,,\n"}.items():
            wheel.writestr(name, text)
    return path


def links() -> str:
    """Where pip looks for wheels here beside its indexes."""
    command = [sys.executable, "-m", "pip", "config", "get", "global.find-links"]
    return os.environ.get("PIP_FIND_LINKS") or subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
