"""Checks of the arguments that all tasks have."""

from collections.abc import Mapping
from typing import Any

from selfmodel.errors import InputError, unknown_name
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.robot.anatomy import Anatomy

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
