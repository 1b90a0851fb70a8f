"""A night on a cluster finds what it finds on this machine."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from support import harness, make_library

from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.truth.quantities import find_quantities


def verdicts(folder: Path) -> list[tuple[str, str, str, str, int, float | None]]:
    with History(folder / "history.sqlite") as history:
        [number] = history.studies(CrossCheckResult)
        records = history.read(number, CrossCheckResult).records
    return sorted((one.quantity, one.system, one.subject, one.verdict, one.states, one.backward_error) for one in records)


@pytest.mark.ci
@pytest.mark.usefixtures("without_charts")
def test_a_night_spreads_over_a_cluster(tmp_path: Path) -> None:
    from distributed import LocalCluster

    make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"])
    asked = ["nightly", "--library", "library", "--stage", "cross-check", "--states", "40", "--out"]
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50) as cluster:
        done = harness(*asked, "far", "--scheduler", cluster.scheduler_address, cwd=tmp_path, isolated=True)
    assert done.returncode == 0, done.stderr
    assert harness(*asked, "here", cwd=tmp_path).returncode == 0
    assert verdicts(tmp_path / "far") == verdicts(tmp_path / "here")
    # Five subjects of two mechanisms.
    assert Counter(quantity for quantity, *_ in verdicts(tmp_path / "far")) == dict.fromkeys(find_quantities(), 10)
