"""The record of a pair: what it answered, what was expected of it, and how to see it again."""

from __future__ import annotations

import math
import shlex
from dataclasses import replace

from msgspec import structs

from harness.crosscheck.expected import AGREES, Expectations
from harness.crosscheck.judgement import judge
from harness.crosscheck.progress import Pair
from harness.crosscheck.settings import DEFAULT_STATES, Settings
from harness.crosscheck.stages import NOT_OFFERED
from harness.engines import engine_files
from harness.results.hard_states import replay_command
from harness.results.records import Record, quantity_options
from harness.verdict import Verdict

LOST_DIGITS = "digits are lost as the condition of M, or the distance of its links, explains, and no number of the file does"


def record_of(settings: Settings, expectations: Expectations, name: str, pair: Pair) -> Record:
    """The record of a pair of system ``name``, with the expectations of its quantity."""
    expectation = expectations.of(settings.library.label(name), pair.subject)
    if expectation is AGREES and pair.unsupported and engine_files(settings.library)[pair.subject.engine].elsewhere:
        # What an engine beside the harness cannot do is listed, so that a new refusal shows. Others and other versions say why.
        expectation = structs.replace(AGREES, verdict=Verdict.UNSUPPORTED.value, reason=pair.failure)
    is_of_file = not settings.library.validated_models(name)
    if is_of_file and expectation is AGREES and pair.verdict == Verdict.UNSTABLE and pair.explained == "":
        # A user's file is the truth itself, of which lost digits are an explanation, as ``harness compare`` has it.
        expectation = structs.replace(AGREES, verdict=Verdict.UNSTABLE.value, reason=LOST_DIGITS)
    record = judge(name, str(pair.subject), pair, expectation)
    few = settings.state is not None or settings.states < DEFAULT_STATES
    if few and record.verdict == Verdict.AGREES and expectation.verdict != Verdict.UNSUPPORTED:
        # So few states need not meet the one that the expectation is about.
        record = judge(name, str(pair.subject), pair, AGREES)
    if pair.unsupported and record.message.startswith(NOT_OFFERED):
        # What nobody claims to compute needs no entry that excuses it.
        reason = record.message.removeprefix(NOT_OFFERED)
        record = replace(record, expected=Verdict.UNSUPPORTED.value, expected_reason=reason)

    options = [*settings.replay_options, *quantity_options(pair.quantity)]
    if record.worst_state is not None:
        again = replay_command(name, record.subject, record.worst_state, options)
    else:
        command = ["harness", "check", name, "--subject", record.subject, *options]
        again = shlex.join([*command, "--states", str(settings.states), "--seed", str(settings.seed)])
    shown = record.representative
    return replace(
        record,
        quantity=pair.quantity,
        replay=again,
        representative=shown and replace(shown, replay=replay_command(name, record.subject, shown.state, options)),
        origins=record.origins if settings.state is None else {},
        componentwise_error=None if pair.componentwise is None or math.isnan(pair.componentwise) else pair.componentwise,
    )
