"""From a system file to its ``Mechanism``, through a disk cache.

An entry is JSON under a name that hashes the system's source, the sources of this room and the library versions;
one that is damaged is derived again and replaced.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import hashlib
import math
import sys
import time
import tokenize
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from harness.errors import InvalidSystem
from harness.files.document.python import CannotRun, raised_in, run_file
from harness.library import Library, member_of
from harness.programs.mechanisms.applied_forces import forces_of
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import DEFAULT_RATES
from harness.storage import cache_directory, read_entry, sources_digest, write_entry
from harness.version import version_of

if TYPE_CHECKING:
    import sympy as sp

    from harness.lagrange.equations import EquationsOfMotion
    from harness.lagrange.system import System
    from harness.programs.program import StraightLineProgram

MOST_INSTRUCTIONS_READ = 200
_VERSIONED = ("sympy", "python-flint", "numpy")


def load_mechanism(library: Library, name: str) -> Mechanism:
    """The mechanism of system ``name``, or of a variant's system, from the cache where that is sound, else derived and cached.

    Raises:
        InvalidSystem: the file cannot be read, raises, lacks ``SYSTEM`` or contradicts itself. InvalidModel: a robot's file is of no use.
    """
    own: Mechanism | None = library.own_mechanism(name)
    if own is not None:
        return own
    name = library.system_of(name)
    path, entry = library.system_path(name), _entry(library, name)
    with contextlib.suppress(ValueError, RecursionError):
        cached = Mechanism.from_json(read_entry(entry) or "")
        if cached.name == name:
            return cached
    mechanism = derive_mechanism(path, name)
    write_entry(entry, mechanism.to_json())
    return mechanism


def degrees_of_freedom(library: Library, name: str, note: object = None) -> tuple[int, str]:
    """Number of coordinates of system ``name`` and the first line of its description; nothing is derived for them.

    Raises:
        InvalidSystem: as ``load_mechanism``, but for what only a derivation finds.
    """
    if kept := kept_degrees_of_freedom(library, name):
        return kept
    (system, *_), docstring = load_atlas(library.system_path(name))
    listed = len(system.coordinates), docstring.strip().splitlines()[0]
    write_entry(_entry(library, name, "listed"), msgspec.json.encode(listed).decode())
    return listed


def kept_degrees_of_freedom(library: Library, name: str) -> tuple[int, str] | None:
    """``degrees_of_freedom`` from the cache, without running the system file; None where it is not there."""
    with contextlib.suppress(msgspec.DecodeError, InvalidSystem):
        return msgspec.json.decode(read_entry(_entry(library, name, "listed")) or "", type=tuple[int, str])
    return None


def _entry(library: Library, name: str, kind: str = "mechanisms") -> Path:
    """Entry of the cache for what is made of a system file.

    Raises:
        InvalidSystem: the file cannot be read.
    """
    path = library.system_path(name)
    file, _ = member_of(path) or (path, None)
    try:
        source = file.read_bytes()
    except OSError as error:
        raise InvalidSystem(path, None, f"cannot be read: {error.strerror}") from error
    helpers = b"".join(helper.read_bytes() for helper in sorted(path.parent.glob("_*.py")))
    digest = hashlib.sha256(_toolchain_digest() + name.encode() + b"\0" + source + b"\0" + helpers).hexdigest()
    return cache_directory() / kind / f"{name}-{digest[:32]}.json"


def derive_mechanism(path: Path, name: str) -> Mechanism:
    """Derive the system in ``path`` without looking at the cache.

    Raises:
        InvalidSystem: as ``load_mechanism``.
    """
    atlas, docstring = load_atlas(path)
    file, _ = member_of(path) or (path, None)
    try:
        mechanism = mechanism_of_charts(atlas, name, docstring)
    except Exception as error:
        kind = "" if isinstance(error, ValueError | TypeError) else f"{type(error).__name__}: "
        raise InvalidSystem(file, _line_of_declaration(file), f"cannot be derived: {kind}{error}") from error
    return mechanism if mechanism.equations_text else replace(mechanism, energies_text=_energies_text(file))


def mechanism_of_charts(atlas: Sequence[System], name: str, docstring: str = "") -> Mechanism:
    """The mechanism of a system that is given in each of its charts; ``docstring`` is that of a system file.

    Raises:
        ValueError, TypeError: the system cannot be derived.
    """
    from harness.lagrange.assembly import bounds_of, constraints_of, driving_of, energy_program_of, lagrange_program, program_of
    from harness.lagrange.equations import derive, in_symbols, printed
    from harness.programs.mechanisms.constraint_forces import by_multipliers, constrained_program

    system = atlas[0]
    started = time.perf_counter()
    derived = [_derived(chart) for chart in atlas]
    _, equations, program = derived[0]
    # Longer equations are not worth the time, and nobody would read them.
    text, mathml = printed(equations) if equations is not None and _is_short(program) else ("", "")
    free = any(attitude.position for attitude in system.attitudes)
    in_body = tuple(lagrange_program(chart, True) or program_of(chart, derive(chart), True) for chart, *_ in derived if free)
    energies = tuple(energy_program_of(chart, of_chart or in_symbols(chart)) for chart, of_chart, _ in derived)
    constraints = constraints_of(system, program) if system.constraints else None
    tree, program = program, program if constraints is None else constrained_program(constraints, by_multipliers)
    seconds = time.perf_counter() - started
    description, _, reference = docstring.partition("Source:")
    coordinates = list(system.coordinates)
    attitudes = [coordinates.index(attitude.angles[0]) for attitude in system.attitudes]
    position_ranges = [_floats(system.ranges.get(q)) for q in coordinates]
    rate_ranges = [_floats(system.ranges.get(rate)) or DEFAULT_RATES for rate in system.rates]
    return Mechanism(
        name=name,
        description=description.strip(),
        source=" ".join(reference.split()),
        coordinates=tuple(q.func.__name__ for q in coordinates),
        joints=tuple(system.coordinates.values()),
        **_values_of(system),
        rotating=system.rotating,
        position_ranges=tuple(position_ranges),
        rate_ranges=tuple(rate_ranges),
        **forces_of(tree, _numbers(system), position_ranges, rate_ranges, attitudes),
        attitudes=tuple(attitudes),
        other_charts=tuple(program for _, _, program in derived[1:]),
        charts_in_body=in_body,
        energy_programs=energies,
        start=_start(system),
        constraints=constraints,
        bounded=bounds_of(system, tree) if system.dry_friction or system.limits else None,
        dry_friction=tuple((f"dry friction of joint {system.coordinates[q]}", one.name) for q, one in system.dry_friction.items()),
        driving=driving_of(system, program) if system.actuators else None,
        program=program,
        equations_text=text,
        equations_mathml=mathml,
        derivation_seconds=seconds,
    )


def with_values_of(mechanism: Mechanism, system: System) -> Mechanism:
    """The mechanism of a system that differs from its own in the values of parameters alone; nothing is derived for it."""
    tree = mechanism.program if mechanism.constraints is None else mechanism.constraints.tree
    forces = forces_of(tree, _numbers(system), mechanism.position_ranges, mechanism.rate_ranges, mechanism.attitudes)
    return replace(mechanism, **_values_of(system), **forces)


def _values_of(system: System) -> dict[str, Any]:
    """Fields of a ``Mechanism`` that are values of parameters, or follow from these."""
    import sympy as sp

    exact = {symbol: sp.Rational(value) for symbol, (value, _) in system.parameters.items()}
    return {
        "parameters": tuple((symbol.name, float(value), unit) for symbol, (value, unit) in system.parameters.items()),
        "gravity": float(system.parameters[system.gravity][0]) if system.gravity is not None else 0.0,
        "total_mass": float(system.total_mass.subs(exact)),
    }


def _numbers(system: System) -> list[float]:
    return [float(value) for value, _ in system.parameters.values()]


def equations_of(system: System) -> EquationsOfMotion:
    """The equations of a system in the positions of its joints, in their short forms unless they are too long to be read."""
    from harness.lagrange.equations import derive

    written, equations, _ = _derived(system.in_joint_positions() if system.measured_from else system)
    return equations or derive(written)


def _derived(system: System) -> tuple[System, EquationsOfMotion | None, StraightLineProgram]:
    """The system as it was derived, its equations in SymPy unless they are too long to be read, and their program."""
    from harness.lagrange.assembly import lagrange_program, program_of
    from harness.lagrange.equations import derive

    program = lagrange_program(system)
    if program is not None and not _is_short(program):
        return system, None, program
    equations = derive(system)
    if program is not None and system.attitudes:
        # In the velocities of the joints; no simplification in the angles leaves fewer instructions.
        return system, equations, program
    program = program_of(system, equations)
    if _is_short(program):
        if system.measured_from:
            system = system.in_joint_positions()
            equations = derive(system)
        equations = equations.simplified()
        program = program_of(system, equations)
    return system, equations, program


def _start(system: System) -> tuple[tuple[float, float], ...]:
    if not system.start:
        return ()
    pairs = zip(system.coordinates, system.rates, strict=True)
    return tuple((float(system.start.get(q, 0.0)), float(system.start.get(rate, 0.0))) for q, rate in pairs)


def _energies_text(path: Path) -> str:
    """The statements of a system's file after its docstring, and the helpers in its folder that it imports."""
    source = _source(path)
    body = ast.parse(source).body
    imported = [node.module for node in body if isinstance(node, ast.ImportFrom) and node.module]
    imported += [alias.name for node in body if isinstance(node, ast.Import) for alias in node.names]
    helpers = [path.with_name(f"{name}.py") for name in imported if path.with_name(f"{name}.py").is_file()]
    own = "\n".join(source.splitlines()[body[0].end_lineno :]).strip()
    return "\n\n\n".join([own, *(f"# {helper.name}\n{_source(helper).strip()}" for helper in helpers)])


def _source(path: Path) -> str:
    with tokenize.open(path) as stream:
        return stream.read()


def _is_short(program: StraightLineProgram) -> bool:
    return len(program.instructions) <= MOST_INSTRUCTIONS_READ


def load_system(path: Path) -> tuple[System, str]:
    """``SYSTEM``, or a family's member, in the positions of its joints, and the module docstring of a system file.

    Raises:
        InvalidSystem: with the line at fault.
    """
    (system, *_), docstring = load_atlas(path)
    return system.in_joint_positions() if system.measured_from else system, docstring


def load_atlas(path: Path) -> tuple[tuple[System, ...], str]:
    """The system of a file in each of its charts, and the module docstring.

    ``ATLAS`` lists the same system in several Euler angles, that of ``SYSTEM`` first; a file without one
    has the chart of ``SYSTEM`` only.

    Raises:
        InvalidSystem: with the line at fault.
    """
    from harness.lagrange.system import System

    file, size = member_of(path) or (path, None)
    try:
        with _exact_numbers():
            module = run_file(file, f"_harness_system_{file.stem}")
            found = getattr(module, "SYSTEM", None)
            if size is not None and callable(getattr(module, "system", None)):
                try:
                    found = module.system(size)
                except Exception as error:
                    raise raised_in(file, error) from error
    except CannotRun as error:
        raise InvalidSystem(error.path, error.line, error.problem) from error
    if found is None:
        raise InvalidSystem(file, None, "defines no SYSTEM; expected SYSTEM = System(...), or SIZES and system(n)")
    if not isinstance(found, System):
        line = _line_of_declaration(file)
        raise InvalidSystem(file, line, f"SYSTEM is a {type(found).__name__}; expected a harness.System")
    if not (module.__doc__ and "Source:" in module.__doc__):
        problem = "has no docstring with a 'Source:' line; say what the mechanism is, its zero and axes, and where it is from"
        raise InvalidSystem(file, 1, problem)
    atlas = tuple(getattr(module, "ATLAS", (found,)))
    alike = [isinstance(chart, System) and _same_but_for_angles(chart, found) for chart in atlas]
    if not atlas or atlas[0] is not found or not all(alike):
        raise InvalidSystem(file, None, "ATLAS must list SYSTEM first, then systems with the same joints, parameters and total mass")
    return atlas, module.__doc__


@contextlib.contextmanager
def _exact_numbers() -> Iterator[None]:
    """Within, SymPy takes a float of Python for the rational number that it is, so that no product of it is rounded."""
    import sympy as sp
    from sympy.core.sympify import converter

    def exact(value: float) -> sp.Expr:
        return sp.Rational(*value.as_integer_ratio()) if math.isfinite(value) else sp.Float(value)

    before = converter.get(float)
    converter[float] = exact
    try:
        yield
    finally:
        if before is None:
            del converter[float]
        else:
            converter[float] = before


def _same_but_for_angles(chart: System, system: System) -> bool:
    same = ("parameters", "total_mass", "gravity")
    return list(chart.coordinates.values()) == list(system.coordinates.values()) and all(
        getattr(chart, name) == getattr(system, name) for name in same
    )


def _line_of_declaration(path: Path) -> int | None:
    for node in ast.parse(path.read_bytes()).body:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        if any(isinstance(target, ast.Name) and target.id == "SYSTEM" for target in targets) or getattr(node, "name", "") == "system":
            return node.lineno
    return None


def _floats(bounds: tuple[float, float] | None) -> tuple[float, float] | None:
    return None if bounds is None else (float(bounds[0]), float(bounds[1]))


@functools.cache
def _toolchain_digest() -> bytes:
    digest = hashlib.sha256(sys.version.encode() + sources_digest("lagrange", "programs"))
    for distribution in _VERSIONED:
        digest.update(f"{distribution}={version_of(distribution)}".encode())
    return digest.digest()
