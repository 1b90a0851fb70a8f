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

CPU seconds of a command with all of its processes, from a warm cache, measured by `python -m benchmarks commands` on a virtual machine
({machine()}). On several cores a command takes less time than that.

| command | what it stands for | CPU seconds |
| --- | --- | --- |
{chr(10).join(rows)}

A check without names covers the whole catalogue in {shown(seconds[name_of(WHOLE)])} CPU seconds once the equations are in the cache, and
deriving them takes about half a minute, once. `harness report`, `nightly` and `atlas` take longer. `harness upgrade` and `engines add` take
what pip takes to install an engine, the first time.

`harness bench NAME` measures what engines cost. The limits on a cluster are on [its page](../how-to/cluster.md).
"""


def shown(seconds: float) -> str:
    """CPU seconds in two digits."""
    return f"{seconds:.1f}" if seconds < 10 else f"{seconds:.0f}"
