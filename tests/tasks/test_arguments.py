"""Tests of wrong arguments of a task: each is refused with what is expected."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel import tasks
from selfmodel.errors import InputError
from selfmodel.faults.notation import parse
from selfmodel.tasks import suite_bodies

WRONG: list[tuple[str, object, str]] = [
    ("hypotesis", "intact", "unknown argument of the task 'hypotesis': did you mean hypothesis"),
    ("hypothesis", None, "expected a Hypothesis or notation .* got an object of type NoneType"),
    ("hypothesis", ["break:x"], "expected a Hypothesis or notation"),
    ("random", -1, "expected random as a whole number from 0 to 4294967295, .* got -1"),
    ("random", 2**32, "expected random as a whole number"),
    ("random", "one", "expected random as a whole number .* got 'one'"),
    ("random", 1.5, "expected random as a whole number"),
    ("gap", None, "expected a real number as gap, got None: give one such as gap=0.05"),
    ("gap", "0.05", "expected a real number as gap"),
    ("start_noise", "x", "expected a real number as start_noise"),
    ("start_noise", True, "expected a real number as start_noise"),
    ("time_limit", 0, "expected a time_limit above 0 s, such as 10 or .* got 0"),
    ("time_limit", float("nan"), "expected a time_limit above 0 s"),
    ("time_limit", "10", "expected a real number as time_limit"),
]


@pytest.mark.parametrize("number", range(len(WRONG)), ids=lambda number: WRONG[number][0])
def test_a_wrong_argument_is_refused(number: int):
    name, value, message = WRONG[number]
    with pytest.raises(InputError, match=message):
        tasks.load(*(("quadruped", "walk"), ("suite-lqr", "lqr_2_1"))[number % 2], {name: value})


def test_arguments_that_are_no_mapping_are_refused():
    with pytest.raises(
        InputError, match=r"expected task_kwargs as a mapping, .* got an object of type list"
    ):
        tasks.load("quadruped", "walk", ["gap"])  # type: ignore[arg-type]  # the promise


@pytest.mark.parametrize("domain", ["quadruped", "suite-walker"])
def test_a_hypothesis_of_another_body_is_refused(domain: str):
    body = "hopper" if domain == "quadruped" else "cheetah"
    anatomy = suite_bodies.robot(body, suite_bodies.DOMAINS[body][0]).anatomy
    other = parse(f"break:{anatomy.joints[-1].name}", anatomy)

    with pytest.raises(InputError, match="unknown part of break in this body"):
        tasks.load(domain, "walk", {"hypothesis": other})


def test_numbers_of_numpy_are_arguments_and_a_path_is_a_file():
    kwargs = {"random": np.int64(3), "gap": np.float32(0), "time_limit": np.float64(0.02)}

    assert tasks.load("quadruped", "walk", kwargs).reset().first()
    with pytest.raises(InputError, match="no_suffix: expected an MJCF"):
        tasks.load(Path("no_suffix"), "walk")
