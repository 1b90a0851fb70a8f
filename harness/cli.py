"""Command line: ``harness COMMAND``, each command a file in ``harness/commands``.

Exit status: 0 all verdicts as expected and nothing superfluous in a model of the built-in library; 1 not so, and nothing else;
2 bad usage or an invalid model, system or engine file; 3 an engine crashed or timed out; 70 the harness itself is at fault; 130
an interrupt; 143 a signal to terminate.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import shlex
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any, NoReturn

import click

from harness import commands
from harness.commands import SECTIONS
from harness.commands.frame.options import INTERRUPTED, INVALID, TERMINATED, report_own_fault
from harness.errors import Terminated, is_out_of_memory
from harness.library import FILE_SUFFIXES, TEMPLATE_SUFFIX, nearest
from harness.registry import module_names
from harness.version import SYSTEMS, __version__

# What the system may refuse any command, and the way out.
_REMEDIES = {
    errno.EMFILE: "raise the limit of open files (ulimit -n), or use fewer --workers",
    errno.ENFILE: "close other programs",
    errno.EAGAIN: "raise the limit of processes (ulimit -u), or use fewer --workers",
    errno.ENOMEM: "raise the limit of memory (ulimit -v), or use fewer --workers",
    errno.ENOSPC: "free space, or name another folder for temporary files by TMPDIR",
    errno.EDQUOT: "free space, or name another folder for temporary files by TMPDIR",
    errno.EFBIG: "raise the limit of file sizes (ulimit -f)",
}


class _Stream(io.FileIO):
    """A standard stream that no failure interrupts: what cannot be written is dropped, and the first reason kept."""

    failure: OSError | None = None

    def write(self, content: Any) -> int:
        if self.failure is None:
            try:
                return super().write(content)
            except OSError as error:
                self.failure = error
        return len(content)


@contextlib.contextmanager
def surroundings() -> Iterator[None]:
    """Run a command so that its surroundings end it with one line and its own status, if at all.

    A reader of standard output that is gone, or a stream that is closed, changes nothing. Output that cannot be written
    otherwise is exit status 2 in the end, and so is a system that refuses files, processes or memory. A signal to
    terminate unwinds the command, so that nothing of it is left behind, and is exit status 143.
    """
    # Files opened later must not take the place of a closed standard stream.
    while (descriptor := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(descriptor)
    with contextlib.ExitStack() as undo:
        if threading.current_thread() is threading.main_thread():
            terminate = signal.signal(signal.SIGTERM, _terminate)
            undo.callback(signal.signal, signal.SIGTERM, terminate)
        output = _replaced("stdout", 1, undo)
        _replaced("stderr", 2, undo)
        try:
            Path.cwd()
            yield
        except (OSError, MemoryError, ImportError) as error:
            remedy = _remedy(error)
            if remedy is None:
                raise
            _end(f"{getattr(error, 'strerror', None) or str(error) or 'no memory is left'}; {remedy}")
        finally:
            sys.stdout.flush()
            if output is not None and output.failure is not None and not isinstance(output.failure, BrokenPipeError):
                _end(f"standard output cannot be written ({output.failure.strerror}); send it elsewhere")


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    raise Terminated(TERMINATED)


def _replaced(name: str, descriptor: int, undo: contextlib.ExitStack) -> _Stream | None:
    """The stream below ``sys.stdout`` or ``sys.stderr`` until ``undo``; None where a caller has put one of its own there."""
    before = getattr(sys, name)
    if before is not getattr(sys, f"__{name}__"):
        return None
    stream = _Stream(descriptor, "w", closefd=False)
    encoding, errors = (None, None) if before is None else (before.encoding, before.errors)
    text = io.TextIOWrapper(io.BufferedWriter(stream), encoding, errors, line_buffering=descriptor == 2 or stream.isatty())
    undo.callback(setattr, sys, name, before)
    undo.callback(text.flush)
    setattr(sys, name, text)
    return stream


def _remedy(error: Exception) -> str | None:
    """The way out of what the system refuses; None for any other error."""
    if isinstance(error, FileNotFoundError) and Path().stat().st_nlink == 0:
        return "the working folder has been removed; change to one that exists"
    if "No usable temporary directory" in str(error):
        return _REMEDIES[errno.ENOSPC]
    if is_out_of_memory(error):
        return _REMEDIES[errno.ENOMEM]
    return _REMEDIES.get(error.errno or 0) if isinstance(error, OSError) else None


def _end(problem: str) -> None:
    click.echo(f"harness: {problem}", err=True)
    sys.exit(INVALID)


def _module_of(command: str) -> ModuleType:
    return import_module(f"{commands.__name__}.{command.replace('-', '_')}")


class Commands(click.Group):
    """Commands found by the name of their file; what one raises ends with a status of its own."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [name.replace("_", "-") for name in module_names(commands.__name__)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.list_commands(ctx):
            return None
        command = _module_of(cmd_name).command
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        rows: dict[str, list[tuple[str, str]]] = {section: [] for section in SECTIONS}
        for name in self.list_commands(ctx):
            command = self.get_command(ctx, name)
            assert command is not None
            rows[_module_of(name).SECTION].append((name, command.get_short_help_str(formatter.width)))
        width = max(len(name) for own in rows.values() for name, _ in own)
        for section, own in rows.items():
            with formatter.section(section):
                formatter.write_dl([(f"{name:<{width}}", text) for name, text in own])

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        name, known = args[0], self.list_commands(ctx)
        if Path(name).suffix in (*FILE_SUFFIXES, TEMPLATE_SUFFIX):
            ctx.fail(f"{name} is a file, and a command goes before it: {shlex.join(['harness', 'compare', name])}")
        if name not in known and not name.startswith("-"):
            ctx.fail(f"no command is called {name!r}; {nearest(name, known)}")
        return super().resolve_command(ctx, args)

    def main(self, *arguments: Any, **options: Any) -> Any:
        if sys.platform not in SYSTEMS:
            _end(f"{sys.platform} is not supported; use {' or '.join(SYSTEMS.values())}, on Windows its subsystem for Linux (WSL)")
        from harness.workers.program import VARIABLES

        os.environ |= VARIABLES | os.environ
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
      harness compare robot.urdf
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
      143  a signal to terminate
    """
