"""Memory that a process may hold: what needs more is refused in a sentence, and nothing that is asked behind it is hurt."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import worker_tasks as work
from support import engine_source, harness, make_library, records_of

from harness.workers import Task, Workers, memory

# What pybind11, Boost.Python, nanobind and CPython raise of what they do not know, and of a request that there is no memory for.
UNSOUND = [
    ("MemoryError", ""),
    ("RuntimeError", "Caught an unknown exception!"),
    ("RuntimeError", "unidentifiable C++ exception"),
    ("SystemError", "nanobind::detail::nb_func_error_except(): exception could not be translated!"),
    ("ImportError", "libsdf_plugin.so: failed to map segment from shared object"),
]
ROBOT = '<worldbody><body name="a"><joint name="j" axis="0 1 0"/><geom size="1"/></body></worldbody>'
HUGE = f'<mujoco><asset><texture name="t" type="2d" builtin="flat" width="100000" height="100000"/></asset>{ROBOT}</mujoco>'
# Within what MuJoCo asks the system for at once, and beyond what it may hold.
LARGE = HUGE.replace("100000", "30000")
REFUSED = re.compile(r"MemoryError: (needs more than|ran out of memory, of which it may hold) 512 MiB.*--memory-limit .*allows more")


@pytest.mark.parametrize(
    ("text", "size"), [("4GiB", 4 << 30), ("500MiB", 500 << 20), ("1.5 gb", 3 << 29), ("64k", 1 << 16), ("2T", 1 << 41)]
)
def test_a_size_of_memory_is_read(text: str, size: int) -> None:
    assert memory.parse_size(text) == size


@pytest.mark.parametrize("text", ["", "4", "GiB", "-1GiB", "0G", "1e3M", "4PB"])
def test_another_size_is_refused(text: str) -> None:
    done = harness("check", "bar_pendulum", "--memory-limit", text)
    assert done.returncode == 2 and "is no size of memory; expected one as 4GiB" in done.stderr


@pytest.mark.parametrize(("machine", "workers", "limit"), [(64, 2, 8), (64, 8, 4), (16, 2, 4), (8, 8, 2), (256, 1, 8)])
def test_the_default_is_a_share_of_the_machine(machine: int, workers: int, limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "memory_of_machine", lambda: machine * memory.GIB)
    assert memory.default_limit(workers) == limit * memory.GIB


def test_this_process_holds_something_and_one_that_is_gone_nothing() -> None:
    with Workers(1) as workers:
        [outcome] = workers.run([Task(None, work.own_process, ())])
        assert 1 << 20 < memory.resident(outcome.value) < memory.memory_of_machine()
    assert memory.resident(outcome.value) == 0


@pytest.mark.ci
def test_a_worker_that_holds_more_is_ended_and_the_next_task_is_another_one_s() -> None:
    tasks = [Task("before", work.own_process, ()), Task("full", work.fill_memory, ()), Task("behind", work.own_process, ())]
    with Workers(1, memory_limit=256 << 20) as workers:
        outcomes = {outcome.task.key: outcome for outcome in workers.run(tasks)}
    assert str(outcomes["full"].crash).startswith("needs more than 256 MiB of memory; --memory-limit ")
    assert outcomes["behind"].value not in (None, outcomes["before"].value)


@pytest.mark.parametrize(("kind", "words"), UNSOUND)
def test_a_worker_that_may_be_unsound_is_not_used_again(kind: str, words: str) -> None:
    tasks = [Task("before", work.own_process, ()), Task("ill", work.raise_unsound, (kind, words)), Task("behind", work.own_process, ())]
    with Workers(1) as workers:
        outcomes = {outcome.task.key: outcome for outcome in workers.run(tasks)}
    assert type(outcomes["ill"].exception).__name__ == kind
    assert outcomes["behind"].value not in (None, outcomes["before"].value)


# Holds a lock from the first file that is too much for it, and waits for that at the next one.
HOLDING = """
class Engine(Engine):
    def load(self, source, joints, gravity):
        if held:
            time.sleep(1000)
        if source.path.stem == "bar_pendulum":
            held.append(source)
            raise {kind}({words!r})
        return Model()

held = []
"""


@pytest.mark.ci
@pytest.mark.parametrize(("kind", "words"), UNSOUND)
def test_the_next_file_is_answered_by_another_process_of_the_engine(kind: str, words: str, tmp_path: Path) -> None:
    engines = {"holding": engine_source(top=HOLDING.format(kind=kind, words=words))}
    root = make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"], engines)
    options = ["--subject", "holding/mjcf", "--subject", "mujoco/mjcf", "--quantity", "accelerations", "--states", "20", "--workers", "1"]
    done = harness("check", "--library", str(root), *options, "--time-limit", "30", "--json", "out.json", isolated=True, cwd=tmp_path)
    records = {(record["system"], record["subject"]): record for record in records_of(tmp_path / "out.json")}
    assert done.returncode == 1, done.stdout
    assert (words or kind) in records["bar_pendulum", "holding/mjcf"]["message"]
    # It answers, and wrongly: zero.
    assert records["spring_damper", "holding/mjcf"]["verdict"] == "disagrees"
    assert {records[system, "mujoco/mjcf"]["verdict"] for system in ("bar_pendulum", "spring_damper")} == {"agrees"}


@pytest.fixture
def robots(tmp_path: Path) -> Path:
    """Two files that need too much memory, before one that does not."""
    for name, text in (("a_huge", HUGE), ("b_large", LARGE), ("c_small", f"<mujoco>{ROBOT}</mujoco>")):
        (tmp_path / f"{name}.xml").write_text(text)
    return tmp_path


def judged(robots: Path, *arguments: str) -> dict[tuple[str, str], list[tuple[str, str]]]:
    """(verdict, message) of each answer by the stem of the file and the engine."""
    options = ["--memory-limit", "512MiB", "--workers", "1", "--time-limit", "60", "--json", "out.json"]
    done = harness(*arguments, *options, isolated=True, cwd=robots)
    assert done.returncode == 1 and "512 MiB" in done.stdout, done.stdout + done.stderr
    document = json.loads((robots / "out.json").read_text())
    found: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for one in document["records"]:
        found.setdefault((Path(one["system"]).stem, one["subject"].partition("/")[0]), []).append((one["verdict"], one["message"]))
    for one in document.get("subjects", ()):
        found.setdefault((Path(one["path"]).stem, one["engine"]), []).append((one["verdict"], one["message"]))
    return found


@pytest.mark.ci
@pytest.mark.parametrize("command", ["check", "compare", "survey"])
def test_a_texture_that_needs_too_much_memory_is_refused_in_a_sentence(robots: Path, command: str) -> None:
    files = ["."] if command == "survey" else [f"{name}.xml" for name in ("a_huge", "b_large", "c_small")]
    found = judged(robots, command, *files, "--states", "20")
    for name in ("a_huge", "b_large"):
        assert {verdict for verdict, _ in found[name, "mujoco"]} == {"error"}
        assert all(REFUSED.match(message) for _, message in found[name, "mujoco"]), found[name, "mujoco"]
    for pair in (("a_huge", "pinocchio"), ("b_large", "pinocchio"), ("c_small", "pinocchio"), ("c_small", "mujoco")):
        assert {verdict for verdict, _ in found[pair]} == {"agrees"}
