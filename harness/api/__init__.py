"""The functions that ``import harness`` offers to scripts and notebooks; see the docstring of the package.

May use ``commands`` and what is below it.

Start with ``check``. ``load`` returns a ``loaded_system``: what it is stands in ``described_system``, and how it moves in ``motion``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, overload

from harness import workers as processes
from harness.api.findings import CheckedRecords, ComparedFiles
from harness.api.loaded_system import Accelerations, CertifiedValues, Derivatives, LoadedSystem
from harness.comparison.robot_library import resolved
from harness.comparison.study import ComparisonSettings, RobotComparison
from harness.crosscheck.assignment import refuse_robots
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import DEFAULT_STATES, Settings
from harness.diagnosis.wanted import wanted_diagnosis
from harness.engines import describe_engines
from harness.errors import InvalidRequest
from harness.explain.meant import STATES
from harness.lagrange.derivation import load_mechanism
from harness.library import Library, matching, nearest
from harness.results.comparison import FilesComparison
from harness.results.cross_check import Causes
from harness.results.records import ACCELERATIONS, quantity_words
from harness.study import complete
from harness.truth.compare import Comparison
from harness.truth.quantities import require_quantity, select_quantities
from harness.workers import Workers

if TYPE_CHECKING:
    from harness.lagrange.system import System

__all__ = [
    "Accelerations",
    "CertifiedValues",
    "Derivatives",
    "LoadedSystem",
    "check",
    "compare",
    "diagnose",
    "load",
    "mechanisms",
]
Names = str | Path | Sequence[str | Path]
Subjects = str | Sequence[str]


def mechanisms(library: str | Path | None = None) -> list[str]:
    """Names of the mechanisms of a library, of the built-in one for None.

    Raises:
        harness.errors.InvalidInput: the library cannot be used.

    Examples:
        >>> import harness
        >>> harness.mechanisms()[:3]
        ['acrobot', 'andrews_squeezer', 'arm_2r']
    """
    return Library.at(library).system_names()


def load(name: str | Path | System, library: str | Path | None = None, *, floating_base: bool = False) -> LoadedSystem:
    """The mechanism ``name`` of a library, of the built-in one for None; the robot in the URDF or MJCF file ``name``; or a ``System``.

    A ``System`` needs no files: its equations and certified numbers can be had at once. ``floating_base`` puts a free joint under the
    root of a robot's URDF.

    Raises:
        harness.errors.InvalidInput: library, system file or robot's file cannot be used.
        harness.errors.InvalidRequest: no such mechanism, or a ``System`` of which no equations can be derived.

    Examples:
        >>> import harness
        >>> harness.load("simple_pendulum")
        simple_pendulum: Point mass on a massless rod that swings about a fixed pin.
          joints: pin (theta)
          parameters: m = 1.5 kg, L = 2 m, g = 9.81 m/s^2
          equations: 1, which take 6 operations; .latex writes them, and .equations has them in SymPy
    """
    if not isinstance(name, str | Path):
        return _load_system(name)
    found = resolved(Library.at(library), [str(name)], floating_base)
    (name,) = found.select([str(name)])
    return LoadedSystem(found, load_mechanism(found, name))


def _load_system(system: System) -> LoadedSystem:
    from harness.lagrange.derivation import mechanism_of_charts
    from harness.lagrange.system import System

    if not isinstance(system, System):
        raise InvalidRequest(f"load takes a name, a path or a System, and got {system!r}")
    try:
        mechanism = mechanism_of_charts([system], "SYSTEM")
    except (ValueError, TypeError) as problem:
        raise InvalidRequest(f"no equations can be derived: {problem}") from problem
    return LoadedSystem(None, mechanism, system.in_joint_positions() if system.measured_from else system)


class Options(TypedDict, total=False):
    """The choice of what ``check`` and ``diagnose`` run, and on what.

    Attributes:
        library: a folder or an installed library's name; the built-in one for None.
        mjcf, urdf: stand in for the one system's models. subjects: as "mujoco/mjcf"; all for none.
        states: per system, 1000 by default. seed: of the sampled ones, 0 by default.
        workers: processes; one per CPU for None. time_limit: of one task [s], 60 by default.
        floating_base: whether a free joint is put under the roots of robots' URDFs.
        aided: whether engines are supplied with what they leave out of robots' files.
        worlds: equal ones that every subject is asked for at once, whether they answer alike; 0 for none, the default.
    """

    library: str | Path | None
    mjcf: str | Path | None
    urdf: str | Path | None
    subjects: Subjects
    states: int
    seed: int
    workers: int | None
    time_limit: float
    floating_base: bool
    aided: bool
    worlds: int


def check(names: Names = (), *, quantities: str | Sequence[str] = (), **options: Unpack[Options]) -> CheckedRecords:
    """Cross-check mechanisms, all of the library and the variants of their models for none, on worker processes; or robots.

    Args:
        names: of mechanisms, of variants as "acrobot.frames", and patterns as "acrobot*"; or paths of robots' files, URDF or MJCF.
        quantities: as "mass_matrix", "reactions" or "accelerations"; accelerations for none, and "all" stands for all.
        options: those of ``harness.api.Options``.

    Raises:
        harness.errors.InvalidInput: a library, system or model file cannot be used; the first of them.
        harness.errors.InvalidRequest: a name that nothing has.

    Examples:
        >>> import harness
        >>> records = harness.check("simple_pendulum", subjects=["mujoco/mjcf", "pinocchio/urdf"], states=20)
        >>> [(record.subject, record.verdict) for record in records]
        [('mujoco/mjcf', 'agrees'), ('pinocchio/urdf', 'agrees')]
    """
    settings = _settings(names, options)
    chosen = select_quantities([quantities] if isinstance(quantities, str) else quantities)
    with _checked(settings, options, chosen) as (studies, _):
        for problem in (problem for study in studies for problem in study.problems):
            raise problem
        return CheckedRecords(record for study in studies for record in study.result().records)


def diagnose(name: str, *, quantity: str = ACCELERATIONS, **options: Unpack[Options]) -> Causes:
    """Why records of ``name`` are not as expected in one quantity, a ``Cause`` each; none where all are. Options as of ``check``.

    What the audit refuses of a file, which is another mechanism than the system's, is in the causes.

    Raises:
        harness.errors.InvalidInput: the library, the system file or a model file that was given cannot be used.
        harness.errors.InvalidRequest: as ``check``; a robot, and another quantity than accelerations.

    Examples:
        >>> import harness
        >>> harness.diagnose("simple_pendulum", states=20)
        nothing to explain: every record is as expected
    """
    require_quantity(quantity)
    settings = _settings([name], options)
    if quantity_words(quantity):
        refuse_robots(settings.library, name, quantity)
    with _checked(settings, options, [quantity]) as ([study], pool):
        diagnoses = wanted_diagnosis(study, quantity)
        return Causes(() if diagnoses is None else complete(diagnoses, pool))


@overload
def compare(
    name: str, q: Any, v: Any, accelerations: Any, tau: Any = None, *, factorises: bool = False, library: str | Path | None = None
) -> Comparison: ...


@overload
def compare(
    name: str | Path,
    *others: str | Path,
    floating_base: bool = False,
    renamed: Mapping[str, str] | None = None,
    without: Sequence[str] = (),
    states: int = STATES,
    seed: int = 0,
    workers: int | None = None,
    time_limit: float = 300.0,
) -> ComparedFiles: ...


def compare(name: str | Path, *others: Any, **options: Any) -> Comparison | ComparedFiles:
    """Compare a robot's files and engines on them, or hold anybody's accelerations of a mechanism against the truth.

    With paths alone, as ``compare("robot.urdf", "robot.xml")``, it is what ``harness compare`` does: files, subjects with the readings
    that explain them, and pairs of files. ``renamed`` is {joint of the first file: its name in another}; joints of ``without`` stand still
    where files are held against each other.

    With ``compare(name, q, v, accelerations)`` these are answers for the mechanism ``name``, as of ``LoadedSystem.compare``.

    Raises:
        harness.errors.InvalidInput: a file cannot be used; the first of them.
        ValueError: the sizes are not those of the mechanism; and as ``load``.

    Examples:
        >>> import harness
        >>> models = harness.Library.built_in()
        >>> found = harness.compare(models.model_path("arm_2r", "urdf"), models.model_path("arm_2r", "mjcf"), states=8)
        >>> found.pairs[0].same
        True
    """
    if all(isinstance(other, str | Path) for other in others) and "accelerations" not in options:
        return _compare_robots([Path(path) for path in (name, *others)], **options)
    library = options.pop("library", None)
    return load(str(name), library).compare(*others, **options)


def _compare_robots(
    paths: Sequence[Path], *, renamed: Mapping[str, str] | None = None, workers: int | None = None, time_limit: float = 300.0, **chosen: Any
) -> ComparedFiles:
    study = RobotComparison(ComparisonSettings(paths, renamed=renamed or {}, **chosen))
    with processes.Workers(workers, time_limit=time_limit) as pool:
        found: FilesComparison = complete(study, pool)
    for problem in study.problems:
        raise problem
    return ComparedFiles(**vars(found))


@contextmanager
def _checked(settings: Settings, options: Options, quantities: Sequence[str]) -> Iterator[tuple[list[CrossCheck], Workers]]:
    """The complete cross-check of each quantity, and the workers that ran them."""

    def workers() -> Workers:
        return processes.Workers(options.get("workers"), time_limit=options.get("time_limit", 60.0))

    describe_engines(settings.library, workers, settings.subjects)
    studies = [CrossCheck(settings, [name], audits=False) for name in quantities]
    with workers() as pool:
        for study in studies:
            complete(study, pool)
        yield studies, pool


def _with_files(name: object) -> str:
    """The name of a mechanism with model files, or the path of a robot's."""
    if isinstance(name, str | Path):
        return str(name)
    if isinstance(name, LoadedSystem) and name.library is not None:
        raise InvalidRequest(f"mechanisms are checked by their names; write {name.name!r} for what was loaded")
    raise InvalidRequest(
        f"a {type(name).__name__} has no model files, which engines are asked about; write three into a folder, systems/NAME.py, which "
        f"defines it as SYSTEM, mjcf/NAME.xml and urdf/NAME.urdf (harness new NAME --library FOLDER makes all three to start from), and "
        f"give their name: check('NAME', library='FOLDER')"
    )


def _settings(names: Names, options: Options) -> Settings:
    if unknown := sorted(options.keys() - Options.__annotations__.keys()):
        raise TypeError(f"got an unexpected keyword argument {unknown[0]!r}; {nearest(unknown[0], Options.__annotations__)}")
    given = {name: str(path) for name in ("library", "mjcf", "urdf") if (path := options.get(name)) is not None}
    floating_base, aided, subjects = options.get("floating_base", False), options.get("aided", False), options.get("subjects", ())
    chosen = [_with_files(name) for name in (names if isinstance(names, Iterable) and not isinstance(names, str) else [names])]
    found = resolved(Library.at(given.get("library")), chosen, floating_base, aided, acts=True)
    return Settings(
        library=found,
        names=matching(found, chosen),
        subjects=[subjects] if isinstance(subjects, str) else list(subjects),
        states=options.get("states", DEFAULT_STATES),
        seed=options.get("seed", 0),
        stand_ins={name: Path(path) for name, path in given.items() if name != "library"},
        examples=None,
        worlds=options.get("worlds", 0),
        replay_options=[
            *(word for name, path in given.items() for word in (f"--{name}", path)),
            *["--floating-base"] * floating_base,
            *["--aided"] * aided,
        ],
    )
