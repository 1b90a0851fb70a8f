"""Calls of a model's methods, and what is checked of what they return.

What a quantity needs of an engine is ``Calls``. A model in another process answers several of them in one request, and times each there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from harness.arithmetic import KeptArithmetic
from harness.arrays import Array
from harness.engines.engine import Engine, load_keeping_arithmetic
from harness.engines.interface import InvalidAnswer, NotOffered

if TYPE_CHECKING:
    from harness.engines import Model
    from harness.files.model_file import ModelFile
    from harness.programs.states import States


class Call(NamedTuple):
    """A method of a model, its arguments, and the shape of what it returns; with ``part``, of that attribute of what it returns.

    Without a shape it returns no array.
    """

    method: str
    arguments: tuple[Any, ...]
    shape: tuple[int, ...] | None
    part: str = ""


@dataclass(frozen=True)
class Calls:
    """Calls of a model's methods, and what is formed of their answers, which are in the order of the calls."""

    each: tuple[Call, ...]
    formed: Callable[[Sequence[Any]], Any] = lambda answers: answers[0]


def timed_answers_of(model: Model, several: Sequence[Calls]) -> list[tuple[Any, float]]:
    """The answer to each and its seconds, without the way to another process and back; what is asked is asked in order.

    The model is given copies, and may write into them, and return one array each time.

    Raises:
        InvalidAnswer: it is no array of that shape of floating-point numbers, or other arithmetic is left behind.
        NotOffered: the model has no such method.
    """
    return timed_answers_of_each([(model, several)])[0]


def timed_answers_of_each(asked: Sequence[tuple[Model, Sequence[Calls]]]) -> list[list[tuple[Any, float]]]:
    """``timed_answers_of`` several models of one process, see ``process_of``, in one request; raises where one of them does."""
    for model, several in asked:
        require_offered(model, several)
    calls = [(model, [call for one in several for call in one.each]) for model, several in asked]
    answers = _answers_of_each(calls) if any(own for _, own in calls) else [[] for _ in calls]
    return [_formed(several, own) for (_, several), own in zip(asked, answers, strict=True)]


def _answers_of_each(calls: Sequence[tuple[Model, Sequence[Call]]]) -> Sequence[Sequence[tuple[Any, float]]]:
    model, _ = calls[0]
    # Of its class: what stands before a model, and answers some of its methods otherwise, hands on all that it does not know.
    at_once: Any = getattr(type(model), "answers_of_each", None)
    return [answer_each(one, own) for one, own in calls] if at_once is None else at_once(calls)


def _formed(several: Sequence[Calls], answers: Sequence[tuple[Any, float]]) -> list[tuple[Any, float]]:
    left, found = iter(answers), []
    for asked in several:
        own = [next(left) for _ in asked.each]
        checked = [_require_floats(call, answer) for call, (answer, _) in zip(asked.each, own, strict=True)]
        found.append((asked.formed(checked), sum(seconds for _, seconds in own)))
    return found


def require_offered(model: Model, several: Sequence[Calls]) -> None:
    """Raises NotOffered where the model has no method of that name."""
    for call in (call for asked in several for call in asked.each):
        if not hasattr(model, call.method):
            raise NotOffered(f"the engine offers no {call.method.replace('_', ' ')}")


def process_of(model: Model) -> Hashable | None:
    """The process that a model answers from, where that is another one and a request costs the way there and back; None for this one."""
    elsewhere: Any = model if hasattr(type(model), "answers_of_each") else None
    found: Hashable | None = None if elsewhere is None else elsewhere.process
    return found


def asked_accelerations(model: Model, states: States) -> Calls:
    """The call of ``model.forward_dynamics``.

    A model file says nothing of time; a model that is made of equations has ``takes_time = True`` and takes it last. One whose actuators
    act has ``takes_driving = True``, and takes controls and activations last.
    """
    time = (states.time,) if getattr(model, "takes_time", False) else ()
    driving = driving_of(model, states)
    return Calls((Call("forward_dynamics", (states.q, states.v, states.tau, *time, *driving), states.v.shape),))


def driving_of(model: Model, states: States) -> tuple[Array, ...]:
    """Controls and activations for a model that takes some."""
    return (states.control, states.activation) if getattr(model, "takes_driving", False) else ()


def accelerations(model: Model, states: States) -> Array:
    """The answer of ``model.forward_dynamics``, (n, nv), which may hold numbers that are not finite; raises as ``timed_answers_of``."""
    found: Array = timed_answers_of(model, [asked_accelerations(model, states)])[0][0]
    return found


def gaps_of(model: Model, states: States) -> Mapping[str, Array]:
    """The gaps of a model's constraints at ``states``, (n, rows) each, by their names in order; none where it has or says none."""
    found: Mapping[str, Array] = timed_answers_of(model, [_asked_gaps(model, states)])[0][0]
    return found


def accelerations_and_gaps(model: Model, states: States) -> tuple[Array, Mapping[str, Array]]:
    """``accelerations`` and ``gaps_of``, asked for in one request."""
    found: tuple[Array, Mapping[str, Array]] = timed_answers_of(model, [asked_accelerations_and_gaps(model, states)])[0][0]
    return found


def asked_accelerations_and_gaps(model: Model, states: States) -> Calls:
    """The calls of both."""
    motion, gaps = asked_accelerations(model, states), _asked_gaps(model, states)
    return Calls(motion.each + gaps.each, lambda answers: (motion.formed(answers[:1]), gaps.formed(answers[1:])))


def _asked_gaps(model: Model, states: States) -> Calls:
    # A diagnosis asks hundreds of models, most of which tie nothing.
    says_gaps = getattr(model, "is_tied", True) and hasattr(model, "gaps")
    calls = (Call("gaps", (states.q,), None),) if says_gaps else ()
    return Calls(calls, lambda answers: {name: rows[name] for rows in answers for name in sorted(rows)})


def loaded_and_asked(engine: Engine, model: ModelFile, joints: Sequence[str], gravity: float, calls: Sequence[Call]) -> list[Any]:
    """The answers of a file to each call, for ``engine.run``: a changed file of hundreds is loaded to be asked once.

    Raises:
        ValueError: the engine refuses the model. harness.engines.Unsupported: it cannot express it. Others as ``timed_answers_of``.
    """
    loaded = load_keeping_arithmetic(engine, model, joints, gravity)
    found: list[Any] = timed_answers_of(loaded, [Calls(tuple(calls), list)])[0][0]
    return found


def factorises_mass_matrix(model: Model) -> bool:
    """True where a model declares that its accelerations are solved for by a factorisation of M, which may lose digits."""
    return bool(getattr(model, "factorises_mass_matrix", False))


def answer_each(model: Model, calls: Sequence[Call]) -> list[tuple[Any, float]]:
    """The answer of a model in this process to each call, and its seconds; equal answers in a row are one object."""
    found: list[tuple[Any, float]] = []
    for call in calls:
        method, arguments = getattr(model, call.method), tuple(map(_copied, call.arguments))
        started = time.perf_counter()
        answer = called(call.method, method, arguments)
        seconds = time.perf_counter() - started
        answer = _copied(getattr(answer, call.part) if call.part else answer)
        # A timing is of one call several times, whose answers are handed over once.
        found.append((found[-1][0] if found and _is_same(found[-1][0], answer) else answer, seconds))
    return found


def called(method: str, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """The answer of a method of an engine or its model, which is called ``method``.

    Raises:
        InvalidAnswer: it leaves other arithmetic behind.
    """
    with KeptArithmetic() as arithmetic:
        answer = function(*arguments)
    if arithmetic.left:
        raise InvalidAnswer(f"{method} leaves {arithmetic.left} for everything behind it in the process")
    return answer


def _copied(value: Any) -> Any:
    return np.array(value) if isinstance(value, np.ndarray) else value


def _is_same(before: Any, answer: Any) -> bool:
    """True for two arrays of the same bits."""
    arrays = isinstance(before, np.ndarray) and isinstance(answer, np.ndarray) and not answer.dtype.hasobject
    return arrays and (before.shape, before.dtype) == (answer.shape, answer.dtype) and before.tobytes() == answer.tobytes()


def _require_floats(call: Call, answer: Any) -> Any:
    if call.shape is None:
        return answer
    if not isinstance(answer, np.ndarray):
        found = f"a {type(answer).__name__}"
    elif answer.shape != call.shape or not np.issubdtype(answer.dtype, np.floating):
        found = f"an array of shape {answer.shape} of {answer.dtype}"
    else:
        return np.asarray(answer)
    raise InvalidAnswer(f"{call.method} returned {found}; expected an array of shape {call.shape} of float64")
