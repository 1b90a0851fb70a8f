"""What model files ask of engines, in words that a report gathers verdicts by."""

from __future__ import annotations

import pytest
from catalogue import BUILT_IN

from harness.files.model_file import features_of, parse_model, read_model


@pytest.mark.parametrize(
    ("name", "model_format", "expected"),
    [
        ("arm_2r", "mjcf", []),
        ("arm_2r", "urdf", []),
        ("heavy_top", "mjcf", ["ball joints"]),
        ("heavy_top", "urdf", ["ball joints"]),
        ("free_body", "mjcf", ["free joints"]),
        ("free_body", "urdf", ["free joints"]),
        ("four_bar", "mjcf", ["loops"]),
        ("four_bar", "urdf", ["loops"]),
        ("atwood", "mjcf", ["coupled joints"]),
        ("atwood", "urdf", ["mimic joints"]),
        ("flyball_governor", "urdf", ["dampers", "springs"]),
        ("furuta_pendulum.armature", "urdf", ["armature", "dampers"]),
        ("furuta_pendulum.armature", "mjcf", ["armature", "dampers"]),
    ],
)
def test_features_of_the_catalogue(name: str, model_format: str, expected: list[str]) -> None:
    assert features_of(read_model(BUILT_IN.model_path(name, model_format), model_format)) == expected


def test_an_encoding_that_a_model_names_is_not_asked_for() -> None:
    """The text was decoded when it was read."""
    path = BUILT_IN.model_path("heavy_top", "mjcf")
    text = '<?xml version="1.0" encoding="latin-1"?>\n' + path.read_text()
    assert features_of(parse_model(path, text, "mjcf")) == ["ball joints"]


def test_an_element_that_does_nothing_is_no_feature() -> None:
    path = BUILT_IN.model_path("four_bar", "mjcf")
    text = path.read_text()
    cut = text[: text.index("<equality>")] + text[text.index("</equality>") + len("</equality>") :]
    assert features_of(parse_model(path, cut, "mjcf")) == []
