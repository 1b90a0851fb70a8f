"""The first line that each of four users reads, command by command; ``python tests/first_lines.py`` writes the golden file anew.

The owner of a robot, the maintainer who upgrades an engine, the lecturer with a mechanism of her own, and the reader of the
report. A person reads the golden file after it was written: each first line answers the question of its command, for somebody who knows
nothing else.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from importlib.metadata import distribution
from pathlib import Path

# For the script; pytest has both.
sys.path[:0] = [str(Path(__file__).parents[1])]

import toy_engine  # noqa: E402
from support import Done, harness, without_progress  # noqa: E402

GOLDEN = Path(__file__).parent / "commands" / "first_lines.txt"
BUNDLED = Path(__file__).parents[1] / "harness" / "robots"
MOST_LINES, MOST_LINES_OF_A_PAIR = 15, 30


@dataclass(frozen=True)
class Edit:
    """A copy of a file with one change of its text, in place of a user's."""

    of: str
    pattern: str
    by: str


@dataclass(frozen=True)
class User:
    """One who types commands in a folder of files.

    Attributes:
        files: name in the folder to the file, or to the edit of another. commands: what is typed, in order; `EDIT FILE OLD NEW` edits one.
        versions: of the toy engine, whose library is the folder then.
    """

    title: str
    commands: Sequence[str]
    files: Mapping[str, Path | Edit] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)


HEAVIER = r'<mass value="7"/>', '<mass value="7.7"/>'
BUNDLED_FILES = {name: BUNDLED / name for name in ("arm.urdf", "arm.xml", "quadruped.urdf", "quadruped.xml", "gripper.urdf")}
# An arm with servos in one simulator's file, and in another's, which left the gain of the velocity out; and a table of controls.
SERVOS = (
    r"</mujoco>",
    "".join(
        [
            "  <actuator>\n",
            *(
                f'    <position name="{name}" joint="{joint}" kp="300" kv="5.13" forcerange="-90 90"/>\n'
                for name, joint in (("shoulder", "shoulder_pitch"), ("elbow", "elbow_pitch"))
            ),
            "  </actuator>\n</mujoco>",
        ]
    ),
)
CONTROLLED_FILES = {
    "arm.xml": BUNDLED / "arm.xml",
    "isaac.xml": Edit("arm.xml", *SERVOS),
    "mine.xml": Edit("isaac.xml", r' kv="5.13"', ""),
    "policy.csv": Edit("arm.xml", r"\A(?s:.+)\Z", "time,shoulder,elbow\n0,0.6,-0.4\n0.1,-0.3,0.5\n"),
}
USERS = {
    "owner": User(
        "Owner of a robot, with the files of this repository",
        (
            "compare arm.urdf",
            "compare arm.xml",
            "compare quadruped.urdf",
            "compare gripper.urdf",
            "compare arm.urdf arm.xml",
            "compare quadruped.urdf quadruped.xml",
            "compare arm.urdf heavier.urdf",
            "compare arm.urdf arm.urdf",
            "compare arm.urdf broken.urdf",
            "compare missing.urdf",
            "check arm.urdf --states 100",
            "check arm.urdf --aided --states 100",
            "diagnose arm.urdf --mjcf heavier.xml --states 100",
            "diagnose arm.urdf --states 100",
            "survey .",
        ),
        {
            **BUNDLED_FILES,
            "heavier.urdf": Edit("arm.urdf", *HEAVIER),
            "heavier.xml": Edit("arm.xml", r'mass="7"', 'mass="7.7"'),
            "broken.urdf": Edit("arm.urdf", r"</robot>", ""),
        },
    ),
    "controller": User(
        "Somebody whose policy works in one simulator and not in the other",
        (
            "drift isaac.xml mine.xml --control policy.csv --seconds 0.3",
            "drift mine.xml --control policy.csv --delay 0 0.004 --seconds 0.3",
            "drift mine.xml --by mujoco/Euler --by mujoco/RK4@0.004 --seconds 0.2",
            "drift isaac.xml isaac.xml --seconds 0.2",
            "drift isaac.xml arm.xml",
            "drift isaac.xml mine.xml --control missing.csv",
            "drift isaac.xml --by mujoco --by pinocchio",
        ),
        CONTROLLED_FILES,
    ),
    "maintainer": User(
        "Maintainer who upgrades an engine",
        (
            "upgrade toy 1.0 1.1 --library . --states 100",
            "upgrade toy 1.1 1.2 --library . --states 100",
            "upgrade toy 1.1 1.2 bar_pendulum --library . --states 100",
            "upgrade toy 1.1 9.9 --library . --states 100",
            "check bar_pendulum --library . --subject toy@1.1/urdf --states 100",
            "check bar_pendulum --library . --subject toy@1.2/urdf --states 100",
        ),
        versions={"1.0": toy_engine.RIGHT, "1.1": toy_engine.RIGHT, "1.2": toy_engine.HEAVIER},
    ),
    "lecturer": User(
        "Lecturer with a mechanism of her own",
        (
            "new my_arm --dof 2 --library mine",
            "show my_arm --library mine",
            "check my_arm --library mine --states 100",
            "EDIT mine/urdf/my_arm.urdf 0.25 0.26",
            "check my_arm --library mine --states 100",
            "diagnose my_arm --library mine --states 100",
            "check my_ram --library mine",
            "show collar",
        ),
    ),
    "reader": User(
        "Reader of the report",
        ("list", "list faults", "engines", "engines --library .", "report --library . --out out"),
        versions={"1.0": toy_engine.RIGHT},
    ),
}


def of_others() -> User:
    """The owner with twelve files of ``example-robot-data`` and pairs made of them.

    Raises:
        ImportError: the extra ``robots`` is not installed.
    """
    names = (
        "panda.urdf", "z1.urdf", "ur5_robot.urdf", "kinova.urdf", "so101.urdf", "allegro_right_hand.urdf", "go1.urdf", "solo12.urdf",
        "baxter.urdf", "talos_reduced.urdf", "tiago_no_hand.urdf", "double_pendulum.urdf",
    )  # fmt: skip
    installed = {Path(str(file)).name: Path(str(file.locate())) for file in distribution("example-robot-data").files or []}
    made = {
        "z1_heavier.urdf": Edit("z1.urdf", r'<mass value="0.67332551"', '<mass value="0.7"'),
        "kinova_turned.urdf": Edit("kinova.urdf", r'<origin xyz="0 -0.002 -0.0605"/>', '<origin rpy="0.1 0 0" xyz="0 -0.002 -0.0605"/>'),
        "panda_without_fingers.urdf": Edit("panda.urdf", r'type="prismatic"', 'type="fixed"'),
    }
    pairs = ("z1.urdf z1_heavier.urdf", "kinova.urdf kinova_turned.urdf", "panda.urdf panda_without_fingers.urdf", "z1.urdf panda.urdf")
    commands = [*(f"compare {name}" for name in names), *(f"compare {pair}" for pair in pairs)]
    commands += ["check panda.urdf", "diagnose z1.urdf --urdf z1_heavier.urdf", "survey ."]
    return User("Owner of a robot, with files of example-robot-data", commands, {**{name: installed[name] for name in names}, **made})


@contextmanager
def folder_of(user: User) -> Iterator[Path]:
    """A folder with the files of a user."""
    with ExitStack() as stack:
        root = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if user.versions:
            root = stack.enter_context(toy_engine.planted(root, user.versions))
        texts: dict[str, str] = {}
        for file, content in user.files.items():
            if isinstance(content, Path):
                texts[file] = content.read_text(encoding="utf-8")
            else:
                texts[file], count = re.subn(content.pattern, lambda _, by=content.by: by, texts[content.of])
                assert count, f"{content.of} has nothing like {content.pattern!r}"
            (root / file).write_text(texts[file], encoding="utf-8")
        yield root


def typed(user: User) -> Iterator[tuple[str, Done]]:
    """What a user types, and what comes of it."""
    with folder_of(user) as folder:
        for command in user.commands:
            words = command.split()
            if words[0] == "EDIT":
                file, old, new = folder / words[1], *words[2:]
                assert old in file.read_text(encoding="utf-8"), command
                file.write_text(file.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
            else:
                yield command, harness(*words, cwd=folder)


def first_line(done: Done) -> str:
    """The first line on standard output; of what ends with none, on standard error."""
    lines = [*done.stdout.splitlines(), *without_progress(done.stderr).splitlines()]
    return next((line for line in lines if line.strip()), "")


def told(user: User) -> str:
    """A section of the golden file."""
    lines = [f"# {user.title}"]
    for command, done in typed(user):
        lines += ["", f"$ harness {command}", f"{done.returncode}: {first_line(done)}"]
    return "\n".join(lines)


def all_users() -> dict[str, User]:
    """Every user; that with others' robots is the last."""
    return {**USERS, "of_others": of_others()}


if __name__ == "__main__":
    GOLDEN.write_text("\n\n\n".join(map(told, all_users().values())) + "\n", encoding="utf-8")
