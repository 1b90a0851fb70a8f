"""Constraints that give, by numbers of a model file, as an engine documents it solves them.

Answers of such an engine are held against that *declared* problem. How far they are from rigid is a property of the model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from harness.engines import ConstraintLaw
from harness.equations.constraint_forces import Softness, softened_program
from harness.equations.constraints import Constraints
from harness.equations.mechanism import Mechanism
from harness.errors import InvalidModel
from harness.files.model_file import ModelFile
from harness.robots.inverse_weights import inverse_weights
from harness.storage import Kept


def softness_of(constraints: Constraints, laws: Mapping[str, ConstraintLaw], model: ModelFile) -> list[Softness]:
    """The law of each row of a mechanism's constraints near which it stays, by the laws that an engine declares of a model file.

    Raises:
        InvalidModel: the rows of a constraint weigh differently in the file, and the mechanism has not as many; or they have no weight.
    """
    try:
        weights = inverse_weights(model, (part for law in laws.values() for row in law.weights or () for part in row))
    except ValueError as error:
        problem = f"its constraints have no weight: {error}; correct the masses, inertias or places"
        raise InvalidModel(model.path, model.root_line, problem) from error
    rows = []
    for name in constraints.names:
        law, count = laws[name], constraints.rows.count(name)
        inverse_masses: list[float | None] = [None] * count
        if law.weights is not None:
            own = [sum(weights[part] for part in row) for row in law.weights]
            if len(own) != count and len(set(own)) > 1:
                line = next(one.line for one in model.constraints if one.name == name)
                raise InvalidModel(model.path, line, f"constraint {name!r} has {len(own)} rows of different weight; expected {count} rows")
            inverse_masses = list(own if len(own) == count else [own[0]] * count)
        impedance = law.impedance.at(0.0)
        # R = (1 - d) / d A is no less than the engine's least number.
        least = law.least_regularisation * impedance / (1 - impedance)
        rows += [
            Softness(impedance, law.stiffness, law.damping, mass if mass is None else max(mass, least), law.has_curvature)
            for mass in inverse_masses
        ]
    return rows


def softened(mechanism: Mechanism, rows: Sequence[Softness]) -> Mechanism:
    """The mechanism whose constraints give by ``rows``, one law for each row, whose numbers are its last parameters."""

    def write() -> Mechanism:
        assert mechanism.constraints is not None
        program, numbers = softened_program(mechanism.constraints, rows)
        return replace(mechanism, program=program, parameters=(*mechanism.parameters, *((name, value, "") for name, value in numbers)))

    return _SOFTENED.get((mechanism.key, tuple(rows)), write)


_SOFTENED: Kept[Mechanism] = Kept(64)
