"""The interface of an engine: what an engine file says of it, how it loads a file, and how an engine file is run."""

from __future__ import annotations

import copy
import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast
from weakref import WeakKeyDictionary

from harness.arithmetic import SAFE_LINKING, KeptArithmetic
from harness.engines.interface import CompiledNumber, InvalidAnswer, NotOffered, Unsupported
from harness.engines.loaded_file import FileModel, LoadedFile, lacking
from harness.engines.reading import refuse_unexpressed
from harness.engines.request import Ending, EngineAnswers, EngineQuestion, Refused, Request, StopRule, by_joint
from harness.engines.tree_request import model_request
from harness.environments import split_name
from harness.errors import InvalidEngine
from harness.files.document.python import CannotRun, run_file
from harness.files.equalities import Constraint
from harness.files.model_file import ModelFile, document_of
from harness.files.rules import ConstraintLaw, StepRule
from harness.files.touching import ConeKind
from harness.library import FILE_FORMATS

if TYPE_CHECKING:
    from harness.engines import Model
    from harness.engines.moving import HeldNumbers, MotionsRequest, Moved, MovedFile
    from harness.environments import Environment
    from harness.files.mjcf.inertias import CompiledMesh, Number
    from harness.programs.mechanisms.mechanism import Mechanism

EQUATIONS = "equations"
FORMATS = (*FILE_FORMATS, EQUATIONS)
# Joints in a message.
MOST_NAMED = 4
_PACKAGE = Path(__file__).resolve().parents[1]
# Of an engine file that gives no engine.
_REMEDY = "mend it, or ask others alone by --subject"
# Of an engine that is a folder, the file that defines it.
FOLDER = "__init__.py"


@dataclass(frozen=True, order=True)
class Subject:
    """An engine with a model format; prints as ``engine/format``, or ``engine`` for equations."""

    engine: str
    format: str

    def __str__(self) -> str:
        return self.engine if self.format == EQUATIONS else f"{self.engine}/{self.format}"

    @property
    def without_version(self) -> Subject:
        """The same of an engine whatever its version."""
        return Subject(split_name(self.engine)[0], self.format)


class Engine:
    """The ``ENGINE`` of an engine file derives from this class.

    Attributes:
        title: the name of the program as its authors write it; "" where it is the engine's own.
        requires: importable module and distribution name of the program behind it.
        formats: of files that it reads, "mjcf", "urdf" or "usd"; "equations" where it takes the ``Mechanism``. The first is its
            native one. What a reader of another passes over, the engine file supplies from the same file or refuses.
        optional: whether not everybody installs it: where it is installed nowhere, it is asked by name alone.
        is_asked_by_name: whether it is asked by name alone wherever it is installed, as another call of a program that is asked anyway.
        oldest: the oldest version of its program that it knows, by format. companions: what versions need beside what they require
            themselves, by specifier, as ``{"<3.5": ("numpy<2.4",)}``.
        linear_velocity_in_body: whether it gives the linear velocity of a free joint in the body's own frame, and not in the joint's.
        factorises_mass_matrix: whether it solves for accelerations by a factorisation of M; without it no error is excused by M's
            condition.
        unit_roundoff: of the numbers that it computes with. One that computes in float32 says 2.0**-24: it is asked at states rounded
            to float32, and judged in data roundoffs of float32.
        has_soft_constraints: whether it documents that it does not hold constraints rigid; ``constraint_laws`` says how.

    Of any robot's file:
        call: the user's code for each format, on one line; none for an engine that no user's file is handed to.
        supplied: for each format, what an aided engine is given besides what its reader takes from the file, as a sentence.
        inertias_about: the point about which it forms inertias, where that is neither in the body nor in its joint: "tree" for the centre
            of mass of a whole tree, "world" for the origin of the world; see ``harness.truth.far_links``.
        why_off: why the call lets no elements of a kind act, by ``LeftOut.what``; none of a kind that it can be asked with, some of them
            ``Held``.
        contacts: of a file with a root element and format, the cones of friction, and why no contact of it is judged, "" where contacts
            are; None of an engine whose contacts are judged in no file.
        unjudged: of a file with a root element and format, why no answer with its elements of another kind is judged, by ``LeftOut.what``.
        beside_tau: what it makes of elements that bear on no acceleration at given tau, by ``LeftOut.what``, a sentence with its source.
        solvers: methods by which its solver of constraints goes, by its own names, that ``SolverSettings`` may choose.
        endings: settings by which its solver of constraints goes on until nothing changes, one tried after the other.
        stops: where its solver of steps stops, if nobody can set that; None where it can be set, or goes on to the end.
        step: length of the step [s] over which its accelerations are differences of velocities, of an engine that is asked by steps
            wherever something is on; None of others.
        why_no_constraints: why ``load_model`` refuses a mechanism's model with constraints; "" for an engine that holds them.
        reader: the engine whose reader of files it has, with all readings of that; "" for one of its own.

    Of one that is asked in an environment of its own:
        environment: it; None for an engine in this process.
    """

    name = ""
    title = ""
    requires: tuple[str, str] = ("", "")
    formats: tuple[str, ...] = ()
    optional = False
    is_asked_by_name = False
    oldest: Mapping[str, str] = {}
    companions: Mapping[str, Sequence[str]] = {}
    linear_velocity_in_body = False
    factorises_mass_matrix = False
    unit_roundoff = 2.0**-53
    has_soft_constraints = False
    call: Mapping[str, str] = {}
    supplied: Mapping[str, str] = {}
    inertias_about = ""
    why_off: Mapping[str, str] = {}
    contacts: Callable[[Any, str], tuple[ConeKind, str]] | None = None
    unjudged: Callable[[Any, str], Mapping[str, str]] | None = None
    beside_tau: Mapping[str, str] = {}
    solvers: tuple[str, ...] = ()
    endings: tuple[Ending, ...] = ()
    stops: StopRule | None = None
    step: float | None = None
    why_no_constraints = ""
    reader = ""
    environment: Environment | None = None

    def read(self, request: Request) -> LoadedFile:
        """Load a file once, as the engine's user does, or aided.

        Raises:
            Refused: the engine does not read it.
        """
        raise Refused(f"{self.name} reads no robots' files")

    def compiled(self, request: Request) -> tuple[CompiledNumber, ...]:
        """Numbers that the engine holds of a file as its user loads it, by its own names: all that may bear on motion.

        None where the engine file does not say.

        Raises:
            Refused: the engine does not read the file.
        """
        return ()

    def compiled_meshes(self, path: Path) -> Mapping[Number, CompiledMesh]:
        """The geoms of meshes of an MJCF by body and geom, as the engine weighs them.

        Raises:
            NotOffered: the engine file does not say. ValueError: the engine refuses the file; with its words.
        """
        raise NotOffered(f"{self.name} weighs no meshes here")

    def run(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The result of ``function(self, *arguments)``, a function of a module of the harness, where the engine is asked.

        For what asks the engine thousands of times: a request to another process costs what a small model takes for an answer.
        """
        return function(self, *arguments)

    def load(self, source: ModelFile | Mechanism | Request, joints: Sequence[str], gravity: float) -> Model:
        """Load a mechanism once; ``joints`` names the joint of each velocity; ``gravity`` [m/s^2, along -z] is for formats that hold none.

        Raises:
            Unsupported: the engine cannot express the mechanism, or a reader that is not its native one refuses the model.
            ValueError: the engine refuses the model; the message is the engine's.
        """
        handed = handed_over(source)
        if isinstance(handed, Request):
            return _model_of_file(self, handed)
        model: Model = self.load_model(require_model(handed, self.name), joints, gravity)
        return model

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> Any:
        """``load`` of a mechanism's model, which is read like any other file, aided with all that it says."""
        self.refuse(file)
        try:
            return self.read(model_request(file, joints, gravity))
        except Refused as refusal:
            raise ValueError(str(refusal)) from refusal

    def refuse(self, file: ModelFile) -> None:
        """Raises Unsupported, with lines, for what a model holds that the engine cannot and that the harness does not supply."""
        if self.why_no_constraints:
            refuse_unexpressed(file, self.why_no_constraints)

    def held_numbers(self, file: MovedFile) -> HeldNumbers:
        """Numbers that the engine holds of a file with everything on, by the causes that two motions of it may differ by.

        Raises:
            NotOffered: the engine file does not say. Refused: the engine does not read the file.
        """
        raise NotOffered("the harness exchanges no numbers that it holds")

    def moved(self, request: MotionsRequest) -> Moved:
        """Whole motions by the engine's own steps, with everything on; raises as ``held_numbers``, and ValueError of a control."""
        raise NotOffered("the harness lets it take no steps with everything on")

    def ask(self, question: EngineQuestion) -> EngineAnswers:
        """Accelerations at all states; a refusal of the file is an answer, no exception."""
        with KeptArithmetic() as arithmetic:
            try:
                loaded = self.read(question.request)
                if question.steps:
                    return EngineAnswers(states=loaded.settled(question.v, question.steps), notes=loaded.notes)
                found = loaded.answered(question.q, question.v, question.tau, *question.driving)
            except Refused as refusal:
                return EngineAnswers(refusal=str(refusal))
        if arithmetic.left:
            raise InvalidAnswer(f"it leaves {arithmetic.left} for everything behind it in the process")
        return EngineAnswers(
            by_joint(loaded.joints, found),
            notes=loaded.notes,
            contacts=tuple(loaded.contacts),
            shapes=tuple(loaded.shapes),
            seconds=tuple(loaded.seconds),
        )

    def constraint_laws(self, file: ModelFile) -> Mapping[str, ConstraintLaw]:
        """The laws that the engine documents for the constraints of a file, by name; those without one are held rigid."""
        acting = file.all_acting
        return self.laws(document_of(file).root, file.format, acting) if acting else {}

    def laws(self, root: Any, model_format: str, constraints: Sequence[Constraint]) -> Mapping[str, ConstraintLaw]:
        """The same of constraints of any file with this root element."""
        return {}

    def fuses(self, root: Any, model_format: str) -> bool:
        """True where its reader makes bodies that no joint moves one with their parents."""
        return False

    def step_rules(self, file: ModelFile) -> tuple[StepRule, ...]:
        """The rules that the engine documents of its integrators, of a file, first the file's own; none where it integrates nothing."""
        return ()

    def own_rules(self, root: Any, model_format: str) -> Sequence[StepRule]:
        """The same of any file with this root element, where users leave the steps to the engine."""
        return ()


def for_files(engine: Engine) -> Engine:
    """The same engine, asked about files that it reads by itself, for which states are converted."""
    other = copy.copy(engine)
    other.linear_velocity_in_body = False
    return other


def _model_of_file(engine: Engine, request: Request) -> Model:
    try:
        loaded = engine.read(request)
    except Refused as refusal:
        raise Unsupported(f"{engine.name} refuses the file: {refusal}") from refusal
    if names := lacking(request, loaded.joints):
        lines = {joint.name: f" (line {joint.line})" if joint.line else "" for joint in request.joints}
        named = ", ".join(f"{name!r}{lines[name]}" for name in names[:MOST_NAMED])
        named += f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        raise Unsupported(f"{engine.name} has no joint {named} after loading: its reader leaves out what holds it")
    return cast("Model", FileModel(loaded, engine.factorises_mass_matrix))


def handed_over(source: ModelFile | Mechanism | Request) -> ModelFile | Mechanism | Request:
    """The mechanism that an engine is given; of one that is a user's file, the request to load that."""
    found: ModelFile | Mechanism | Request = source if isinstance(source, ModelFile | Request) else source.handed_to_engines
    return found


def require_model(source: Any, engine: str) -> ModelFile:
    """``source`` as a model file; the error of an engine that was handed equations."""
    if not isinstance(source, ModelFile):
        raise TypeError(f"{engine} reads model files, not {type(source).__name__}")
    return source


def is_own_file(path: Path) -> bool:
    return path.is_relative_to(_PACKAGE)


def _module_name(path: Path) -> str:
    own = path.parent if path.name == FOLDER else path.with_suffix("")
    return ".".join([_PACKAGE.name, *own.relative_to(_PACKAGE).parts])


def run_engine_file(path: Path, name: str) -> Engine:
    """``ENGINE`` of an engine file, which is run in this process, under that name.

    Raises:
        InvalidEngine: the file raises, defines no ``ENGINE``, or one that is no ``Engine``.
    """
    try:
        module = importlib.import_module(_module_name(path)) if is_own_file(path) else run_file(path, f"_harness_engine_{name}")
    except CannotRun as error:
        raise InvalidEngine(error.path, error.line, f"{error.problem}; {_REMEDY}") from error
    engine: Engine | None = getattr(module, "ENGINE", None)
    if problem := _problem_of(engine):
        lines = path.read_text(encoding="utf-8").splitlines()
        line = next((number for number, text in enumerate(lines, start=1) if text.startswith("ENGINE")), None)
        raise InvalidEngine(path, line, f"{problem}; see CONTRIBUTING, add an engine; {_REMEDY}")
    assert engine is not None
    engine.name = name
    return engine


# By the class of an engine, what loading a model has made of the arithmetic of this process: a library changes it once, when it is loaded
# itself.
_LEFT_BEHIND: WeakKeyDictionary[type, str] = WeakKeyDictionary()


def load_keeping_arithmetic(engine: Engine, source: Any, joints: Sequence[str], gravity: float) -> Any:
    """The model that ``engine.load`` returns; raises what it raises.

    Raises:
        InvalidAnswer: loading leaves other arithmetic behind, or has done so before in this process.
    """
    with KeptArithmetic() as arithmetic:
        loaded = engine.load(source, joints, gravity)
    left = _LEFT_BEHIND[type(engine)] = _LEFT_BEHIND.get(type(engine)) or arithmetic.left
    if left:
        raise InvalidAnswer(f"loading it leaves {left} for everything behind it in the process: {SAFE_LINKING}")
    return loaded


def _problem_of(engine: Any) -> str:
    """Why ``ENGINE`` is no ``Engine``; "" where it is one."""
    if engine is None:
        return "defines no ENGINE"
    if not isinstance(engine, Engine):
        return f"ENGINE is a {type(engine).__name__}, expected an object of a class that derives from harness.engines.Engine"
    requires, formats = engine.requires, engine.formats
    if not (isinstance(requires, tuple | list) and len(requires) == 2 and all(isinstance(name, str) and name for name in requires)):
        return f'ENGINE has requires = {requires!r}; expected the names of the module and of the distribution, as ("mujoco", "mujoco")'
    if not (isinstance(formats, tuple | list) and formats and all(name in FORMATS for name in formats)):
        return f'ENGINE has formats = {formats!r}; expected one or more of {", ".join(FORMATS)}, as ("mjcf",)'
    return ""
