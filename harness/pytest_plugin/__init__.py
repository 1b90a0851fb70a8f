"""The options of pytest for the cross-check of any library and of robots. No engine is imported when this module loads.

``pytest --harness-library DIR`` collects ``DIR/systems/*.py``; the ini option ``harness_library`` does
the same for a project's own runs. ``--harness-robots FOLDER`` collects robots' files.

May use ``commands`` and what is below it. Start with ``regression``, a library's mechanisms as tests; ``robots`` has those of robots.
"""

from __future__ import annotations

import argparse

import pytest

from harness.library import BUILT_IN_NAME

_DEFAULT_STATES = 1000


def _above_zero(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not above zero")
    return value


def _size(text: str) -> int:
    from harness.workers.memory import parse_size

    try:
        return parse_size(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _seconds(text: str) -> float:
    value = float(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{value} is not above zero")
    return value


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("harness", "cross-check of physics engines")
    group.addoption(
        "--harness-library",
        metavar="DIR",
        help=f"cross-check this library, a folder or an installed one's name ('{BUILT_IN_NAME}' for the textbook mechanisms)",
    )
    group.addoption(
        "--harness-robots",
        metavar="FOLDER",
        help="compare the engines on every robot of this folder, a test for each file and engine; expected_robots.toml there says "
        "which outcomes are expected",
    )
    group.addoption(
        "--harness-states",
        type=_above_zero,
        metavar="N",
        help=f"states per system (default: harness_states of the settings, else {_DEFAULT_STATES})",
    )
    group.addoption("--harness-seed", type=int, default=0, metavar="S", help="seed of the sampled states (default: %(default)s)")
    group.addoption("--harness-subject", action="append", default=[], metavar="ENGINE/FORMAT", help="only this subject; repeatable")
    group.addoption(
        "--harness-quantity",
        action="append",
        default=[],
        metavar="NAME",
        help="what is compared, as mass_matrix; repeatable; derivatives stands for both of these, and all for all (default: "
        "harness_quantity of the settings, else accelerations)",
    )
    group.addoption("--harness-workers", type=_above_zero, metavar="N", help="worker processes (default: one per CPU)")
    group.addoption(
        "--harness-memory-limit",
        type=_size,
        metavar="SIZE",
        help="memory that each worker process, and each process of an engine, may hold, as 4GiB (default: half of the machine's memory "
        "divided by the workers, at least 2GiB and at most 8GiB)",
    )
    group.addoption(
        "--harness-scheduler",
        metavar="ADDRESS",
        help="use the dask.distributed cluster at this address. Who can reach the scheduler can run code as you; "
        "use tls:// on shared machines",
    )
    group.addoption("--harness-tls-ca-file", metavar="FILE", help="certificate of the authority that a tls:// cluster trusts")
    group.addoption("--harness-tls-cert", metavar="FILE", help="certificate to show to a tls:// cluster")
    group.addoption("--harness-tls-key", metavar="FILE", help="key of that certificate")
    group.addoption(
        "--harness-time-limit",
        type=_seconds,
        default=60.0,
        metavar="SECONDS",
        help="seconds an engine may take over one batch (default: %(default)s)",
    )
    parser.addini("harness_library", "library the cross-check runs over when --harness-library is not given", default="")
    parser.addini("harness_quantity", "quantities that are compared when --harness-quantity is not given", type="args", default=[])
    parser.addini("harness_states", "states per system when --harness-states is not given", default=str(_DEFAULT_STATES))


def _states_of_settings(config: pytest.Config) -> int:
    text = config.getini("harness_states")
    try:
        return _above_zero(text)
    except (ValueError, argparse.ArgumentTypeError) as error:
        raise pytest.UsageError(f"harness_states in the settings is {text!r}; expected a whole number above zero") from error


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--harness-robots"):
        from harness.pytest_plugin import robots

        robots.register(config)
    chosen = config.getoption("--harness-library") or config.getini("harness_library")
    if chosen:
        from harness.pytest_plugin import regression

        regression.register(config, chosen, config.getoption("--harness-states") or _states_of_settings(config))
