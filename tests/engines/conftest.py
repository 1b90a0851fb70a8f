"""Environments of engines for the tests of this folder.

``HARNESS_TEST_CACHE`` names a cache whose environments the tests use, and add to; without it they are made for the run.
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from support import cache_with_mechanisms


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The cache that holds the environment of an engine, which is made at its first use in a run."""
    kept = os.environ.get("HARNESS_TEST_CACHE")
    cache = Path(kept) if kept else cache_with_mechanisms(tmp_path_factory.mktemp("environments") / "cache")
    cache.mkdir(parents=True, exist_ok=True)

    @functools.cache
    def made(engine: str) -> Path:
        if any((cache / "environments").glob(f"{engine}@*/environment.json")):
            return cache
        words = [sys.executable, "-m", "harness", "engines", "add", engine]
        variables = {**os.environ, "HARNESS_CACHE": str(cache)}
        done = subprocess.run(words, capture_output=True, text=True, cwd=cache, env=variables, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return cache

    return made
