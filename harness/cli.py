"""Command line: ``harness COMMAND``, each command a file in ``harness/commands``.

Exit status: 0 all verdicts as expected and nothing superfluous in a model of the built-in library; 1 not so, and nothing else;
2 bad usage or an invalid model, system or engine file; 3 an engine crashed or timed out; 70 the harness itself is at fault; 130
an interrupt.
"""

from __future__ import annotations

import sys
import traceback
from importlib import import_module
from typing import Any

import click

from harness import commands
from harness.commands.frame.options import INTERRUPTED, report_own_fault
from harness.commands.frame.surroundings import surroundings
from harness.registry import module_names
from harness.version import __version__


class Commands(click.Group):
    """Commands found by the name of their file; what one raises ends with a status of its own."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [name.replace("_", "-") for name in module_names(commands.__name__)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.list_commands(ctx):
            return None
        command = import_module(f"{commands.__name__}.{cmd_name.replace('-', '_')}").command
        assert isinstance(command, click.Command)
        return command

    def main(self, *arguments: Any, **options: Any) -> Any:
        try:
            with surroundings():
                return super().main(*arguments, **options)
        except (click.ClickException, click.Abort):
            raise
        except Exception:
            traceback.print_exc()
            report_own_fault()

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            # Click's own status for it is 1.
            click.echo("harness: interrupted", err=True)
            sys.exit(INTERRUPTED)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="harness")
def main() -> None:
    """Cross-check physics engines against certified accelerations of textbook mechanisms.

    \b
    Examples:
      harness list
      harness check double_pendulum
      harness check double_pendulum --urdf edited.urdf
      harness new my_arm --library mine

    \b
    Exit status:
      0    every verdict is as expected
      1    at least one is not
      2    bad usage, or an invalid model, system or engine file
      3    an engine crashed or timed out
      70   a fault of the harness itself
      130  an interrupt
    """
