"""Memory that a process may take, and how it is seen that one takes more.

Each worker process is watched by the harness, and the process of an engine by the worker that asks it: one that holds more than the limit
in memory is ended, and what it was asked is refused. The resident set is what counts, and not a limit of the kernel on what a process
reserves: heyoka reserves half a gigabyte for every program that it compiles, and holds almost nothing of that. A worker of a whole check
has reserved 22 GB, which RLIMIT_AS and RLIMIT_DATA both count, where it holds 1 GB; MuJoCo's process has reserved 560 MB and holds 80 MB,
Pinocchio's 140 MB and 100 MB.

Linux tells the resident set in /proc. macOS enforces neither of the two limits on memory that is mapped. There, and on other systems,
``ps`` is asked, which takes milliseconds, and not before a question has taken a second.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
from pathlib import Path

GIB = 2**30
# What a process has by default: a share of the machine's memory divided by the workers, and no less and no more than these. A worker of a
# whole check holds 1 GiB, an engine of it 0.1 GiB.
SHARE = 0.5
LEAST, MOST = 2 * GIB, 8 * GIB
# In the environment of a worker: the limit of what it starts.
VARIABLE = "HARNESS_MEMORY_LIMIT"
_SIZE = re.compile(r"(?P<number>\d+(\.\d+)?) ?(?P<unit>[KMGT])(iB|B)?", re.IGNORECASE)
_UNITS = {"K": 2**10, "M": 2**20, "G": GIB, "T": 2**40}
_ASKING_TAKES_LONG = not Path("/proc/self/statm").exists()
# Between two looks at a process [s]; before the first one where ``ps`` is asked.
LOOK_SECONDS = 1.0 if _ASKING_TAKES_LONG else 0.1


def default_limit(workers: int) -> int:
    """Bytes that each process of so many workers may hold where nobody says."""
    return int(min(MOST, max(LEAST, SHARE * memory_of_machine() / workers)))


def memory_of_machine() -> int:
    """Bytes of memory of this machine, or of the container that this process runs in."""
    found = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    with contextlib.suppress(OSError, ValueError):
        found.append(int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return min(found)


def parse_size(text: str) -> int:
    """Bytes of "4GiB", "500M" or "1.5 GB", whose units are powers of 1024.

    Raises:
        ValueError: the text is none of these.
    """
    match = _SIZE.fullmatch(text.strip())
    if match is None or not float(match["number"]):
        raise ValueError(f"{text!r} is no size of memory; expected one as 4GiB or 500MiB")
    return int(float(match["number"]) * _UNITS[match["unit"].upper()])


def in_words(size: int) -> str:
    """A size of memory as people write it."""
    return f"{size / GIB:.3g} GiB" if size >= GIB else f"{size / 2**20:.3g} MiB"


def limit_here() -> int | None:
    """Bytes that a process may hold which this one starts; None for one that is no worker."""
    text = os.environ.get(VARIABLE, "")
    return int(text) if text else None


def resident(process: int) -> int:
    """Bytes that a process holds in memory; 0 where it has ended, or nobody tells it."""
    try:
        if not _ASKING_TAKES_LONG:
            return int(Path(f"/proc/{process}/statm").read_bytes().split()[1]) * os.sysconf("SC_PAGE_SIZE")
        found = subprocess.run(["ps", "-o", "rss=", "-p", str(process)], capture_output=True, text=True, timeout=5, check=False)
        return int(found.stdout or 0) * 2**10
    except (OSError, ValueError, IndexError, subprocess.TimeoutExpired):
        return 0
