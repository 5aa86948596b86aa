"""The streams of random numbers of a recovery: one for each search, from one seed.

What one search draws does not move the others, so each can be made again alone. What the physical
robot is like has streams of its own.
"""

import numpy as np


def repair_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a recovery's repairs: 0 is the gait, 1 follows the first diagnosis."""
    return _stream(seed, 2 * number)


def diagnosis_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a recovery's diagnoses: 1 is the first."""
    return _stream(seed, 2 * number - 1)


def choice_stream(seed: int, number: int) -> np.random.Generator:
    """Returns the stream of a recovery's choices of trials: 1 follows the first diagnosis."""
    return _stream(seed, _CHOICES + number)


def gap_stream(seed: int) -> np.random.Generator:
    """Returns the stream that the physical robot's reality gap is drawn from."""
    return _stream(seed, _PHYSICAL)


def structure_stream(seed: int) -> np.random.Generator:
    """Returns the stream that the physical robot's mismatches of structure are drawn from."""
    return _stream(seed, _PHYSICAL + 1)


_CHOICES = 2**30
"""The first key of the choices' streams: no recovery has so many searches."""

_PHYSICAL = 2**31
"""The first key of the physical robot's streams: no recovery has so many searches."""


def _stream(seed: int, key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(key,)))
