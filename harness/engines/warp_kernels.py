"""Kernels of Warp, which engines that compute with it share: compiled once for a cache, and told of on a terminal alone."""

from __future__ import annotations

import sys

from harness.storage import cache_directory


def keep_compiled() -> None:
    """Keep kernels in the harness's cache, and say that they are compiled on a terminal alone."""
    import warp

    warp.config.kernel_cache_dir = str(cache_directory() / "warp")
    if not sys.stderr.isatty():
        warp.config.log_level = warp.LOG_WARNING
