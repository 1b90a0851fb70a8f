"""The distribution of a batch of errors is that of each by itself."""

from __future__ import annotations

from collections import Counter

import numpy as np

from harness.crosscheck.judgement import distribution_of
from harness.results.quantiles import half_decade, half_decade_edges


def test_a_batch_has_the_half_decades_of_its_errors_in_their_order() -> None:
    draw = np.random.default_rng(0)
    edges = np.array(half_decade_edges())
    errors = np.concatenate(
        [10.0 ** draw.uniform(-12, 6, 2000), edges, np.nextafter(edges, 0), np.nextafter(edges, np.inf), [0.0, np.inf, np.nan, 0.0]]
    )
    draw.shuffle(errors)
    one_by_one = Counter(map(half_decade, errors.tolist()))
    assert list(distribution_of(errors).items()) == list(one_by_one.items())
    assert distribution_of(np.empty(0)) == {}
