"""The bodies, joints and inertias of a model in either format, each as places in its text that can be written.

Start with ``anatomy`` and the types of ``parts``; ``mjcf`` and ``urdf`` say what each format calls them.
"""

from __future__ import annotations

from harness.files.model_file import ModelFile
from harness.files.text.anatomy import mjcf, urdf
from harness.files.text.anatomy.parts import Anatomy, Parts

_OF_FORMAT = {"mjcf": mjcf.anatomy, "urdf": urdf.anatomy}


def anatomy(model: ModelFile) -> Anatomy:
    """Take a valid model apart."""
    return _OF_FORMAT[model.format](Parts(model))
