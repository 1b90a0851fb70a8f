"""Everything to show of one mechanism: equations, parameters, the joints of both models, and what engines hold.

Engines load on a worker process, so that a model which kills one costs its own line only. What was gathered is shown as text, or as a page.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path

from markupsafe import Markup

from harness.crosscheck.assignment import Assignment
from harness.crosscheck.expected import load_expectations
from harness.crosscheck.held import held_by, soundness
from harness.engines import EQUATIONS, HeldModel, LoadedModel, Subject, asked_of, engine_files, is_native, load_model, subjects
from harness.engines.interface import audit
from harness.errors import InvalidInput
from harness.files.model_file import ModelFile, read_model
from harness.files.text.joint_table import COLUMNS, JointRow, constraint_texts, joint_rows, point_springs
from harness.lagrange.derivation import load_mechanism
from harness.library import Library, member_of
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.table import Column, Table, number_text
from harness.show.picture import draw
from harness.show.placement import Pose, choose_view, place
from harness.study import Inquiry, Part, Study, ask, call
from harness.trees.nodes import kinematics
from harness.trees.robot import tree_of
from harness.trees.rows import rows_of, untied
from harness.verdict import Verdict
from harness.workers import Task


@dataclass(frozen=True)
class Holding:
    """One subject's model after loading; where there is none, or it is not the mechanism, ``remark`` says why.

    ``placements`` are at the zero configuration and moved a little, where a picture was asked for.
    """

    subject: Subject
    loaded: LoadedModel | None = None
    held: HeldModel | None = None
    placements: tuple[Pose, Pose] | None = None
    remark: str = ""


@dataclass
class Exhibit:
    """Everything to show of a mechanism.

    Attributes:
        models: format to its file; a missing or invalid one is absent.
        joints: for each joint the rows of the formats that have it, as (format, row).
        ties: (format, text) of the springs that do not stand in a joint, and of the constraints.
        reasons: subject to the reason why it has no model, as the library's expected verdicts say.
        holdings: one per subject that reads a model.
        placements: the mechanism at its zero configuration and moved a little, if a picture was asked for.
    """

    mechanism: Mechanism
    models: dict[str, ModelFile] = field(default_factory=dict)
    joints: dict[str, list[tuple[str, JointRow]]] = field(default_factory=dict)
    ties: list[tuple[str, str]] = field(default_factory=list)
    reasons: dict[Subject, str] = field(default_factory=dict)
    holdings: list[Holding] = field(default_factory=list)
    placements: tuple[Pose, Pose] | None = None


def hold(assignment: Assignment, with_picture: bool, note: Callable[[str], None]) -> Holding:
    """The subject's model as its engine holds it, whole and joint by joint, and its places for a picture, without a judgement."""
    mechanism = assignment.mechanism
    loaded = load_model(assignment.library, assignment.subject, mechanism, assignment.model)
    return Holding(assignment.subject, loaded.loaded(), held_by(loaded), place(loaded, mechanism) if with_picture else None)


class Exhibition(Study):
    """Reads and loads what there is of one mechanism; a ``harness.study.Study``. Whatever cannot be used is left out and reported.

    Raises:
        InvalidInput: from ``take``, the system file itself is of no use.
    """

    title = "show"

    def __init__(self, library: Library, name: str, with_picture: bool) -> None:
        super().__init__()
        self._library, self._name, self._with_picture = library, name, with_picture
        self._reasons = self._find_reasons()
        self._exhibit: Exhibit
        asked = asked_of(library, name, subjects(library))
        self._holdings = {subject: Holding(subject) for subject in asked if subject.format != EQUATIONS}
        self.steps = len(self._holdings)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._read()]
        yield [self._held(subject) for subject in self._loading()]

    def result(self) -> Exhibit:
        self._exhibit.holdings = list(self._holdings.values())
        # Any engine's picture will do.
        drawn = (holding.placements for holding in self._exhibit.holdings)
        self._exhibit.placements = next((placements for placements in drawn if placements is not None), None)
        return self._exhibit

    def _find_reasons(self) -> dict[Subject, str]:
        try:
            expectations = load_expectations(self._library)
        except InvalidInput as problem:
            self.report(problem)
            return {}
        reasons = {subject: expectations.why_no_model(self._library, self._name, subject) for subject in subjects(self._library)}
        return {subject: reason for subject, reason in reasons.items() if reason}

    def _read(self) -> Inquiry[None]:
        """The mechanism, and each model as a file says it."""
        library, name = self._library, self._name
        reading = {one: Task(None, call, (read_model, library.model_path(name, one), one)) for one in library.formats_of(name)}
        derived, *models = yield [Task(None, call, (load_mechanism, library, name)), *reading.values()]
        if derived.crash is not None:
            raise InvalidInput(library.system_path(name), None, str(derived.crash))
        if derived.exception is not None:
            raise derived.exception
        exhibit = self._exhibit = Exhibit(derived.value, reasons=self._reasons)
        readers = [subject for subject in subjects(library) if subject not in exhibit.reasons]
        for model_format, outcome in zip(reading, models, strict=True):
            if outcome.value is None:
                if any(subject.format == model_format for subject in readers):
                    self.failure(outcome)
                continue
            exhibit.models[model_format] = outcome.value
            for row in joint_rows(outcome.value):
                exhibit.joints.setdefault(row.joint, []).append((model_format, row))
            texts = [*point_springs(outcome.value), *constraint_texts(outcome.value)]
            exhibit.ties += [(model_format, text) for text in texts]

    def _loading(self) -> Iterator[Subject]:
        """The subjects that can load their models; for the others the holding says why not."""
        exhibit = self._exhibit
        for subject in self._holdings:
            model, file = exhibit.models.get(subject.format), engine_files(self._library)[subject.engine]
            if subject in exhibit.reasons:
                remark = f"{Verdict.UNSUPPORTED}: {exhibit.reasons[subject]}"
            elif not (remark := self.failure(file.outcome)) and file.version is None:
                remark = "not installed"
            elif not remark and model is None:
                remark = f"no valid {subject.format} model"
            self._holdings[subject] = Holding(subject, remark=remark)
            if not remark:
                yield subject

    def _held(self, subject: Subject) -> Inquiry[None]:
        exhibit = self._exhibit
        # A picture is that of the format's own engine.
        drawn = self._with_picture and is_native(self._library, subject)
        outcome = yield from ask(hold, Assignment(self._library, subject, exhibit.mechanism, exhibit.models[subject.format]), drawn)
        if failure := self.failure(outcome):
            remark = outcome.exception.problem if isinstance(outcome.exception, InvalidInput) else failure
            self._holdings[subject] = Holding(subject, remark=remark)
        else:
            self._holdings[subject] = replace(outcome.value, remark=self._audited(subject, outcome.value.loaded))
        yield Part(str(subject), None)

    def _audited(self, subject: Subject, loaded: LoadedModel | None) -> str:
        if loaded is None:
            return "does not say what it holds"
        try:
            audit(loaded, self._exhibit.models[subject.format], self._exhibit.mechanism)
        except InvalidInput as problem:
            self.report(problem)
            return problem.problem
        return "as the system says"


def whereabouts(path: Path) -> str:
    """The model's file; for a member of a family the file that writes it."""
    member = member_of(path)
    return str(path) if member is None else f"{member[0]} for size {member[1]}"


def audit_table(exhibit: Exhibit) -> Table:
    """The system's own joints, gravity and mass, and a row of them per subject."""
    mechanism = exhibit.mechanism
    gravity = f"0 0 {number_text(-mechanism.gravity)}" if mechanism.gravity else "0 0 0"
    rows = [["the system", _joints(mechanism.joint_sizes), gravity, _sum(mechanism.total_mass), ""]]
    for holding in exhibit.holdings:
        held = ["", "", ""]
        if (loaded := holding.loaded) is not None:
            # An engine that feels none may say so by a negative zero.
            held = [_joints(loaded.joints), " ".join(number_text(component + 0.0) for component in loaded.gravity), _sum(loaded.total_mass)]
        rows.append([str(holding.subject), *held, holding.remark])
    return Table(["who", "joints with nq/nv", "gravity", "moving mass", "remark"], rows, "Held after loading", "plain")


def _joints(sizes: Mapping[str, tuple[int, int]]) -> str:
    return ", ".join(f"{joint} {nq}/{nv}" for joint, (nq, nv) in sizes.items())


def _sum(mass: float) -> str:
    """Without the last two digits, in which sums differ by the order of their terms."""
    return f"{mass:.15g}"


def comparison_of_holdings(exhibit: Exhibit) -> list[str]:
    """Lines on what the subjects hold, each joint and body in the world's frame; none where fewer than two say it."""
    held = {str(holding.subject): holding.held for holding in exhibit.holdings if holding.held is not None}
    if len(held) < 2:
        return []
    return soundness(held, exhibit.models)


def sizes_of_formulations(exhibit: Exhibit) -> str:
    """Numbers of equations and unknowns by Lagrange, and with every body kept free; "" without a model.

    Of the rows of constraints, those count that do not follow from others.
    """
    if not exhibit.models:
        return ""
    mechanism, model = exhibit.mechanism, next(iter(exhibit.models.values()))
    forces = 0 if mechanism.constraints is None else len(mechanism.constraints.independent)
    by_lagrange = f"{mechanism.nv + forces} by Lagrange" + (f", {forces} of them forces of constraints" if forces else "")
    try:
        tree = untied(tree_of(model, mechanism.gravity), mechanism.joints)
        rows_of(tree, model.constraints)
        joints = kinematics(tree, mechanism.joints).nodes
    except (InvalidInput, ValueError) as problem:
        return f"{by_lagrange}; with every body free none, as {problem}"
    # A body without mass stands between two joints of one body; a joint that follows another is stiff in all directions.
    bodies, rows = len(joints), sum(6 if node.joint.follows else 6 - node.joint.kind.velocities for node in joints)
    accelerations = f"6 accelerations of {'its body' if bodies == 1 else f'each of {bodies} bodies'}"
    others = f"{rows} reactions, and {forces} forces of constraints" if forces else f"and {rows} reactions"
    size = 6 * bodies + rows + forces
    return f"{by_lagrange}; {size} with every body free: {accelerations}, {others}"


def joint_table(exhibit: Exhibit) -> Table:
    """For each joint a row per format; columns that are empty throughout are left out."""
    rows = [
        ["" if place else row.joint, model_format, *(str(getattr(row, name)) for name in COLUMNS[1:])]
        for pair in exhibit.joints.values()
        for place, (model_format, row) in enumerate(pair)
    ]
    filled = {name for place, name in enumerate(COLUMNS[1:], start=2) if any(row[place] for row in rows)}
    titles = [COLUMNS[0], "model", *COLUMNS[1:]]
    return Table(titles, rows, "Joints in the models", "plain").only(*(title for title in titles if title in (*titles[:2], *filled)))


def as_text(exhibit: Exhibit) -> list[str]:
    """The exhibit as plain text, in pieces."""
    mechanism, formulations, compared = exhibit.mechanism, sizes_of_formulations(exhibit), comparison_of_holdings(exhibit)
    sources = "T and V" if mechanism.constraints is None else "T, V and the constraints"
    energies = f"{mechanism.program.operations:,} operations, which follow from {sources}:\n\n{mechanism.energies_text}"
    models = [f"{model_format}: {whereabouts(model.path)}" for model_format, model in exhibit.models.items()]
    joints = "Joints, as the files say (what they leave out, in parentheses); mass is that of the body"
    held = "Held of each joint and body, in the world's frame with every joint at zero"
    return [
        f"{mechanism.name}: {mechanism.description}\nSource: {mechanism.source}",
        *_headed("Equations of motion (' is d/dt, tau the applied force)", mechanism.equations_text or energies),
        *([f"\nBeside them, rigid: {', '.join(mechanism.bounded.names)}"] if mechanism.bounded is not None else []),
        *([f"\nBeside them, by controls: {', '.join(mechanism.driving.rows)}"] if mechanism.driving is not None else []),
        *([f"\nEquations and unknowns: {formulations}"] if formulations else []),
        *_headed("Parameters", str(parameter_table(mechanism))),
        *_headed("Coordinates", str(coordinate_table(mechanism))),
        *_headed("Models", "\n".join(models) or ("none" if exhibit.reasons else "none that can be read")),
        *(_headed(joints, str(joint_table(exhibit))) if exhibit.joints else []),
        *(f"  {model_format}, {text}" for model_format, text in exhibit.ties),
        *_headed("After loading", str(audit_table(exhibit))),
        *(_headed(held, "\n".join(compared)) if compared else []),
    ]


def _headed(title: str, text: str) -> list[str]:
    """A title, and the lines of a text below it."""
    return [f"\n{title}:", *(f"  {line}" for line in text.splitlines())]


def render(exhibit: Exhibit, library: str, problems: Sequence[Exception]) -> str:
    """The exhibit as one offline page."""
    from harness.report.html import environment
    from harness.report.markup import picture

    pictures: list[Markup] = []
    view = None
    if exhibit.placements is not None:
        resting, moved = exhibit.placements
        gravity = exhibit.mechanism.gravity
        view = choose_view(exhibit.placements)
        drawn = [draw(resting, [moved], view, gravity), draw(moved, [resting], view, gravity, ghost=resting)]
        pictures = list(filter(None, map(picture, drawn)))
    made = environment().overlay()
    made.filters = {**made.filters, "whereabouts": whereabouts}
    return made.from_string(files(__package__).joinpath("show.html").read_text("utf-8")).render(
        mechanism=exhibit.mechanism,
        library=library,
        exhibit=exhibit,
        problems=problems,
        charts=[],
        pictures=pictures,
        view=view,
        joints=joint_table(exhibit),
        audit=audit_table(exhibit),
        held=comparison_of_holdings(exhibit),
        parameters=parameter_table(exhibit.mechanism),
        coordinates=coordinate_table(exhibit.mechanism),
    )


def parameter_table(mechanism: Mechanism) -> Table:
    """Symbol, value and unit of each parameter."""
    rows = [[symbol, number_text(value), unit] for symbol, value, unit in mechanism.parameters]
    return Table(["parameter", Column("value", "plain"), "unit"], rows, "Parameters")


def coordinate_table(mechanism: Mechanism) -> Table:
    """Joint and sampled range of each coordinate; those that constraints determine are not sampled."""
    sampled = [
        "any angle" if bounds is None else f"{number_text(bounds[0])} to {number_text(bounds[1])}" for bounds in mechanism.position_ranges
    ]
    for number, constraint in ({} if mechanism.constraints is None else mechanism.constraints.determined_by).items():
        sampled[number] = f"by constraint {constraint}"
    rows = [list(row) for row in zip(mechanism.coordinates, mechanism.joints, sampled, strict=True)]
    return Table(["coordinate", "joint", "sampled"], rows, "Coordinates")
