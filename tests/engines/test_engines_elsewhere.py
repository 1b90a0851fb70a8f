"""Engines in interpreters of their own: the same answers as beside the harness, and a name for whatever becomes of them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import toy_engine
from support import InThisProcess, cross_checked, engine_source, harness, harness_in_a_process

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.settings import Settings
from harness.diagnosis.faults.bench import FaultBench
from harness.engines import (
    EQUATIONS,
    Call,
    Calls,
    InvalidAnswer,
    Subject,
    Terms,
    Unsupported,
    describe_engines,
    load_engine,
    process_of,
    runs_elsewhere,
    select_subjects,
    subjects_beside,
    timed_answers_of,
    timed_answers_of_each,
)
from harness.engines.calls import answer_each
from harness.engines.elsewhere.interpreter import EngineDied, Interpreter, engine_in_a_process_of_its_own
from harness.engines.elsewhere.transport import dumps, loads, pickled, portable
from harness.errors import InvalidModel, InvalidRequest
from harness.files.model_file import ModelFile, read_model
from harness.hard.worst_cases import ranked
from harness.library import Library
from harness.study import sentence
from harness.truth.sampling import sample
from harness.verdict import Verdict
from harness.workers import Workers

VERSIONS = {
    "1.0": toy_engine.RIGHT,
    "1.1": toy_engine.HEAVIER,
    "2.0": toy_engine.DYING,
    "2.1": toy_engine.ENDING,
    "2.2": toy_engine.HANGING,
    "2.3": toy_engine.LACKING,
    "2.4": toy_engine.RAISING,
    "3.0": toy_engine.RIGHT,
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Library]:
    with toy_engine.planted(tmp_path_factory.mktemp("toy"), VERSIONS) as root:
        found = Library.at(root)
        describe_engines(found, Workers)
        yield found


@pytest.fixture
def bar(library: Library) -> ModelFile:
    return read_model(library.model_path("bar_pendulum", "urdf"), "urdf")


def of_library(library: Library, *arguments: str) -> tuple[str, ...]:
    return (*arguments, "--library", str(library.systems.parent), "--quantity", "accelerations", "--states", "40", "--workers", "1")


@pytest.mark.ci
def test_a_version_is_asked_by_name_and_no_other_is(library: Library) -> None:
    assert [str(one) for one in select_subjects(library, ["toy@1.0/urdf"])] == ["toy@1.0/urdf"]
    assert {str(one) for one in select_subjects(library, [])} >= {"toy/urdf", "mujoco/mjcf"}
    assert not any("@" in str(one) for one in select_subjects(library, []))
    with pytest.raises(InvalidRequest, match=r"no environment holds toy 9\.0; .*harness engines add toy==9\.0"):
        select_subjects(library, ["toy@9.0/urdf"])


def test_what_is_not_beside_the_harness_is_its_newest_environment(library: Library) -> None:
    assert load_engine(library, "toy").environment.version == "3.0"  # type: ignore[attr-defined]
    assert runs_elsewhere(load_engine(library, "toy@1.0"))
    assert not runs_elsewhere(load_engine(library, "mujoco"))


def test_what_is_asked_by_default_of_faults_and_worst_cases_is_no_environment_s(library: Library) -> None:
    beside = {str(one) for one in subjects_beside(library)}
    assert "toy/urdf" not in beside and {"mujoco/urdf", "pinocchio/urdf"} <= beside
    assert "toy/urdf" not in map(str, select_subjects(library, [], native_only=True))
    readers = {str(reader.subject) for reader in FaultBench(library, "bar_pendulum", "urdf", 20, 0).readers}
    assert readers and not any(one.startswith("toy") for one in readers)


@pytest.mark.ci
def test_the_worst_cases_of_a_version_are_ranked(library: Library) -> None:
    records, _ = cross_checked(Settings(library=library, subjects=("toy@1.1/urdf",), states=20, examples=None))
    [case] = ranked(library, records, InThisProcess())
    assert case.subject == "toy@1.1/urdf" and case.verdict == "disagrees"


def test_its_model_answers_as_one_in_this_process(library: Library, bar: ModelFile) -> None:
    model = load_engine(library, "toy@1.0").load(bar, ["pin"], 9.81)
    q, v, tau = np.random.default_rng(0).normal(size=(3, 7, 1))
    expected = (tau - 0.3 * v - 2.0 * 9.81 * 0.75 * np.sin(q)) / (1.625 + 0.0 * q)
    answer = model.forward_dynamics(q, v, tau)
    assert answer.dtype == np.float64 and (answer == expected).all()
    assert model.loaded() is None
    terms = model.terms(q, v, tau)  # type: ignore[attr-defined]
    assert isinstance(terms, Terms) and terms.mass.shape == (7, 1, 1) and (terms.applied == tau).all()
    assert not hasattr(model, "reactions")


def test_several_calls_are_one_request_and_each_has_arguments_and_seconds_of_its_own(
    library: Library, bar: ModelFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = load_engine(library, "toy@1.0").load(bar, ["pin"], 9.81)
    q, v, tau = np.random.default_rng(0).normal(size=(3, 7, 1))
    requests, ask = [], Interpreter.ask
    monkeypatch.setattr(Interpreter, "ask", lambda self, *request: requests.append(request) or ask(self, *request))  # type: ignore[func-returns-value]
    motion, mass = Call("forward_dynamics", (q, v, tau), (7, 1)), Call("terms", (q, v, tau), (7, 1, 1), part="mass")
    both = Calls((motion, mass), lambda answers: answers[0] * answers[1][:, 0])
    [(product, of_two), (alone, of_one)] = timed_answers_of(model, [both, Calls((motion,))])
    [[name, [(_, given)]]] = requests
    # One array goes there once; its copies are made there.
    assert name == "answer_each" and given[0].arguments[0] is given[2].arguments[0] is q
    assert (alone == model.forward_dynamics(q, v, tau)).all() and (product == alone * 1.625).all()
    assert of_two > 0 and of_one > 0
    other, back = load_engine(library, "toy@1.0").load(bar, ["pin"], 9.81), Call("forward_dynamics", (-q, v, tau), (7, 1))
    requests.clear()
    [[(first, _)], [(second, _), (again, _)]] = timed_answers_of_each([(model, [Calls((motion,))]), (other, [Calls((back,))] * 2)])
    assert len(requests) == 1 and process_of(model) is process_of(other)
    assert (first == alone).all() and (second == other.forward_dynamics(-q, v, tau)).all() and (again == second).all()
    with pytest.raises(InvalidAnswer, match=r"shape \(7, 1\) of float64; expected an array of shape \(7, 2\)"):
        timed_answers_of(model, [Calls((motion._replace(shape=(7, 2)),))])


def test_a_model_that_writes_into_what_it_is_given_changes_no_other_call() -> None:
    class Scribbles:
        def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
            q += 1.0
            return q

    q = np.zeros((2, 1))
    call = Call("forward_dynamics", (q, q, q), (2, 1))
    for calls in ((call, call), loads(dumps((call, call))), loads(pickled((call, call)))):
        (first, _), (second, _) = answer_each(Scribbles(), calls)  # type: ignore[arg-type]
        # What is timed gives one answer, which is handed over once.
        assert (first == 1.0).all() and second is first
    assert not q.any()


def test_the_judgement_of_a_loop_is_one_request(monkeypatch: pytest.MonkeyPatch) -> None:
    """What its constraints leave open is asked for beside the accelerations."""
    assignment = Assignment.of(Library.built_in(), "four_bar", Subject("mujoco", "mjcf"))
    states = sample(assignment.mechanism, 8, 0)
    certified = assignment.truth.evaluate(states)
    load_audited(assignment)
    requests, ask = [], Interpreter.ask
    monkeypatch.setattr(Interpreter, "ask", lambda self, *request: requests.append(request[0]) or ask(self, *request))  # type: ignore[func-returns-value]
    assert assignment.judge(states, certified).are_all(Verdict.AGREES)
    assert requests == ["answer_each"]


def test_a_method_that_is_kept_keeps_its_model(library: Library, bar: ModelFile) -> None:
    q, v, tau = np.ones((3, 1, 1))
    terms = load_engine(library, "toy@1.0").load(bar, ["pin"], 9.81).terms  # type: ignore[attr-defined]
    load_engine(library, "toy@1.0").load(bar, ["pin"], 9.81).forward_dynamics(q, v, tau)
    assert isinstance(terms(q, v, tau), Terms)


@pytest.mark.ci
def test_another_cache_directory_has_another_interpreter(library: Library, bar: ModelFile, tmp_path: Path) -> None:
    q, v, tau = np.ones((3, 1, 1))
    [[right]] = load_engine(library, "toy@1.0").load(bar, ["pin"], 9.81).forward_dynamics(q, v, tau)
    with toy_engine.planted(tmp_path, {"1.0": toy_engine.HEAVIER}):
        [[heavier]] = load_engine(library, "toy@1.0").load(bar, ["pin"], 9.81).forward_dynamics(q, v, tau)
    assert heavier != right


def test_files_have_their_names_in_the_working_folder_and_the_process_stays(
    bar: ModelFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (file := tmp_path / "reading.py").write_text(engine_source("return np.array([[os.getpid(), float(open('weight').read())]])"))
    answers = []
    for weight in ("2", "3"):
        (folder := tmp_path / weight).mkdir()
        (folder / "weight").write_text(weight)
        monkeypatch.chdir(folder)
        model = engine_in_a_process_of_its_own(file, "reading").load(bar, ["pin"], 9.81)
        answers += model.forward_dynamics(*np.ones((3, 1, 1))).tolist()
    (process, two), (same, three) = answers
    assert process == same and (two, three) == (2.0, 3.0)


def test_it_runs_in_the_environment_and_sees_nothing_of_the_harnesss(library: Library) -> None:
    environment = load_engine(library, "toy@1.0").environment  # type: ignore[attr-defined]
    probe = (
        "import importlib.util as u; print([n for n in ('sympy', 'flint', 'heyoka', 'mujoco', 'pinocchio', 'harness') if u.find_spec(n)])"
    )
    done = subprocess.run([environment.interpreter, "-P", "-s", "-c", probe], capture_output=True, text=True, check=True, env={})
    assert done.stdout.strip() == "[]"


def test_every_adapter_is_imported_where_only_its_requirements_are(library: Library) -> None:
    """In an environment's interpreter, where nothing of SymPy, heyoka, flint or another engine can be found."""
    environment = load_engine(library, "toy@1.0").environment  # type: ignore[attr-defined]
    own = [
        name for name, file in describe_engines(Library.built_in(), Workers).items() if EQUATIONS not in file.formats and "@" not in name
    ]
    known = "mujoco pinocchio drake idyntree dartpy pybullet adam mjx mjx_float32 mujoco_warp newton physx"
    assert set(known.split()) <= set(own)
    modules = [f"harness.engines.adapters.{name}" for name in own]
    server = Path(sys.modules["harness.engines"].__file__ or "").parent / "elsewhere" / "server.py"
    probe = (
        f"import importlib, runpy, sys; runpy.run_path({str(server)!r})['_import_harness'](); "
        f"print([importlib.import_module(name).ENGINE.formats for name in {modules}])"
    )
    done = subprocess.run([environment.interpreter, "-P", "-s", "-c", probe], capture_output=True, text=True, check=False, env={})
    assert done.returncode == 0, done.stderr


@pytest.mark.ci
def test_a_missing_function_is_unsupported_and_the_engines_own_exceptions_are_told(library: Library, bar: ModelFile) -> None:
    state = np.zeros((1, 1))
    with pytest.raises(Unsupported, match=r"toy_engine 2\.3 has no accelerate"):
        load_engine(library, "toy@2.3").load(bar, ["pin"], 9.81).forward_dynamics(state, state, state)
    with pytest.raises(RuntimeError, match="no fuel") as raised:
        load_engine(library, "toy@2.4").load(bar, ["pin"], 9.81).forward_dynamics(state, state, state)
    assert sentence(raised.value) == "ToyError: no fuel"


@pytest.mark.ci
def test_outside_a_worker_a_death_is_an_exception_and_the_next_load_starts_anew(library: Library, bar: ModelFile) -> None:
    state = np.zeros((1, 1))
    for _ in range(2):
        with pytest.raises(EngineDied, match=r"toy@2\.0 ended its process with status -11"):
            load_engine(library, "toy@2.0").load(bar, ["pin"], 9.81).forward_dynamics(state, state, state)


@pytest.mark.ci
def test_a_check_names_each_death_and_judges_the_others(library: Library, tmp_path: Path) -> None:
    subjects = ["toy/urdf", *(f"toy@{version}/urdf" for version in VERSIONS), "mujoco/urdf"]
    options = [word for one in subjects for word in ("--subject", one)]
    done = harness_in_a_process("check", *of_library(library, *options), "--time-limit", "5", "--json", "out.json", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    records = {one["subject"]: one for one in json.loads((tmp_path / "out.json").read_text())["records"]}
    assert records["mujoco/urdf"]["verdict"] == "agrees", records["mujoco/urdf"]["message"]
    assert {one: record["verdict"] for one, record in records.items()} == {
        "toy/urdf": "agrees", "toy@1.0/urdf": "agrees", "toy@1.1/urdf": "disagrees", "toy@2.0/urdf": "error", "toy@2.1/urdf": "error",
        "toy@2.2/urdf": "error", "toy@2.3/urdf": "unsupported", "toy@2.4/urdf": "error", "toy@3.0/urdf": "agrees", "mujoco/urdf": "agrees",
    }  # fmt: skip
    assert "SIGSEGV" in records["toy@2.0/urdf"]["message"]
    assert "ended its process with status 7; it wrote: spoon" in records["toy@2.1/urdf"]["message"]
    assert "time limit" in records["toy@2.2/urdf"]["message"]
    assert records["toy@2.3/urdf"]["expected"] == "unsupported"


@pytest.mark.ci
def test_no_engines_presence_changes_anothers_answers(library: Library, tmp_path: Path) -> None:
    """Bit by bit: the record of MuJoCo alone and beside right and wrong engines of environments, but for the times.

    The states suffice for the search to go on where the wrong ones do worst, which must not be where MuJoCo is asked.
    """
    found = []
    for others in ((), ("toy@1.0/urdf", "toy@1.1/urdf")):
        options = [word for one in ("mujoco/urdf", *others) for word in ("--subject", one)]
        done = harness(
            "check",
            *of_library(library, *options),
            "--states",
            "400",
            "--json",
            "out.json",
            cwd=tmp_path,
            isolated=True,
        )
        [record] = [one for one in json.loads((tmp_path / "out.json").read_text())["records"] if one["subject"] == "mujoco/urdf"]
        assert done.returncode == (1 if others else 0), done.stderr
        found.append({name: value for name, value in record.items() if "seconds" not in name and name not in ("replay", "faster")})
    assert found[0] == found[1]


def test_arrays_pass_bit_by_bit() -> None:
    values = {"a": np.array([[0.1, -0.0], [np.nan, np.inf]]), "b": np.float64(0.1), "c": [np.arange(3, dtype=">i4"), "text", None]}
    again = loads(dumps(values))
    assert again["a"].tobytes() == values["a"].tobytes() and again["a"].shape == (2, 2) and again["a"].flags.writeable  # type: ignore[attr-defined]
    assert isinstance(again["b"], np.float64) and again["b"] == 0.1
    assert again["c"][0].dtype == ">i4" and again["c"][1:] == ["text", None]


def test_exceptions_pass_as_what_both_sides_know() -> None:
    class OfAnEngine(ValueError):
        pass

    passed = loads(dumps(portable(OfAnEngine("x"))))
    assert sentence(passed) == "OfAnEngine: x" and isinstance(passed, ValueError)
    known = InvalidModel(Path("a.xml"), 3, "is wrong")
    assert portable(known) is known
    assert type(portable(UnicodeDecodeError("utf-8", b"", 0, 1, "bad"))) is UnicodeDecodeError
