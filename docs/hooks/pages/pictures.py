"""Pictures of the pages on concepts, computed when the documentation is built."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

import numpy as np

import harness
from harness.show.line_chart import draw_lines
from harness.verdict import AGREEMENT
from pages.gallery import drawn
from pages.made import REPOSITORY, Made

SECTION = "Concepts"
FOLDER = "concepts/pictures"
STATES = 50
# Looks of a drawing of boxes, legible on a light and on a dark page.
BOXES = (
    "rect { fill: #f5f6f8; stroke: #58616c; } text { fill: #1c2127; font: 13px system-ui, sans-serif; text-anchor: middle; } "
    "path { stroke: #58616c; fill: none; stroke-width: 1.5; marker-end: url(#tip); } .back { fill: #fff; stroke: none; }"
)


def pages() -> Made:
    """The pictures, by the names that the pages use."""
    pictures = {
        "truth.svg": flow(),
        "data-roundoff.svg": wrong_mass(),
        "verdicts.svg": axis_of_verdicts(),
        "four-bar.svg": drawn(REPOSITORY / "mjcf" / "four_bar.xml"),
        "soft.svg": what_gives(),
    }
    return Made({f"{FOLDER}/{name}": svg for name, svg in pictures.items()})


def wrong_mass() -> str:
    """The worst backward error over states where one mass of a double pendulum is wrong, over its relative error."""
    random = np.random.default_rng(0)
    q, v = random.uniform(-math.pi, math.pi, (STATES, 2)), random.uniform(-3, 3, (STATES, 2))
    pendulum = harness.load("double_pendulum")
    mass = pendulum.parameters["m2"].value
    relative = 10.0 ** np.arange(-15, -5.75, 0.25)
    errors = []
    for wrong in relative:
        answers = pendulum.with_parameters(m2=mass * (1 + wrong)).accelerations(q, v).value
        errors.append(max(harness.compare("double_pendulum", q, v, answers).backward_error))
    lines = {"mass m2 wrong": np.log10(errors), "limit": np.full(len(relative), math.log10(AGREEMENT))}
    return draw_lines(
        np.log10(relative),
        [("log10 of data roundoffs", lines)],
        "log10 of the relative error of the mass",
        "Backward error of a wrong mass",
    ).svg


def what_gives() -> str:
    """The share of the way from the unconstrained to the reference acceleration that a constraint leaves, over its impedance."""
    impedance = np.linspace(0.9, 0.9999, 200)
    label = "share that is left, in %"
    return draw_lines(impedance, [(label, {"1 - d": 100 * (1 - impedance)})], "impedance d of solimp", "What a constraint leaves").svg


def axis_of_verdicts() -> str:
    """The range of backward errors, with what each part of it means and where engines stand on three mechanisms."""
    width, left, right, decades = 720.0, 40.0, 680.0, 16

    def place(error: float) -> float:
        return left + (right - left) * max(0.0, math.log10(error)) / decades

    limit = place(AGREEMENT)
    parts = [
        f'<rect x="{left}" y="60" width="{limit - left:.1f}" height="26" style="fill:#cfe8d5"/>',
        f'<rect x="{limit:.1f}" y="60" width="{place(1e13) - limit:.1f}" height="26" style="fill:#f6e3b4"/>',
        f'<rect x="{limit:.1f}" y="86" width="{right - limit:.1f}" height="26" style="fill:#f3c6c2"/>',
        f'<text x="{(left + limit) / 2:.1f}" y="78">agrees</text>',
        f'<text x="{(limit + place(1e13)) / 2:.1f}" y="78">unstable: lost digits that the condition of M explains</text>',
        f'<text x="{(limit + right) / 2:.1f}" y="104">explained, misreads: a reading does. disagrees: nothing does</text>',
    ]
    for error in (1, 64, 1e4, 1e8, 1e12, 1e16):
        label = "1" if error == 1 else "64" if error == 64 else f"1e{round(math.log10(error))}"
        parts.append(f'<text x="{place(error):.1f}" y="132">{label}</text>')
    row = 44.0
    for record in harness.check(["double_pendulum", "puma_560", "chain_12"], states=STATES, quantities=["accelerations"]):
        if record.subject in ("mujoco/mjcf", "pinocchio/urdf") and record.backward_error:
            colour = "#b35900" if record.subject.startswith("mujoco") else "#0b5fa5"
            title = escape(f"{record.system}, {record.subject}: {record.verdict}")
            parts.append(
                f'<circle cx="{place(record.backward_error):.1f}" cy="{row}" r="5" style="fill:{colour}"><title>{title}</title></circle>'
            )
    parts.append(
        '<circle cx="60" cy="16" r="5" style="fill:#b35900"/><text x="98" y="20">MuJoCo</text>'
        '<circle cx="150" cy="16" r="5" style="fill:#0b5fa5"/><text x="193" y="20">Pinocchio</text>'
    )
    parts.append(f'<text x="{width / 2}" y="154">backward error, in data roundoffs</text>')
    return boxed(parts, width, 164, "Verdicts over the backward error")


def flow() -> str:
    """How energies, files and engines come together."""
    names: Sequence[tuple[str, float, float, float]] = (
        ("energies of a textbook", 20, 20, 170), ("SymPy: equations", 230, 20, 140), ("or the file's own numbers", 20, 70, 170),
        ("MJCF, URDF", 20, 150, 170), ("engine: MuJoCo, Pinocchio, ...", 230, 150, 200), ("certified truth, with a bound", 480, 45, 200),
        ("answer", 480, 150, 200), ("backward error, verdict", 500, 220, 160),
    )  # fmt: skip
    parts = []
    for text, x, y, wide in names:
        parts.append(
            f'<rect x="{x}" y="{y}" width="{wide}" height="32" rx="4"/><text x="{x + wide / 2}" y="{y + 20}">{escape(text)}</text>'
        )
    for line in (
        "M190 36H226", "M370 36L476 56", "M190 86L476 66", "M105 150V106", "M190 166H226", "M430 166H476", "M580 182V216",
        "M660 77C710 120 700 200 664 230",
    ):  # fmt: skip
        parts.append(f'<path d="{line}"/>')
    return boxed(parts, 720, 264, "From energies and files to a verdict")


def boxed(parts: Sequence[str], width: float, height: float, title: str) -> str:
    """An SVG file of boxes, texts and arrows."""
    tip = (
        '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0L8 4L0 8z" style="fill:#58616c;stroke:none"/></marker>'
    )
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" role="img"><title>{escape(title)}</title>'
    ground = f'<rect class="back" width="{width:g}" height="{height:g}"/>'
    return f"{head}<style>{BOXES}</style><defs>{tip}</defs>{ground}{''.join(parts)}</svg>"
