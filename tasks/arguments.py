"""Arguments that all tasks have: their checks, and what is drawn from them once."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from selfmodel.errors import InputError, check_name, check_type, real_number
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.robot.anatomy import Anatomy
from selfmodel.simulation.domain import ANGLE_DEVIATION
from selfmodel.simulation.reality_gap import RealityGap, draw_gap_of

NAMES = ("hypothesis", "time_limit", "random", "gap", "start_noise")
"""Arguments of every task."""

MAX_START_NOISE = 1.0
"""Largest standard deviation of the initial joint angles, rad."""

Seed = int | np.random.RandomState | np.random.Generator | None
"""Seed or generator of a task's random numbers; None for another seed each time."""


@dataclass(frozen=True, eq=False)
class Reality:
    """The body of a task as it differs from its model, for all episodes.

    Attributes:
        seed: Seed of the random parts of the faults, such as terrain.
        start: Noise of the initial pose, as a level of the reality gap.
    """

    hypothesis: Hypothesis
    gap: RealityGap
    seed: int
    start: float


def check_names(task_kwargs: Mapping[str, Any]) -> None:
    """Checks that all arguments are those of a task.

    Raises:
        InputError: They are no mapping, or one of them is unknown.
    """
    check_type(task_kwargs, Mapping, "task_kwargs as a mapping, such as {'gap': 0.05}")
    for name in task_kwargs:
        check_name("argument of the task", str(name), NAMES)


def check_time_limit(time_limit: float) -> None:
    """Raises ``InputError`` unless the length of an episode is a number above 0."""
    if not real_number("time_limit", time_limit, 10, kind="real") > 0:
        raise InputError(
            f"expected a time_limit above 0 s, such as 10 or float('inf'), got {time_limit!r}"
        )


def random_streams(random: Seed) -> tuple[np.random.RandomState, np.random.Generator]:
    """Returns the generators of the episodes, as dm_control's tasks have it, and of a ``Reality``.

    The second depends on the state of the first, which is not advanced: the initial states of
    a healthy and a damaged robot with the same seed come from the same random numbers.

    Args:
        random: A ``RandomState`` is returned itself; a ``Generator`` is advanced by one number.

    Raises:
        InputError: The seed is out of range, or is no whole number.
    """
    if isinstance(random, np.random.Generator):
        random = int(random.integers(2**32))
    try:
        episodes = (
            random if isinstance(random, np.random.RandomState) else np.random.RandomState(random)
        )
    except (TypeError, ValueError) as error:
        raise InputError(
            f"expected random as a whole number from 0 to {2**32 - 1}, a numpy RandomState or "
            f"Generator, or None, got {random!r}"
        ) from error
    seed = copy.deepcopy(episodes).randint(2**32, size=4, dtype=np.uint64)
    return episodes, np.random.default_rng(seed)


def next_seed(episodes: np.random.RandomState) -> int:
    """Returns the seed of the next episode; the generator of the episodes is advanced."""
    return int(episodes.randint(2**32, dtype=np.uint64))


def draw_reality(
    model: mujoco.MjModel,
    anatomy: Anatomy,
    hypothesis: str | Hypothesis,
    *,
    gap: float,
    start_noise: float | None,
    rng: np.random.Generator,
) -> Reality:
    """Returns the body of a task as its arguments describe it, from the healthy body.

    The start noise is that of the initial joint angles, rad; None for that of the level of the gap.

    Raises:
        InputError: The hypothesis cannot be parsed, has another type, or names a part that the
            body does not have; or a number is none, or out of range.
    """
    if isinstance(hypothesis, str):
        hypothesis = parse(hypothesis, anatomy)
    check_type(hypothesis, Hypothesis, "a Hypothesis or notation such as 'wind=5'")
    for fault in hypothesis.faults:
        known = fault.kind.parts(anatomy)
        check_name(f"part of {fault.kind.name} in this body", fault.part, known)
    drawn = draw_gap_of(model, anatomy, real_number("gap", gap, 0.05, kind="real"), rng)
    start = gap
    if start_noise is not None:
        if not 0 <= real_number("start_noise", start_noise, 0.02, kind="real") <= MAX_START_NOISE:
            raise InputError(
                f"expected a start_noise from 0 to {MAX_START_NOISE:g} rad, such as 0.02, got "
                f"{start_noise}"
            )
        start = start_noise / ANGLE_DEVIATION
    return Reality(hypothesis, drawn, int(rng.integers(2**32)), start)
