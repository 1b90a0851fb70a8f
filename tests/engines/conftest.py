"""Environments of engines for the tests of this folder."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The cache that holds the environment of an engine, which is made at its first use in a run."""
    cache = tmp_path_factory.mktemp("environments")

    @functools.cache
    def made(engine: str) -> Path:
        words = [sys.executable, "-m", "harness", "engines", "add", engine]
        variables = {**os.environ, "HARNESS_CACHE": str(cache)}
        done = subprocess.run(words, capture_output=True, text=True, cwd=cache, env=variables, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return cache

    return made
