"""The version of the harness, and those of installed packages."""

import functools

__version__ = "0.2.0"
# What ``sys.platform`` may be; Pinocchio has no wheels for other systems.
SYSTEMS = {"linux": "Linux", "darwin": "macOS"}


@functools.cache
def version_of(distribution: str) -> str:
    """The version of an installed package, whose metadata are read once in a process.

    Raises:
        importlib.metadata.PackageNotFoundError: it is not installed.
    """
    # It takes longer to import than most that a process of an engine has of the harness, and few of them ask.
    import importlib.metadata

    return importlib.metadata.version(distribution)
