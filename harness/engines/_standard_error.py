"""What native code writes to file descriptor 2, for error messages."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO


class Captured:
    """Text that has arrived on file descriptor 2 so far."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream

    def text(self) -> str:
        self._stream.seek(0)
        return self._stream.read().decode("utf-8", errors="replace").strip()


@contextmanager
def captured_standard_error() -> Iterator[Captured]:
    """Redirect file descriptor 2 of the whole process; the caller sees to it that one thread does so at a time."""
    saved = os.dup(2)
    with tempfile.TemporaryFile() as stream:
        os.dup2(stream.fileno(), 2)
        try:
            yield Captured(stream)
        finally:
            os.dup2(saved, 2)
            os.close(saved)
