"""Constraints with the lower bound of every requirement in pyproject.toml, for the job that tries the oldest versions admitted."""

from __future__ import annotations

import tomllib
from pathlib import Path

from packaging.requirements import Requirement

EXTRAS = ("cluster", "docs", "lagrange", "report", "search", "test")


def lowest(project: dict[str, object]) -> dict[str, str]:
    """The lower bound of each distribution that the base and ``EXTRAS`` name; raises ``ValueError`` for one without."""
    texts = [*project["dependencies"], *(text for extra in EXTRAS for text in project["optional-dependencies"][extra])]  # type: ignore[index, misc]
    found = {}
    for requirement in map(Requirement, texts):
        if requirement.name == project["name"]:
            continue
        bounds = [one.version for one in requirement.specifier if one.operator == ">="]
        if not bounds:
            raise ValueError(f"{requirement} has no lower bound; expected one as {requirement.name}>=1.0")
        found[requirement.name] = bounds[0]
    return dict(sorted(found.items()))


if __name__ == "__main__":
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    print("\n".join(f"{name}=={version}" for name, version in lowest(project).items()))
