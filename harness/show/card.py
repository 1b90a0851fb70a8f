"""A mechanism on a card: name, joints, parameters and the size of its equations, as text and for a notebook."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from html import escape

from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.table import grouped, number_text

_WIDTH = 100
# Parameters of a robot's file, which are its numbers, are counted beyond this.
_MOST_PARAMETERS = 40


def card_text(mechanism: Mechanism, changed: Mapping[str, float]) -> str:
    """The card in lines of plain text; ``changed`` are the parameters that have other values than those of their system."""
    lines = textwrap.wrap(f"{_heading(mechanism, changed)}: {_what(mechanism)}", _WIDTH, break_long_words=False)
    for title, text in _rows(mechanism):
        lines += textwrap.wrap(f"{title}: {text}", _WIDTH, initial_indent="  ", subsequent_indent="    ", break_long_words=False)
    return "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")


def card_html(mechanism: Mechanism, changed: Mapping[str, float], svg: str) -> str:
    """The card as HTML, beside a picture, "" for none; equations that are short unfold as MathML."""
    rows = "".join(
        f'<tr><th style="text-align: left; vertical-align: top">{title}</th><td style="text-align: left">{escape(text)}</td></tr>'
        for title, text in _rows(mechanism)
    )
    equations = (
        f"<details><summary>equations of motion</summary>{mechanism.equations_mathml}</details>" if mechanism.equations_mathml else ""
    )
    text = f"<p><b>{escape(_heading(mechanism, changed))}</b>: {escape(_what(mechanism))}</p><table>{rows}</table>{equations}"
    picture = f'<div style="flex: 0 1 20rem">{svg}</div>' if svg else ""
    return f'<div style="display: flex; flex-wrap: wrap; gap: 1rem">{picture}<div style="flex: 1 1 24rem">{text}</div></div>'


def _heading(mechanism: Mechanism, changed: Mapping[str, float]) -> str:
    values = ", ".join(_value(*parameter) for parameter in mechanism.parameters if parameter[0] in changed)
    return f"{mechanism.name} with {values}" if changed else mechanism.name


def _value(name: str, value: float, unit: str) -> str:
    """A parameter, which no line breaks."""
    return f"{name} = {number_text(value)} {unit}".rstrip().replace(" ", "\N{NO-BREAK SPACE}")


def _what(mechanism: Mechanism) -> str:
    """The first line of the description; of a system without one, its degrees of freedom."""
    first = mechanism.description.partition("\n")[0]
    return first or f"a mechanism of {mechanism.nv} coordinates"


def _rows(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    carried = grouped(zip(mechanism.joints, mechanism.coordinates, strict=True))
    yield "joints", ", ".join(joint if own == [joint] else f"{joint} ({', '.join(own)})" for joint, own in carried.items())
    if len(mechanism.parameters) > _MOST_PARAMETERS:
        yield "parameters", f"{len(mechanism.parameters):,}; .parameters has their values"
    else:
        yield "parameters", ", ".join(_value(*parameter) for parameter in mechanism.parameters)
    if mechanism.constraints is not None:
        yield "constraints", ", ".join(mechanism.constraints.names)
    if mechanism.bounded is not None:
        yield "not smooth", ", ".join(mechanism.bounded.names)
    if mechanism.driving is not None:
        yield "controls", ", ".join(mechanism.driving.rows)
    size = f"{mechanism.program.operations:,} operations"
    if not mechanism.energy_programs:
        yield "equations", f"a program of {size}, by recursion over the bodies of the file"
    else:
        yield "equations", f"{mechanism.nv}, which take {size}; .latex writes them, and .equations has them in SymPy"
