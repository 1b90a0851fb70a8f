"""Several subjects asked in one request, which costs a way to another process and back."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

from harness.crosscheck.assignment import Assignment, load_audited
from harness.engines import Calls, Model, process_of, timed_answers_of_each
from harness.study import Note

# Of a note, names those that are asked in one request.
TOGETHER = "together"
# What a model answered to each of several calls, with the seconds of each.
Answered = list[tuple[Any, float]]


def answered_together(
    assignments: Mapping[str, Assignment],
    asks: Callable[[Assignment, Model], Sequence[Calls]],
    note: Note,
    about: Mapping[str, Any],
) -> dict[str, Answered]:
    """By name, answers of subjects that came in one request to each other process that holds the models of several.

    Those of a process in which one of them fails are asked one by one. The note names those that are asked, beside what it says of all.
    """
    by_process: dict[Hashable, dict[str, tuple[Model, Sequence[Calls]]]] = {}
    for name, assignment in assignments.items():
        note(json.dumps({"subject": name, **about}))
        # It is raised where the subject is asked by itself.
        with contextlib.suppress(Exception):
            model = load_audited(assignment)
            if (process := process_of(model)) is not None:
                by_process.setdefault(process, {})[name] = model, asks(assignment, model)
    answered: dict[str, Answered] = {}
    for asked in by_process.values():
        if len(asked) > 1:
            note(json.dumps({TOGETHER: list(asked), **about}))
            with contextlib.suppress(Exception):
                answered |= zip(asked, timed_answers_of_each(list(asked.values())), strict=True)
    return answered
