"""Prints the megabytes of the harness with what it requires, and of each extra beside that, as far as they are installed here.

python docs/hooks/sizes.py
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

NAME = "rigid-body-harness"


def closure(requirements: Iterable[str], extra: str = "") -> dict[str, int]:
    """Bytes of each installed distribution that the requirements lead to, by its name."""
    found: dict[str, int] = {}
    waiting = [(Requirement(one), extra) for one in requirements]
    seen = set()
    while waiting:
        requirement, asked = waiting.pop()
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": asked}):
            continue
        key = re.sub(r"[-_.]+", "-", requirement.name).lower(), tuple(sorted(requirement.extras))
        if key in seen:
            continue
        seen.add(key)
        try:
            own = metadata.distribution(requirement.name)
        except metadata.PackageNotFoundError:
            continue
        if key[0] != NAME:
            found[key[0]] = sum(size_of(own, file) for file in own.files or ())
        waiting += [(Requirement(one), name) for one in own.requires or () for name in (requirement.extras or {""})]
    return found


def size_of(distribution: metadata.Distribution, file: metadata.PackagePath) -> int:
    """Bytes of a file; 0 for one that is not there."""
    path = Path(str(distribution.locate_file(file)))
    return path.stat().st_size if path.is_file() else 0


def sizes() -> dict[str, dict[str, int]]:
    """The packages of a plain install, and of each extra those that it adds, with their bytes."""
    base = closure([NAME])
    extras = metadata.metadata(NAME).get_all("Provides-Extra") or []
    return {"": base} | {name: {k: v for k, v in closure([f"{NAME}[{name}]"]).items() if k not in base} for name in extras}


def main() -> None:
    """Print them."""
    for name, found in sizes().items():
        largest = sorted(found.items(), key=lambda item: -item[1])[:5]
        shown = ", ".join(f"{package} {size / 1e6:.0f}" for package, size in largest)
        print(f"{name or 'plain install':14} {sum(found.values()) / 1e6:6.0f} MB: {shown}")


if __name__ == "__main__":
    main()
