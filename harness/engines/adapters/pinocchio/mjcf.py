"""The model that Pinocchio's MJCF reader gives of a mechanism's file.

Gravity, springs and dampers are supplied by the caller from the file (``harness.files.facts``). What the reader passes over, or reads
otherwise than MuJoCo, is no refusal: it is asked, and ``harness.explain.changes.readings.pinocchio_mjcf`` declares what it makes of it.
"""

from __future__ import annotations

import tempfile
from typing import Any

import pinocchio

from harness.engines import Unsupported
from harness.engines.adapters.pinocchio.versions import reasons
from harness.files.model_file import ModelFile


def read(file: ModelFile) -> Any:
    """The ``pinocchio.Model``, without gravity and forces.

    Raises:
        Unsupported: the file holds forces that Pinocchio has none of and nobody supplies, or the reader refuses it.
    """
    if missing := [f"line {one.line}: {one.what}, which the harness cannot supply" for one in file.unexpressed]:
        raise Unsupported(f"Pinocchio's MJCF reader: {'; '.join(missing)}")
    # The reader wants a path. This one has no name that could outlive a process which the reader aborts.
    refused = "Pinocchio's MJCF reader refuses it: "
    with tempfile.TemporaryFile() as content, reasons(lambda words: Unsupported(refused + " ".join(words.split()))):
        content.write(file.text.encode())
        content.seek(0)
        return pinocchio.buildModelFromMJCF(f"/dev/fd/{content.fileno()}")
