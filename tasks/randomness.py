"""Random numbers of an environment: of its construction and of its episodes, from one seed."""

import copy

import numpy as np

from selfmodel.errors import InputError

Seed = int | np.random.RandomState | np.random.Generator | None
"""Seed or generator of a task's random numbers; None for another seed each time."""


def episode_numbers(random: Seed) -> np.random.RandomState:
    """Returns the generator of the episodes, as dm_control's tasks have it.

    Args:
        random: A ``RandomState`` is returned itself; a ``Generator`` is advanced by one number.

    Raises:
        InputError: The seed is out of range, or is no whole number.
    """
    if isinstance(random, np.random.RandomState):
        return random
    if isinstance(random, np.random.Generator):
        return np.random.RandomState(int(random.integers(2**32)))
    try:
        return np.random.RandomState(random)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"expected random as a whole number from 0 to {2**32 - 1}, a numpy RandomState or "
            f"Generator, or None, got {random!r}"
        ) from error


def construction_numbers(episodes: np.random.RandomState) -> np.random.Generator:
    """Returns the generator of what is drawn once: the reality gap and the terrain.

    It depends on the state of the episodes' generator, which is not advanced: the initial states of
    a healthy and a damaged robot with the same seed come from the same random numbers.

    Args:
        episodes: Generator of the episodes.
    """
    seed = copy.deepcopy(episodes).randint(2**32, size=4, dtype=np.uint64)
    return np.random.default_rng(seed)


def next_seed(episodes: np.random.RandomState) -> int:
    """Returns the seed of the next episode.

    Args:
        episodes: Generator of the episodes, which is advanced.
    """
    return int(episodes.randint(2**32, dtype=np.uint64))
