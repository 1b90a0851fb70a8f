"""The addresses of the project, which are those of the repository that builds it: a build elsewhere knows none and names none."""

from __future__ import annotations

import os
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class Addresses(MetadataHookInterface):
    """Fill in ``project.urls`` from the variables that GitHub gives every step of a workflow."""

    def update(self, metadata: dict[str, Any]) -> None:
        server, repository = os.environ.get("GITHUB_SERVER_URL"), os.environ.get("GITHUB_REPOSITORY")
        home = f"{server}/{repository}"
        parts = {"Repository": "", "Issues": "/issues", "Changelog": "/blob/main/CHANGELOG.md", "Documentation": "/blob/main/README.md"}
        metadata["urls"] = {name: home + part for name, part in parts.items()} if server and repository else {}
