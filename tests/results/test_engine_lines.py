"""One sentence for each engine, from its answers alone."""

from __future__ import annotations

from typing import Any

import pytest

from harness.results.engine_lines import EngineOutcome, engine_line


def answer(name: str, verdict: str = "agrees", model_format: str = "mjcf", **about: Any) -> EngineOutcome:
    return EngineOutcome(name=name, format=model_format, outcome=verdict, **about)


def test_what_is_right_is_counted_for_each_format_without_what_the_engine_refuses() -> None:
    answers = [answer("arm"), answer("collar", "unstable"), answer("disc", "unsupported"), answer("arm", model_format="urdf")]
    assert engine_line(answers) == "right on 1 of 2 MJCF and 1 of 1 URDF mechanisms; loses digits on collar; cannot express or refuses disc"


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("misreads", "misreads collar"),
        ("disagrees", "wrong on collar"),
        ("error", "fails on collar"),
        ("undecided", "not judged on collar"),
    ],
)
def test_what_is_wrong_is_named_with_its_mechanism(verdict: str, said: str) -> None:
    assert engine_line([answer("arm"), answer("collar", verdict)]) == f"right on 1 of 2 MJCF mechanisms; {said}"


def test_what_is_misread_is_named_where_it_is_known() -> None:
    answers = [answer("arm.frames", "misreads", readings=["frames", "damping"]), answer("collar.frames", "misreads", readings=["frames"])]
    assert engine_line([*answers, answer("disc", "misreads")]) == "right on 0 of 3 MJCF mechanisms; misreads frames and disc"


def test_softness_is_told_with_its_size_and_with_what_gives() -> None:
    soft = [
        answer("four_bar", features=["loops", "springs"], from_rigid=0.0169),
        answer("atwood", features=["coupled joints"], from_rigid=2.58),
        answer("stiff", features=["loops"], from_rigid=1e-15),
    ]
    told = "loops and coupled joints soft, as documented (accelerations 1.7 % to 258 % from rigid ones, 2 mechanisms)"
    assert engine_line(soft) == f"right on all 3 MJCF mechanisms; {told}"
    assert told in engine_line([*soft, answer("chain", "unstable")]).split("; ")


def test_of_many_the_first_are_named() -> None:
    names = [f"chain_{number}" for number in range(2, 9)]
    assert engine_line([answer(name, "unstable") for name in names]).endswith("loses digits on chain_2, chain_3, chain_4 and 4 more")
    assert engine_line([answer(name, "unstable") for name in names[:4]]).endswith("chain_2, chain_3, chain_4 and chain_5")


def test_robots_are_counted_by_themselves() -> None:
    found = (
        ("go", "explained", "joint damping"),
        ("arm", "agrees", ""),
        ("leg", "explained", "mimic joints"),
        ("hand", "misreads", "frames"),
    )
    robots = [answer(name, outcome, "urdf", is_robot=True, readings=[reading] if reading else []) for name, outcome, reading in found]
    told = "of 4 robot files 1 agrees, 2 explained (joint damping and mimic joints) and 1 misread (frames)"
    assert engine_line([answer("arm"), *robots]) == f"right on 1 of 1 MJCF mechanism; {told}"


def test_the_harness_own_code_reads_no_file_and_an_engine_without_answers_says_so() -> None:
    assert engine_line([answer("arm", model_format="")]) == "right on 1 of 1 mechanism"
    assert engine_line([]) == "nothing was asked of it"
