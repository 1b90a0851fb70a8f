"""Capture of what native code writes to file descriptors 1 and 2, for error messages."""

from __future__ import annotations

import ctypes
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def captured_standard_error() -> Iterator[Callable[[], str]]:
    """Redirect file descriptor 2 of the whole process; yields a function that returns the text written so far.

    The caller sees to it that one thread does so at a time.
    """
    saved = os.dup(2)
    with tempfile.TemporaryFile() as stream:

        def text() -> str:
            stream.seek(0)
            return stream.read().decode("utf-8", errors="replace").strip()

        os.dup2(stream.fileno(), 2)
        try:
            yield text
        finally:
            os.dup2(saved, 2)
            os.close(saved)


@contextmanager
def captured_output() -> Iterator[Callable[[], str]]:
    """The same of file descriptors 1 and 2, for programs that write their reasons to standard output."""
    libc = ctypes.CDLL(None)
    libc.fflush(None)
    saved = os.dup(1)
    with captured_standard_error() as text:
        os.dup2(2, 1)

        def flushed() -> str:
            libc.fflush(None)
            return text()

        try:
            yield flushed
        finally:
            libc.fflush(None)
            os.dup2(saved, 1)
            os.close(saved)
