"""The streams of random numbers of a recovery: one for each search, from one seed.

What one search draws does not move the others, so each can be made again alone.
"""

import numpy as np


def repair_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a recovery's repairs: 0 is the gait, 1 follows the first diagnosis."""
    return _stream(seed, 2 * number)


def diagnosis_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a recovery's diagnoses: 1 is the first."""
    return _stream(seed, 2 * number - 1)


def _stream(seed: int, key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(key,)))
