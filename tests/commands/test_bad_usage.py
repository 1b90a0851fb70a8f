"""Bad usage of every command: exit status 2, a message that says what to do, and nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import harness


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        ([], ["Usage: "]),
        (["check", "--nonsense"], ["--nonsense"]),
        (["chek"], ["no command is called 'chek'; did you mean 'check'?"]),
        (["robots/arm.urdf"], ["robots/arm.urdf is a file, and a command goes before it: harness compare robots/arm.urdf"]),
        (["check", "cart_pendlum"], ["no system is called 'cart_pendlum'", "did you mean 'cart_pendulum'"]),
        (["check", "--subject", "mujoco/mjfc"], ["no subject is called 'mujoco/mjfc'", "did you mean 'mujoco/mjcf'"]),
        (["check", "--library", "nowhere"], ["nowhere", "no such directory"]),
        (["check", "--mjcf", "x.xml"], ["x.xml", "no such file", "harness check NAME --mjcf x.xml"]),
        (["check", "collar", "acrobot", "--mjcf", "x.xml"], ["name exactly one system"]),
        (["check", "collar", "--mjcf", "x.xml"], ["x.xml", "no such file"]),
        (["check", "collar", "--state", "{"], ["--state"]),
        (["check", "collar", "--state", '{"q": [1], "v": [1], "tau": [1, 2]}'], ["same length"]),
        (["check", "arm_2r", "--state", '{"q": [1], "v": [1], "tau": [1]}'], ["1 numbers for q", "arm_2r has 2 and 2 degrees of freedom"]),
        (["check", "collar", "--state", '{"q": [NaN], "v": [1], "tau": [1]}'], ["finite"]),
        (["check", "--states", "0"], ["--states"]),
        (["check", "--json", "no/such/folder/out.json", "collar"], ["no/such/folder/out.json", "cannot be written"]),
        (["show", "colar"], ["did you mean 'collar'"]),
        (["report", "--profile", "slow"], ["nightly"]),
        (["bench", "colar"], ["no system is called 'colar'", "did you mean 'collar'"]),
        (["bench", "--methods", "pinocchio abba"], ["no method or integrator is called 'pinocchio abba'", "did you mean 'pinocchio aba'"]),
        (["bench", "--methods", "mujoco RK4"], ["'mujoco RK4' computes motion; ask for it with --motion"]),
        (["bench", "--profile", "thorough"], ["--profile", "quick"]),
        (["bench", "collar", "--out", "/dev/null/reports"], ["/dev/null/reports", "cannot be used"]),
        (["bench", "collar", "--workers", "0"], ["--workers"]),
        (["search", "simple_pendulm"], ["did you mean 'simple_pendulum'?"]),
        (["search", "simple_pendulum", "--subject", "mujoco/urdv"], ["no subject is called 'mujoco/urdv'"]),
        (["search", "simple_pendulum", "--budget", "0"], ["--budget"]),
        (["search"], ["Missing argument"]),
        (["atlas", "stif_spring"], ["did you mean 'stiff_spring'?"]),
        (["atlas", "--subject", "mujoco/urdv"], ["no subject is called 'mujoco/urdv'"]),
        (["atlas", "--library", "nowhere"], ["no such directory"]),
        (["atlas", "--time-limit", "0"], ["--time-limit"]),
        (["nightly", "--stage", "crosscheck"], ["no stage of a night is called 'crosscheck'"]),
        (["nightly", "--engine", "mujoco@0.1"], ["no engine is called 'mujoco@0.1'"]),
        (["nightly", "no_such_system"], ["no system is called 'no_such_system'"]),
        (["nightly", "--stage", "survey", "--survey", "."], ["holds no model of a robot"]),
        (["nightly", "--stage", "survey"], ["no stage has anything to do"]),
    ],
)
def test_it_is_exit_status_2_with_one_message(tmp_path: Path, arguments: list[str], fragments: list[str]) -> None:
    done = harness(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    for fragment in fragments:
        assert fragment.lower() in done.stderr.lower()
    assert not (tmp_path / "reports").exists()


def test_a_system_that_is_not_supported_is_refused_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    done = harness("list")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == "harness: win32 is not supported; use Linux or macOS, on Windows its subsystem for Linux (WSL)\n"
