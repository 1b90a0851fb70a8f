"""The inference from the pattern of agreement: who is blamed, who never is, and who is asked next."""

from __future__ import annotations

import itertools

import pytest
from catalogue import BUILT_IN
from hypothesis import example, given
from hypothesis import strategies as st

from harness.engines import subjects
from harness.explain.pattern import RULES, infer, infer_from_records
from harness.results.records import Record
from harness.verdict import SOUND, Verdict

EQUATIONS = "lagrange"
READERS = [f"{engine}/{model_format}" for engine in ("mujoco", "pinocchio") for model_format in ("mjcf", "urdf")]
EVERYONE = [EQUATIONS, *READERS]
AGREES, DISAGREES, UNSTABLE = Verdict.AGREES.value, Verdict.DISAGREES.value, Verdict.UNSTABLE.value

# party at fault -> the subjects it makes wrong
SPOILED = {
    "model mjcf": {"mujoco/mjcf", "pinocchio/mjcf"},
    "model urdf": {"mujoco/urdf", "pinocchio/urdf"},
    "engine mujoco": {"mujoco/mjcf", "mujoco/urdf"},
    "engine pinocchio": {"pinocchio/mjcf", "pinocchio/urdf"},
    **{f"reader {subject}": {subject} for subject in READERS},
    "equations": set(READERS),
    "kernel": {EQUATIONS},
}


def pattern(wrong: set[str], of: list[str] = EVERYONE) -> dict[str, str]:
    return {subject: DISAGREES if subject in wrong else AGREES for subject in of}


def record(system: str, subject: str, verdict: str) -> Record:
    return Record(
        system=system, subject=subject, states=1, verdict=verdict, expected=AGREES, backward_error=0.0,
        relative_error=0.0, worst_state=None, seconds_per_state=None, message="",
    )  # fmt: skip


@pytest.mark.parametrize(("party", "wrong"), SPOILED.items(), ids=list(SPOILED))
def test_each_single_fault_is_named_by_five_subjects(party: str, wrong: set[str]) -> None:
    inference = infer(pattern(wrong))
    assert inference.party == party
    # Those that are right are as much of the reason as those that are wrong.
    assert all(subject in inference.sentence for subject in READERS) and "None" not in inference.sentence


def test_with_two_subjects_the_suspects_and_who_would_decide_are_told() -> None:
    inference = infer(pattern({"mujoco/mjcf"}, ["mujoco/mjcf", "pinocchio/urdf"]))
    assert inference.party == "undecided"
    assert inference.ask[0] == "pinocchio/mjcf"
    for suspect in ("model mjcf", "engine mujoco", "reader mujoco/mjcf"):
        assert suspect in inference.sentence
    assert "model urdf" not in inference.sentence and "engine pinocchio" not in inference.sentence


@pytest.mark.parametrize(("party", "wrong"), [item for item in SPOILED.items() if "mujoco/mjcf" in item[1]])
def test_asking_the_subjects_that_are_named_decides(party: str, wrong: set[str]) -> None:
    start = [EQUATIONS, "mujoco/mjcf", "pinocchio/urdf"]
    inference = infer(pattern(wrong, start))
    assert infer(pattern(wrong, [*start, *inference.ask])).party == party


def test_lost_digits_blame_nobody() -> None:
    inference = infer({**pattern(set()), EQUATIONS: UNSTABLE, "mujoco/mjcf": UNSTABLE})
    assert inference.party == "nothing"
    assert "lagrange, mujoco/mjcf lost digits" in inference.sentence
    # Nor do they speak for a model: both readers would have to.
    assert infer({**pattern({"pinocchio/mjcf"}), "mujoco/mjcf": UNSTABLE}).party == "undecided"


def test_two_faults_are_not_taken_for_one() -> None:
    for wrong in ({"mujoco/mjcf", "pinocchio/urdf"}, {"mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf"}, set(EVERYONE)):
        inference = infer(pattern(wrong))
        assert (inference.party, inference.ask) == ("undecided", ())
        assert inference.sentence.startswith("more than one fault")


def test_an_engine_with_one_format_is_its_reader() -> None:
    subjects_there_are = [*EVERYONE, "mine/mjcf"]
    assert infer(pattern({"mine/mjcf"}, subjects_there_are), subjects_there_are).party == "engine mine"


def test_nothing_judged_is_nothing_said() -> None:
    assert infer({}).party == "undecided"
    assert infer(dict.fromkeys(EVERYONE, Verdict.UNDECIDED.value)).party == "undecided"


VERDICTS = st.sampled_from([verdict.value for verdict in Verdict])
PATTERNS = st.dictionaries(st.sampled_from([*EVERYONE, "mine/mjcf", "theirs/urdf", "other"]), VERDICTS)


@given(PATTERNS, st.booleans())
@example(pattern({"mujoco/mjcf"}, ["mujoco/mjcf"]), False)
def test_no_party_is_blamed_whose_subjects_agree(verdicts: dict[str, str], all_known: bool) -> None:
    """Neither at fault nor among the suspects: who is named makes at least one subject wrong, and none that agrees."""
    inference = infer(verdicts, EVERYONE if all_known else None)
    named = inference.sentence.partition(":")[0] if inference.party == "undecided" else inference.party
    wrong = {subject for subject, verdict in verdicts.items() if verdict in (DISAGREES, Verdict.ERROR.value)}
    right = {subject for subject, verdict in verdicts.items() if verdict in SOUND}
    if not wrong:
        assert inference.party == ("nothing" if right or UNSTABLE in verdicts.values() else "undecided")
    for suspect in named.split(", or "):
        kind, _, name = suspect.partition(" ")
        own = {
            "model": {subject for subject in verdicts if subject.endswith(f"/{name}")},
            "engine": {subject for subject in verdicts if subject.startswith(f"{name}/")},
            "reader": {name},
            "equations": {subject for subject in verdicts if "/" in subject},
            "kernel": {subject for subject in verdicts if "/" not in subject},
        }.get(kind)
        if own is not None:
            assert own & wrong
            assert kind == "kernel" or not own & right
    assert not set(inference.ask) & set(verdicts)


@given(PATTERNS)
def test_who_abstains_changes_no_name(verdicts: dict[str, str]) -> None:
    speaking = {subject: verdict for subject, verdict in verdicts.items() if verdict in (*SOUND, DISAGREES, Verdict.ERROR.value)}
    whole, part = infer(verdicts, list(verdicts)), infer(speaking, list(verdicts))
    if speaking:
        assert whole.party == part.party


def test_the_catalogue_has_the_subjects_that_the_rules_are_for() -> None:
    """Each rule is the only explanation of some pattern of the built-in subjects."""
    names = [str(subject) for subject in subjects(BUILT_IN)]
    parties = {
        infer(pattern(set(wrong), names), names).party.split()[0]
        for size in range(1, len(names) + 1)
        for wrong in itertools.combinations(names, size)
    }
    assert parties >= {rule.party.split()[0] for rule in RULES}


def test_records_are_taken_by_system() -> None:
    records = [record("b", subject, verdict) for subject, verdict in pattern(SPOILED["model urdf"]).items()]
    records.insert(1, record("a", "mujoco/mjcf", AGREES))
    found = infer_from_records(records)
    assert (found["a"].party, found["b"].party) == ("nothing", "model urdf")


def test_a_system_that_cannot_be_used_is_one_fault() -> None:
    error = Verdict.ERROR.value
    assert infer(dict.fromkeys(EVERYONE, error)).party == "system"
    # Two wrong files make every engine fail, but not the equations.
    assert infer({**dict.fromkeys(READERS, error), EQUATIONS: AGREES}).party == "equations"
    assert infer(dict.fromkeys(READERS, error)).party != "system"


def test_the_plain_models_of_a_variant_tell_its_file_from_its_reader_and_from_the_equations() -> None:
    plain = dict.fromkeys(EVERYONE, AGREES)
    for wrong, party in (({"mujoco/mjcf", "pinocchio/mjcf"}, "model mjcf"), ({"pinocchio/mjcf"}, "reader pinocchio/mjcf")):
        own = {subject: DISAGREES if subject in wrong else AGREES for subject in ("mujoco/mjcf", "pinocchio/mjcf")}
        records = [record("arm", subject, verdict) for subject, verdict in plain.items()]
        records += [record("arm.turned", subject, verdict) for subject, verdict in own.items()]
        found = infer_from_records(records, EVERYONE, system_of=lambda name: name.partition(".")[0])
        assert (found["arm"].party, found["arm.turned"].party) == ("nothing", party)
    alone = infer_from_records(records[-2:], EVERYONE, system_of=lambda name: name.partition(".")[0])["arm.turned"]
    assert alone.party == "undecided" and set(alone.ask) <= {subject.replace("/", "/plain ") for subject in EVERYONE}


@pytest.mark.parametrize(
    ("wrong", "mjcf", "urdf", "expected"),
    [
        ({"mujoco/mjcf", "pinocchio/mjcf"}, 1e6, 1.0, "model mjcf"),
        ({"pinocchio/mjcf"}, 1e6, 1.0, "model mjcf"),
        ({"pinocchio/mjcf"}, 1.0, 1.0, "reader pinocchio/mjcf"),
        ({"mujoco/mjcf", "pinocchio/mjcf"}, 1.0, 1.0, "readers mjcf"),
        ({"mujoco/mjcf", "mujoco/urdf"}, 1.0, 1.0, "engine mujoco"),
        (set(READERS), 1e6, 1e6, "equations"),
        ({"mujoco/mjcf", "pinocchio/mjcf", "mujoco/urdf"}, 1e6, 1.0, "undecided"),
        (set(), 1.0, 1.0, "nothing"),
        ({EQUATIONS}, 1.0, 1.0, "kernel"),
    ],
)
def test_what_a_file_means_goes_before_the_majority(wrong: set[str], mjcf: float, urdf: float, expected: str) -> None:
    assert infer(pattern(wrong), meanings={"mjcf": mjcf, "urdf": urdf}).party == expected


def test_two_faults_are_both_told() -> None:
    sentence = infer(pattern({*READERS} - {"pinocchio/urdf"}), meanings={"mjcf": 1e6, "urdf": 1.0}).sentence
    assert sentence.startswith("more than one fault: the mjcf model is at fault: ")
    assert "mujoco/urdf" in sentence and "model urdf" not in sentence
