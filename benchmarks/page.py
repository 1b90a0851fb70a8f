"""docs/reference/costs.md: CPU seconds of commands, from the history."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.history import REPOSITORY, Measured, machine
from benchmarks.suites.commands import COMMANDS, WHOLE, name_of

PAGE = REPOSITORY / "docs" / "reference" / "costs.md"


def page(measured: Iterable[Measured]) -> str:
    """The page with a table of all commands.

    Raises:
        LookupError: a command has not been measured, with what to do.
    """
    seconds = {one.name: min(one.values) for one in measured}
    missing = [command for command in (*COMMANDS, WHOLE) if name_of(command) not in seconds]
    if missing:
        raise LookupError(f"not measured on this machine: {', '.join(missing)}; run python -m benchmarks commands")
    rows = [
        f"| `harness {name_of(command).removeprefix('commands/')}` | {what} | {shown(seconds[name_of(command)])} |"
        for command, what in COMMANDS.items()
    ]
    return f"""# Costs

These are the CPU seconds of each command with all of its processes, from a warm cache. `python -m benchmarks commands` measured them on a
virtual machine ({machine()}). On several cores a command takes less time than that.

| command | what it stands for | CPU seconds |
| --- | --- | --- |
{chr(10).join(rows)}

A check without names covers the whole catalogue in {shown(seconds[name_of(WHOLE)])} CPU seconds once the equations are in the cache, and
deriving them the first time takes about half a minute. `harness report`, `nightly` and `atlas` take longer. The first time,
`harness upgrade` and `engines add` also take the time that pip needs to install an engine.

`harness bench NAME` measures what engines cost; [On a cluster](../how-to/cluster.md) says what a cluster costs.
"""


def shown(seconds: float) -> str:
    """CPU seconds in two digits."""
    return f"{seconds:.1f}" if seconds < 10 else f"{seconds:.0f}"
