"""The surroundings of a command: standard streams, signals, a working folder, and what the system refuses it."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from harness.commands.frame.options import INVALID
from harness.study import is_out_of_memory

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
            terminate = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
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
