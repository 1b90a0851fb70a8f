"""Hard cases: ways in which a mechanism is numerically hard, each with one knob and the truth along it.

Every ``HardCase`` in ``CASES`` of a module of this package is found.
A case names a system of the built-in library or of the one in this folder, says how the knob changes its
parameters, which numbers of the model files follow, and at which states it is asked. The numbers are written
from the mechanism, as its model files are, never computed from the equations.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapters 1 and 7, for what makes a
problem hard; each case has its own.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene, with_parameters
from harness.engines import Model
from harness.files.model_file import Attributes, ModelFile, parse_model, read_model, with_attributes
from harness.files.text.scan import Element, Number, find_elements, with_values
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library, nearest
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.registry import declared
from harness.truth.sampling import generic_sample

POINTS = 30
# States at each point; the worst of them counts.
STATES = 8
# Of a family of ever larger systems, how often each size comes.
SEEDS = 3
# What changes may refer to beside the parameters.
KNOB = "knob"
_ADDRESS = re.compile(r"(?P<tag>\S+?)(?: (?P<name>[^/@]+))?(?P<children>(?:/[^/@]+)*)@(?P<attribute>\w*)(?:\[(?P<index>\d+)\])?")

Values = Mapping[str, float]
# The parameter that a number holds, or what it is of all parameters and the knob.
Rule = str | Callable[[Values], float]
# Address of a number to its rule.
Changes = Mapping[str, Rule]


def anywhere(mechanism: Mechanism, value: float = 0.0, seed: int = 0) -> States:
    """``STATES`` states spread over the mechanism's ranges, the same for every value of a knob that changes the model."""
    return generic_sample(mechanism, STATES, 0)


def at_each_seed(mechanism: Mechanism, value: float, seed: int) -> States:
    """``STATES`` states spread over the mechanism's ranges, others for each seed: the Sobol sequence is spread by its scrambling."""
    return generic_sample(mechanism, STATES, seed)


@dataclass(frozen=True)
class Theory:
    """The expectation of one subject along a family, by theory.

    Attributes:
        verdict: the gravest verdict.
        growth: slope of log backward error over log knob; None where theory gives none.
        digits_growth: the same of the forward relative error.
    """

    verdict: str = "agrees"
    growth: float | None = None
    digits_growth: float | None = None


@dataclass(frozen=True, kw_only=True)
class HardCase:
    """One family of hard points.

    Attributes:
        name: of the case; title: what it is, in a few words.
        system: name of the system, in this folder's library or else in the built-in one, or a function from the knob's value to it.
        knob: name and unit of what is turned; values: ``POINTS`` of them, in order; a value that comes again is
            asked at other states.
        states: (mechanism, value, seed) to the states of one point; the seed is the place of the point.
        parameters: the knob's value to the parameters that differ from the mechanism's own.
        changes: model format to the numbers of the model file that follow, by address, for example
            ``"body bar_2/inertial@diaginertia[0]"``: a tag, the element's name (or ``reference``), tags further in,
            the attribute, and the place in it.
        attributes: model format to attributes of the file that the knob sets, as of ``harness.files.model_file``, where its author
            may have written none.
        opened: moves states off the manifold of the constraints, which all others are on; only declared truths are asked for there.
        configured: an engine's model with settings that the knob's value says.
        subjects: those that the case is about; all for none.
        theory: subject to what is expected of it; a subject that is not named should agree.
        source: where that is from.
        remedy: what a user whose model is like this can do.
    """

    name: str
    title: str
    system: str | Callable[[float], str]
    knob: tuple[str, str]
    values: tuple[float, ...]
    states: Callable[[Mechanism, float, int], States] = anywhere
    parameters: Callable[[float], Values] = field(default=lambda value: {})
    changes: Mapping[str, Changes] = field(default_factory=dict)
    attributes: Mapping[str, Callable[[float], Attributes]] = field(default_factory=dict)
    opened: Callable[[States, float], States] | None = None
    configured: Callable[[Any, float], Model] | None = None
    subjects: tuple[str, ...] = ()
    theory: Mapping[str, Theory] = field(default_factory=dict)
    source: str
    remedy: str

    @property
    def library(self) -> Library:
        """The library that holds the case's systems and models."""
        own = _own_library()
        return own if self.system_at(self.values[0]) in own.system_names() else Library.built_in()

    def system_at(self, value: float) -> str:
        """Name of the system at one value of the knob."""
        return self.system if isinstance(self.system, str) else self.system(value)

    def unchanged_at(self, value: float) -> Mechanism:
        """The mechanism at one value of the knob, with parameters of its own."""
        return _mechanism(self.library, self.system_at(value))

    def mechanism_at(self, value: float) -> Mechanism:
        """The mechanism with the parameters of one value of the knob.

        Raises:
            ValueError: the case names a parameter that the mechanism has not.
        """
        mechanism, changed = self.unchanged_at(value), self.parameters(value)
        own = [name for name, _, _ in mechanism.parameters]
        for name in changed:
            if name not in own:
                raise ValueError(f"{self.name}: {mechanism.name} has no parameter {name!r}; {nearest(name, own)}")
        return with_parameters(mechanism, changed)

    def model_at(self, value: float, model_format: str) -> ModelFile:
        """The model file of one format at one value of the knob.

        Raises:
            ValueError: a change points at no number of the model.
            harness.errors.InvalidModel: the changed model is not physical.
        """
        model = _file(self.library.model_path(self.system_at(value), model_format), model_format)
        values: dict[str, float] = {KNOB: value, **{name: own for name, own, _ in self.mechanism_at(value).parameters}}
        elements = find_elements(model.text, model_format)
        numbers = {
            number_at(elements, address): float(values[rule] if isinstance(rule, str) else rule(values))
            for address, rule in self.changes.get(model_format, {}).items()
        }
        changed = parse_model(model.path, with_values(model.text, numbers), model_format) if numbers else model
        return with_attributes(changed, self.attributes[model_format](value)) if model_format in self.attributes else changed

    def scene_at(self, value: float) -> Scene:
        """The mechanism and both its models at one value of the knob; raises as ``mechanism_at`` and ``model_at``."""
        library = replace(self.library, calls_engines_here=True)
        return Scene(library, self.mechanism_at(value), {suffix: self.model_at(value, suffix) for suffix in MODEL_SUFFIXES})


# A case asks for one mechanism and one file at every value of its knob.
_mechanism = functools.lru_cache(maxsize=4)(load_mechanism)
_file = functools.lru_cache(maxsize=64)(read_model)


def number_at(elements: list[Element], address: str) -> Number:
    """The one number that ``address`` means among a model's ``elements``; see ``HardCase.changes``.

    Raises:
        ValueError: there is none.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise ValueError(f"{address!r} is no address; expected 'tag name/child@attribute[index]'")
    children = tuple(match["children"].split("/")[1:])
    for element in elements:
        if element.tag != match["tag"] or (match["name"] or None) not in (None, element.get("name"), element.get("reference")):
            continue
        wanted = (*element.path, *children)
        for inner in elements:
            if inner.path != wanted or not element.start <= inner.start < element.end:
                continue
            for attribute in inner.attributes:
                if attribute.name == match["attribute"] and len(attribute.numbers) > int(match["index"] or 0):
                    return attribute.numbers[int(match["index"] or 0)]
    raise ValueError(f"the model has no number at {address!r}")


@functools.cache
def _own_library() -> Library:
    return replace(Library.at(Path(__file__).parent), name="hard_cases")


@functools.cache
def hard_cases() -> Mapping[str, HardCase]:
    """Every case by name, in the order of the modules and of their text.

    Raises:
        ValueError: two cases have one name.
    """
    return declared(__name__, HardCase, "hard case")


def decades(low: float, high: float, count: int = POINTS) -> tuple[float, ...]:
    """``count`` values from 10^low to 10^high, evenly spaced in their logarithm."""
    return tuple(10.0 ** (low + (high - low) * i / (count - 1)) for i in range(count))


def of_sizes(sizes: Sequence[float]) -> tuple[float, ...]:
    """Values of a knob that is a size, each at ``SEEDS`` seeds."""
    return tuple(float(size) for size in sizes for _ in range(SEEDS))


def with_columns(part: Array, columns: Mapping[int, float | Array]) -> Array:
    """A copy of q, v or tau, (n, nq or nv), with other values in some columns."""
    changed = part.copy()
    for column, values in columns.items():
        changed[:, column] = values
    return changed


def varied(change: Callable[[States, float], Mapping[str, Array]]) -> Callable[[Mechanism, float, int], States]:
    """``anywhere``, but for those of q, v and tau that ``change`` gives for the states there and the knob's value."""

    def states(mechanism: Mechanism, value: float, seed: int) -> States:
        spread = anywhere(mechanism)
        return States.at(**{"q": spread.q, "v": spread.v, "tau": spread.tau, **change(spread, value)})

    return states


def posed(positions: Callable[[float], Mapping[int, float | Array]]) -> Callable[[Mechanism, float, int], States]:
    """``anywhere``, but for some columns of q, which ``positions`` gives for the knob's value."""
    return varied(lambda states, value: {"q": with_columns(states.q, positions(value))})


def inertia_numbers(body: str, link: str, moments: Mapping[str, Rule], mass: Rule | None = None) -> dict[str, dict[str, Rule]]:
    """Changes of one body's moments of inertia about some of its axes "x", "y" and "z", and of its mass."""
    mjcf = {f"body {body}/inertial@diaginertia[{'xyz'.index(axis)}]": rule for axis, rule in moments.items()}
    urdf = {f"link {link}/inertial/inertia@i{axis}{axis}": rule for axis, rule in moments.items()}
    if mass is not None:
        mjcf[f"body {body}/inertial@mass"] = urdf[f"link {link}/inertial/mass@value"] = mass
    return {"mjcf": mjcf, "urdf": urdf}


def together(parts: Sequence[Mapping[str, Changes]]) -> dict[str, Changes]:
    """All changes of several parts of a mechanism."""
    return {form: {address: rule for part in parts for address, rule in part[form].items()} for form in MODEL_SUFFIXES}


def shares(*shape: int, low: float = -1.0) -> Array:
    """Random numbers from ``low`` to 1, the same on every call."""
    return np.random.default_rng(0).uniform(low, 1, shape)


def turned(axis: tuple[float, float, float], angle: float) -> tuple[float, float, float, float]:
    """The quaternion (w, x, y, z) of a turn by ``angle`` [rad] about a unit ``axis``."""
    w, s = math.cos(angle / 2), math.sin(angle / 2)
    return w, s * axis[0], s * axis[1], s * axis[2]
