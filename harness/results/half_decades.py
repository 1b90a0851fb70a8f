"""The half decade that a backward error is in: the same on every machine, to the last bit."""

from __future__ import annotations

import math
from bisect import bisect_right
from decimal import Context, Decimal
from functools import cache

# Of the smallest and of the largest positive float64.
_LEAST, _LARGEST = -647, 616


@cache
def half_decade_edges() -> tuple[float, ...]:
    """The float64 nearest to 10^(k/2), ascending, from that of the smallest to that of the largest half decade of float64.

    Errors are compared with them: a logarithm may err by its last bit, and which way depends on the processor's vector units.
    """
    context = Context(prec=30)
    root = context.sqrt(Decimal(10))
    return tuple(float((root if k % 2 else Decimal(1)).scaleb(k // 2, context)) for k in range(_LEAST, _LARGEST + 1))


def half_decade(backward_error: float) -> str:
    """Key of ``Record.distribution``: the largest k whose edge is not above the error, "exact" for 0, "inf" for no finite number."""
    if not math.isfinite(backward_error):
        return "inf"
    return "exact" if backward_error == 0 else str(_LEAST - 1 + bisect_right(half_decade_edges(), backward_error))
