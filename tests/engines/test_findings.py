"""Findings of engines beside the mechanisms: each program runs with the engine alone, and what it shows is still so."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from harness.engines import load_engine
from harness.environments import find_environments
from harness.library import Library
from harness.report.site_data import known_findings
from harness.results.site import SiteFinding

FINDINGS = known_findings()


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda one: one.statement)
def test_a_finding_is_a_program_of_three_lines_of_an_engine_that_exists(finding: SiteFinding) -> None:
    assert load_engine(Library.built_in(), finding.engine)
    assert finding.link.startswith(("https://", "http://"))
    assert len(finding.reproducer.strip().splitlines()) == 3
    assert "harness" not in finding.reproducer
    compile(finding.reproducer, finding.statement, "exec")


@pytest.mark.nightly
@pytest.mark.parametrize("finding", FINDINGS, ids=lambda one: one.statement)
def test_what_a_finding_shows_is_still_so(
    finding: SiteFinding, environment: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its last two lines are what the engine says and what is right. A version in which they are equal has mended it: take it out."""
    interpreter: str | Path = sys.executable
    if getattr(load_engine(Library.built_in(), finding.engine), "optional", False):
        monkeypatch.setenv("HARNESS_CACHE", str(environment(finding.engine)))
        interpreter = find_environments(finding.engine)[-1].interpreter
    done = subprocess.run([interpreter, "-c", finding.reproducer], capture_output=True, text=True, check=True, cwd=tmp_path)
    engine, right = done.stdout.splitlines()[-2:]
    assert engine != right
