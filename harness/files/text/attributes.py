"""Attributes of a model file that are set where its author may have written none."""

from __future__ import annotations

from collections.abc import Mapping

from lxml import etree

from harness.files.document.xml import parse_document
from harness.files.model_file import ROOT_TAGS, ModelFile, parse_model

# Path of elements below the root to the attributes that they get; see ``with_attributes``.
Attributes = Mapping[str, Mapping[str, str]]


def with_attributes(model: ModelFile, attributes: Attributes) -> ModelFile:
    """The model with attributes set on all elements of each path, as ``option/flag`` or ``equality/connect[@name='closure']``.

    An element that a path of plain tags does not find is made.

    Raises:
        ValueError: another path finds none.
        InvalidModel: the changed model is not physical.
    """
    root = parse_document(model.path, model.text, ROOT_TAGS[model.format]).root
    for path, values in attributes.items():
        # Comments match a path that ends with a star.
        found = [one for one in root.iterfind(path) if isinstance(one.tag, str)] or [_made(root, path)]
        for element in found if values else ():
            for name, value in values.items():
                element.set(name, value)
    return parse_model(model.path, etree.tostring(root, encoding="unicode"), model.format)


def _made(root: etree._Element, path: str) -> etree._Element:
    element = root
    for tag in path.split("/"):
        if not tag.isidentifier():
            raise ValueError(f"the model has no element at {path!r}")
        inner = element.find(tag)
        element = etree.SubElement(element, tag) if inner is None else inner
    return element
