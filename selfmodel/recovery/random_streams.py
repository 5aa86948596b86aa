"""Independent random number streams of a recovery, from one seed: one per search.

The draws of a search do not affect the other streams, so each search can be repeated alone. The
reality gap of a simulated physical robot has streams of its own.
"""

import numpy as np


def repair_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a repair: number 0 evolves the gait, 1 follows the first diagnosis."""
    return _stream(seed, 2 * number)


def diagnosis_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a diagnosis, numbered from 1."""
    return _stream(seed, 2 * number - 1)


def choice_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a choice of the next trial: number 1 follows the first diagnosis."""
    return _stream(seed, _CHOICES + number)


def posterior_stream(seed: int) -> np.random.Generator:
    """Returns the stream of the sample of models that trials weight."""
    return _stream(seed, _PHYSICAL - 1)


def gap_stream(seed: int) -> np.random.Generator:
    """Returns the stream of the reality gap of a simulated physical robot."""
    return _stream(seed, _PHYSICAL)


_CHOICES = 2**30
"""First key of the streams of choices, above the keys of any number of searches."""

_PHYSICAL = 2**31
"""First key of the streams of the physical robot, above the keys of any number of searches."""


def _stream(seed: int, key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(key,)))
