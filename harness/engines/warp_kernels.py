"""Kernels of Warp, which engines that compute with it share: compiled once for a cache, and told of on a terminal alone."""

from __future__ import annotations

import sys
from types import ModuleType

from harness.storage import cache_directory


def keep_compiled(warp: ModuleType) -> None:
    """Keep kernels of ``warp``, which its callers depend on, in the harness's cache, and tell a terminal alone of compiling them."""
    warp.config.kernel_cache_dir = str(cache_directory() / "warp")
    if not sys.stderr.isatty():
        warp.config.log_level = warp.LOG_WARNING
