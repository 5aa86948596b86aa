"""Arguments that all tasks have: their checks, random numbers and start noise."""

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.robot.anatomy import Anatomy
from selfmodel.simulation.domain import ANGLE_DEVIATION

NAMES = ("hypothesis", "time_limit", "random", "gap", "start_noise")
"""Arguments of every task."""


def check_names(task_kwargs: Mapping[str, Any]) -> None:
    """Checks that all arguments are those of a task.

    Raises:
        InputError: They are no mapping, or one of them is unknown.
    """
    if not isinstance(task_kwargs, Mapping):
        raise InputError(
            f"expected task_kwargs as a mapping, such as {{'gap': 0.05}}, got {task_kwargs!r}"
        )
    for name in task_kwargs:
        if name not in NAMES:
            raise unknown_name("argument of the task", str(name), NAMES)


def parsed(hypothesis: str | Hypothesis, anatomy: Anatomy) -> Hypothesis:
    """Returns the hypothesis of a task.

    Args:
        hypothesis: A hypothesis, or its notation with built-in kinds.
        anatomy: Parts of the body.

    Raises:
        InputError: The hypothesis cannot be parsed, has another type, or names a part that the
            body does not have.
    """
    if isinstance(hypothesis, str):
        return parse(hypothesis, anatomy)
    if not isinstance(hypothesis, Hypothesis):
        raise InputError(
            f"expected a hypothesis in notation or as a Hypothesis, such as 'wind=5' or 'intact', "
            f"got {hypothesis!r}"
        )
    for fault in hypothesis.faults:
        known = fault.kind.parts(anatomy)
        if fault.part not in known:
            raise unknown_name(f"part of {fault.kind.name} in this body", fault.part, known)
    return hypothesis


def check_time_limit(time_limit: float) -> None:
    """Checks the length of an episode.

    Raises:
        InputError: It is no number above 0.
    """
    check_number("time_limit", time_limit)
    if not time_limit > 0:
        raise InputError(
            f"expected a time_limit above 0 s, such as 10 or float('inf'), got {time_limit!r}"
        )


def check_number(name: str, value: float) -> None:
    """Checks that an argument is a number, of Python or numpy.

    Raises:
        InputError: It is not.
    """
    if not hasattr(value, "__float__") or isinstance(value, bool):
        raise InputError(f"expected a number as {name}, such as 0.05, got {value!r}")


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


MAX_START_NOISE = 1.0
"""Largest standard deviation of the initial joint angles, rad."""


def start_level(start_noise: float | None, gap: float) -> float:
    """Returns the noise of the initial pose as a level of the reality gap.

    Args:
        start_noise: Standard deviation of the initial joint angles, rad; None for that of the gap.
        gap: Level of the reality gap.

    Raises:
        InputError: The noise is no number, or out of range.
    """
    if start_noise is None:
        return gap
    check_number("start_noise", start_noise)
    if not 0 <= start_noise <= MAX_START_NOISE:
        raise InputError(
            f"expected a start_noise from 0 to {MAX_START_NOISE:g} rad, such as 0.02, got "
            f"{start_noise}"
        )
    return start_noise / ANGLE_DEVIATION
