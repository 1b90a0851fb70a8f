"""CPU time of a command with all processes that it starts, also those that it does not wait for."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
from pathlib import Path

# Of prctl(2): orphans below this process become its children, so that it can wait for them.
PR_SET_CHILD_SUBREAPER = 36


def cpu_seconds(*arguments: str, cwd: Path, **environment: str) -> float:
    """User and system time of this Python with ``arguments`` [s], of all its descendants on Linux.

    The process must have no other children. On other systems, descendants are counted that their parents wait for.

    Raises:
        RuntimeError: the command fails, with its last words.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    variables = {**os.environ, **environment}
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL, stderr=said, cwd=cwd, env=variables)
        seconds = 0.0
        while True:
            try:
                number, status, usage = os.wait4(-1, 0)
            except ChildProcessError:
                break
            seconds += usage.ru_utime + usage.ru_stime
            if number == process.pid:
                process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            said.seek(0)
            words = said.read().decode(errors="replace").strip().splitlines() or ["nothing"]
            raise RuntimeError(f"exit status {process.returncode} of {' '.join(arguments)}; its last words: {words[-1]}")
    return seconds
