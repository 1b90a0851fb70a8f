"""A subject on a mechanism, what it is asked for, and the truth that its answers are held against."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import EQUATIONS, ConstraintLaw, Misread, Model, NotOffered, Subject, load_engine, load_model, runs_elsewhere
from harness.engines.interface import acting_as, audit, require_constraints
from harness.errors import InvalidModel, InvalidRequest
from harness.files.equalities import Constraint, Equality
from harness.files.findings import ACTUATORS, FRICTION, LIMITS
from harness.files.model_file import ModelFile, read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library, Stance
from harness.programs.mechanisms.mechanism import Mechanism, smooth, undriven, without
from harness.programs.states import States
from harness.results.records import ACCELERATIONS
from harness.storage import Kept
from harness.trees.mechanism import RobotMechanism
from harness.truth.compare import Certified, Comparison, Flags, compare
from harness.truth.quantities import Quantity, Truth, TruthBasis, find_quantities
from harness.truth.quantities.accelerations import AccelerationTruth, with_all
from harness.truth.reference import ReferenceKernel
from harness.verdict import Verdict

if TYPE_CHECKING:
    from harness.explain.as_read import FileAsRead
    from harness.explain.changes.departures import Departure
    from harness.explain.touching_truth import ContactSource


@dataclass(frozen=True)
class Assignment:
    """One subject on one mechanism.

    Attributes:
        mechanism: with all on with which answers are judged, where it is a user's file of which that ``acts``.
        model: the file that the engine reads, with the actuators, dry friction and limits of the mechanism; None for an engine that is
            handed the mechanism itself.
        system: the system or variant whose own file is the truth of quantities that take the numbers of one; "" for the mechanism's.
        quantity: the name of what is asked for.
        declared: the file whose numbers are the truth, by default ``declared_model``.
        departures: names of the engine's departures from the law that it documents of constraints, as which its truth is meant.
    """

    library: Library
    subject: Subject
    mechanism: Mechanism
    model: ModelFile | None
    system: str = ""
    quantity: str = ACCELERATIONS
    declared: ModelFile | None = None
    departures: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.model is not None:
            object.__setattr__(self, "model", acting_as(self.model, self.mechanism))
        if self.acts and isinstance(self.mechanism, RobotMechanism) and not self.mechanism.reader:
            object.__setattr__(self, "mechanism", _with_all_on(self.library, self.subject.engine, self.mechanism))

    @classmethod
    def of(cls, library: Library, name: str, subject: Subject, path: Path | None = None) -> Assignment:
        """The subject on system ``name`` with the model at ``path``, by default the library's own.

        Raises:
            InvalidInput: the system or its model cannot be used.
        """
        file = path or library.validated_models(name).get(subject.format)
        model = None if subject.format == EQUATIONS or file is None else read_model(file, subject.format)
        return cls(library, subject, load_mechanism(library, name), model, name)

    def about(self, quantity: str) -> Assignment:
        """The same about another quantity: few are asked for where actuators, dry friction, limits or equalities act."""
        about = replace(self, quantity=quantity)
        if about.asked.is_default or about.acts or about._steps_with_limits:
            return about
        mechanism = self.mechanism
        return replace(about, mechanism=mechanism.smooth if isinstance(mechanism, RobotMechanism) else smooth(mechanism))

    @property
    def _steps_with_limits(self) -> bool:
        """True for steps of an engine that has limits of joints on in each."""
        bounded = self.mechanism.bounded
        if not self.asked.has_step_rules or self.model is None or bounded is None:
            return False
        if all(_kind_of(self.mechanism, name) == FRICTION for name in bounded.names):
            return False
        return any(rule.limited is not None for rule in load_engine(self.library, self.subject.engine).step_rules(self.model))

    @property
    def acts(self) -> bool:
        """True where all of a user's file acts with which answers are judged; one that is aided has its actuators alone."""
        return self.library.acts and self.asked.takes_all and self.library.stance == Stance.PLAIN

    @property
    def as_read(self) -> Assignment:
        """The same about the mechanism that the engine computes with, whose states ``into`` gives: of a user's file what its reader has.

        Raises:
            harness.engines.Unsupported: as it reads the file, nothing has an acceleration.
        """
        if not self.library.reads_files:
            return self
        read = self.file_as_read.computed
        return self if read is self.mechanism else replace(self, mechanism=read)

    def into(self, states: States) -> States:
        """States of the mechanism, over the joints of that which the engine computes with."""
        return states if self.as_read is self else self.file_as_read.into(states)

    @property
    def in_equations(self) -> Mechanism:
        """The mechanism that an engine of equations is handed, with its actuators, or with rigid dry friction and limits."""
        return with_all(self.as_read.mechanism)

    @property
    def file_as_read(self) -> FileAsRead:
        """The file as the subject's reader has it."""
        # Imported late: a run that is about mechanisms, and in which all is well, needs nothing of it.
        from harness.explain.as_read import read_file

        return read_file(self.library, self.subject.engine, self.mechanism, self.model, self.quantity)

    @property
    def title(self) -> str:
        """The subject, and the quantity where it is not the usual one."""
        return str(self.subject) if self.asked.is_default else f"{self.subject} {self.quantity}"

    @property
    def asked(self) -> Quantity:
        """The quantity that is asked for."""
        return find_quantities()[self.quantity]

    @property
    def truth(self) -> Truth:
        """The truth that the answers are held against; raises as ``truth_of``."""
        return truth_of(self)

    def answers(self, states: States) -> Array:
        """Those of the subject; raises as ``load_audited`` and ``Truth.answers``."""
        return self.truth.answers(load_audited(self), states)

    def judge(self, states: States, certified: Certified | None = None) -> Comparison:
        """The judgement of the subject's answers at ``states``, by the certified values there where they are known."""
        truth = self.truth
        certified = truth.evaluate(states) if certified is None else certified
        return truth.asked_and_judged(certified, states, load_audited(self))

    def judge_all(self, states: States, certified: Certified, found: Any) -> Comparison:
        """The judgement of what the subject has answered to ``Truth.asks_all`` at ``states``."""
        return self.truth.judge_all(certified, states, found, load_audited(self))


def reference_kernel_of(assignment: Assignment) -> ReferenceKernel:
    """The certified kernel that a subject's accelerations are judged by, compiled once per process."""
    return acceleration_truth_of(assignment).kernel


def acceleration_truth_of(assignment: Assignment) -> AccelerationTruth:
    """The truth of a subject's accelerations, which are what it is asked for, at states of ``as_read``; raises as ``truth_of``.

    It is that of what the engine is known to compute, where that departs from its documentation.
    """
    truth = truth_of(assignment.as_read)
    if not isinstance(truth, AccelerationTruth):
        from harness.crosscheck.constraint_laws import DepartedTruth

        assert isinstance(truth, DepartedTruth)
        truth = truth.read
    assert isinstance(truth, AccelerationTruth)
    return truth


def truth_of(assignment: Assignment) -> Truth:
    """The truth of what the subject is asked for, made once per process; equations have the coordinates of the declared file.

    Raises:
        InvalidModel: constraints of a file cannot be held against the mechanism's. NotOffered: there is no truth.
        harness.engines.Unsupported: as ``Assignment.as_read``.
    """
    about = assignment.library, assignment.subject, assignment.system, assignment.quantity, assignment.departures
    files = tuple(file and file.text for file in (assignment.declared, assignment.model))

    def find() -> Truth:
        read, of_file = assignment.as_read, _own_truth(assignment)
        departures = departures_of(assignment) if read is assignment and not assignment.departures else {}
        left_out = why_left_out(assignment) if read is assignment else {}
        if read is assignment and not departures and not left_out:
            return of_file
        from harness.crosscheck.constraint_laws import DepartedTruth
        from harness.explain.as_read import ReadTruth

        if left_out:
            return DepartedTruth(truth_without(assignment, left_out), of_file)
        if departures:
            return DepartedTruth(_own_truth(replace(assignment, departures=tuple(one.name for one in departures))), of_file)
        file = assignment.file_as_read
        return ReadTruth(truth_of(read), of_file, file.into, file.columns(assignment.asked))

    # To read what the engine declares of a file takes longer than to judge a batch of states, each of which asks for the truth.
    return _TRUTHS.get((*about, assignment.mechanism.key, *files), find)


def _with_all_on(library: Library, engine: str, mechanism: RobotMechanism) -> RobotMechanism:
    # Imported late: a mechanism needs nothing of it.
    from harness.explain.documented import with_all_on

    def find() -> RobotMechanism:
        return with_all_on(mechanism, engine, load_engine(library, engine), library.touches)

    return _ALL_ON.get((library, engine, mechanism.key), find)


def _own_truth(assignment: Assignment) -> Truth:
    """The truth of the mechanism that an assignment names."""
    quantity, (basis, key) = assignment.asked, _basis(assignment)
    if not quantity.is_of_file:
        found = quantity.truth_of(basis)
        return _touching(assignment, found) if touches(assignment) and isinstance(found, AccelerationTruth) else found
    return _SHARED.get((quantity.name, assignment.mechanism.key, *key), lambda: quantity.truth_of(basis))


def _touching(assignment: Assignment, truth: AccelerationTruth) -> Truth:
    """The truth with the contacts that the engine finds at each state."""
    # Imported late: contacts are asked for alone.
    from harness.explain.touching_truth import touching_truth

    mechanism, engine = assignment.mechanism, load_engine(assignment.library, assignment.subject.engine)
    assert isinstance(mechanism, RobotMechanism)
    return touching_truth(truth, mechanism, engine, assignment.departures, contact_source(assignment))


def touches(assignment: Assignment) -> bool:
    """True where contacts of a user's file act, with the rest of it."""
    held = assignment.mechanism.held if isinstance(assignment.mechanism, RobotMechanism) else None
    return assignment.acts and held is not None and bool(held.touches)


def contact_source(assignment: Assignment) -> ContactSource:
    """The subject as it finds contacts, at states of the mechanism."""
    from harness.explain.touching_truth import ContactSource

    is_alike = assignment.as_read.mechanism.joints == assignment.mechanism.joints
    return ContactSource(lambda: load_audited(assignment), assignment.into, is_alike)


def why_left_out(assignment: Assignment) -> Mapping[str, str]:
    """Reasons why what the mechanism has does not act, by its kind: actuators, dry friction or limits; none where all do.

    Of a user's file it is dry friction alone: limits are told beside the verdict, and actuators are a reading.
    """
    bounded, driving = assignment.mechanism.bounded, assignment.mechanism.driving
    if assignment.acts and isinstance(assignment.mechanism, RobotMechanism):
        from harness.explain.documented import why_no_friction

        return why_no_friction(assignment.mechanism, load_engine(assignment.library, assignment.subject.engine), assignment.library)
    if assignment.model is None or not assignment.asked.is_default or (bounded is None and driving is None):
        return {}
    why_undriven = "" if driving is None else _why_undriven(assignment, assignment.model)
    why_off = load_engine(assignment.library, assignment.subject.engine).why_off
    kinds = () if bounded is None else dict.fromkeys(_kind_of(assignment.mechanism, name) for name in bounded.names)
    return {kind: why_off[kind] for kind in kinds if kind in why_off} | ({ACTUATORS: why_undriven} if why_undriven else {})


def truth_without(assignment: Assignment, kinds: Collection[str]) -> Truth:
    """The truth of what the subject is asked for, without what the mechanism has of these kinds, as of ``why_left_out``."""
    if isinstance(assignment.mechanism, RobotMechanism):
        return _own_truth(replace(assignment, departures=tuple(kinds)))
    mechanism = undriven(assignment.mechanism) if ACTUATORS in kinds else assignment.mechanism
    bounds = () if mechanism.bounded is None else mechanism.bounded.names
    gone = [name for name in bounds if _kind_of(mechanism, name) in kinds]
    return _own_truth(replace(assignment, mechanism=without(mechanism, gone)))


def _kind_of(mechanism: Mechanism, bound: str) -> str:
    return FRICTION if bound in dict(mechanism.dry_friction) else LIMITS


def _why_undriven(assignment: Assignment, model: ModelFile) -> str:
    """Why no actuator of a model acts; "" where they do."""
    if model.format == "urdf":
        return "A URDF states no law of an actuator"
    # Imported late: a mechanism without actuators needs nothing of it.
    from harness.explain.changes.readings import find_readings

    reader = getattr(load_engine(assignment.library, assignment.subject.engine), "reader", "")
    readings = find_readings(assignment.subject.engine, model.format, reader)
    return next((one.sentence for one in readings if one.name == ACTUATORS), "")


def departures_of(assignment: Assignment) -> Mapping[Departure, Sequence[Constraint]]:
    """The departures of the subject's engine that bear on what it is asked for, each with the constraints that it concerns."""
    read, mechanism = assignment.model, assignment.mechanism
    if assignment.acts and isinstance(mechanism, RobotMechanism) and mechanism.held is not None:
        from harness.explain.documented import departing

        return departing(mechanism.robot, load_engine(assignment.library, assignment.subject.engine))
    if read is None or not read.constraints or mechanism.constraints is None or not assignment.asked.has_laws:
        return {}
    # Imported late: a mechanism without constraints needs nothing of it.
    from harness.crosscheck.constraint_laws import departures_from

    return departures_from(assignment.library, assignment.subject.engine, read)


def _basis(assignment: Assignment) -> tuple[TruthBasis, tuple[object, ...]]:
    """The basis of a quantity that takes numbers of a file, and what of it the truth of a mechanism depends on."""
    quantity, mechanism, read, declared = assignment.asked, assignment.mechanism, assignment.model, assignment.declared
    engine = load_engine(assignment.library, assignment.subject.engine)
    in_body, precision = engine.linear_velocity_in_body and bool(mechanism.charts_in_body), engine.unit_roundoff
    # Of a user's file the digits that M's condition costs are excused in every algorithm; a number that explains them is looked for.
    factorises = engine.factorises_mass_matrix or assignment.library.reads_files
    system = assignment.system or mechanism.name
    if quantity.is_of_file and assignment.library.validated_models(system):
        declared = declared or declared_model(assignment.library, system)
        read = read or declared
    laws: Mapping[str, ConstraintLaw] = {}
    soft: Callable[[Mechanism], Mechanism] | None = None
    if read is not None and (mechanism.constraints is not None or mechanism.bounded is not None):
        # Imported late: a mechanism without constraints needs nothing of it.
        from harness.crosscheck.constraint_laws import laws_of, softening

        for file in filter(None, (declared, read)):
            require_constraints(file, mechanism)
        laws = laws_of(assignment.library, assignment.subject.engine, read, assignment.departures) if quantity.has_laws else {}
        soft = softening(laws, read) if laws else None
    ties: tuple[Equality, ...] = ()
    if assignment.acts and isinstance(mechanism, RobotMechanism):
        from harness.explain.documented import softening_of

        if (own := softening_of(mechanism, engine, assignment.library, assignment.departures)) is not None:
            soft, laws, ties = own, own.laws, own.ties
    rules = engine.step_rules(read) if read is not None and quantity.has_step_rules else ()
    inertias_about = getattr(engine, "inertias_about", "")
    basis = TruthBasis(mechanism, declared, read, in_body, soft, rules, precision, factorises, inertias_about, ties)
    texts = tuple(file and file.text for file in (declared, read))
    return basis, (texts, in_body, tuple(laws.items()), rules, precision)


def answers_what_is_read(assignment: Assignment, states: States) -> Flags:
    """True for each answer that is that of what the subject's reader is known to misread of a mechanism's model.

    False everywhere where it is declared to misread nothing.
    """
    nowhere, found = np.zeros(len(states), dtype=bool), assignment.file_as_read
    if not found.folded.applied or assignment.mechanism.constraints is not None or found.why_not:
        return nowhere
    about = replace(assignment, mechanism=found.written, quantity=ACCELERATIONS)
    model = load_model(about.library, about.subject, about.mechanism, about.model)
    loaded = model.loaded()
    if loaded is not None and set(loaded.joints) != set(about.mechanism.joints):
        return nowhere
    truth, own_states = truth_of(about), found.into(states)
    # The other mechanism may be one whose M is next to singular: digits that this costs are excused in any engine.
    verdicts = compare(truth.evaluate(own_states), truth.answers(model, own_states), factorises=True).verdicts
    return np.isin(verdicts, (Verdict.AGREES.value, Verdict.UNSTABLE.value))


def declared_model(library: Library, system: str) -> ModelFile:
    """The model file whose numbers are the truth: the library's own, whatever stands in for it.

    Raises:
        InvalidModel: it is invalid. NotOffered: the system has none.
    """
    for model_format in MODEL_SUFFIXES:
        if library.has_model(system, model_format):
            return read_model(library.validated_models(system)[model_format], model_format)
    raise NotOffered(f"{system} has no model file")


def refuse_robots(library: Library, name: str, quantities: str) -> None:
    """Raises InvalidRequest for a system without models beside it: a robot's file, which has no second truth."""
    if not library.validated_models(name):
        raise InvalidRequest(f"{quantities}: of mechanisms here; harness check takes quantities of a robot's file")


def load_audited(assignment: Assignment) -> Model:
    """The subject's model, loaded once per process and audited.

    Raises:
        InvalidModel: the engine refuses the model, or holds another mechanism than the system's.
        ValueError: so does an engine of an environment.
        harness.engines.Misread: that is what its reader is known to make of the file.
        harness.engines.Unsupported: the engine cannot express it.
    """
    library, subject, model, mechanism = assignment.library, assignment.subject, assignment.model, assignment.as_read.mechanism

    def load() -> Model:
        try:
            loaded = load_model(library, subject, mechanism if model is not None else assignment.in_equations, model)
            audit(loaded.loaded(), model, mechanism)
        except InvalidModel as error:
            if model is not None and assignment.file_as_read.folded.applied:
                raise Misread(f"its reader makes another mechanism of the file: {error.problem}") from error
            if not runs_elsewhere(load_engine(library, subject.engine)):
                raise
            # What an engine of an environment makes of a file is no fault of the file, which those beside the harness read.
            raise ValueError(str(error)) from error
        return loaded

    return _MODELS.get((library, subject, mechanism.key, model and model.text), load)


_MODELS: Kept[Model] = Kept(64)
_ALL_ON: Kept[RobotMechanism] = Kept(64)
# By assignment, and shared by those whose truth is the same.
_TRUTHS: Kept[Truth] = Kept(256)
_SHARED: Kept[Truth] = Kept(64)
