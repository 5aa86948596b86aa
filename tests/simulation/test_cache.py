"""Promises of the cache of rows: every key is computed once."""

import numpy as np

from selfmodel.simulation.cache import Cache


def test_a_cache_computes_every_key_once():
    computed: list[str] = []

    def compute(keys: list[str]) -> np.ndarray:
        computed.extend(keys)
        return np.array([[len(key), -len(key)] for key in keys])

    cache: Cache[str] = Cache()

    assert np.array_equal(
        cache.get_or_compute(["a", "bb", "a"], compute), [[1, -1], [2, -2], [1, -1]]
    )
    assert np.array_equal(cache.get_or_compute(["bb", "ccc"], compute), [[2, -2], [3, -3]])
    assert computed == ["a", "bb", "ccc"]
