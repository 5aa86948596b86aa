"""Promises of policies that are functions: called as said, checked, and named where they fail."""

from collections.abc import Callable

import numpy as np
import pytest

from selfmodel.controllers.function import Function
from selfmodel.errors import TrialError
from tests.helpers.policies import commanded, policy, random_network

NETWORK = random_network(10, 8, 2)


def function(own: Callable[[np.ndarray], object], *, batched: bool = False) -> Function:
    return Function("mine:policy", own, 2, batched)


def test_a_function_that_computes_a_network_gives_its_commands_to_the_bit():
    alone = function(lambda seen: NETWORK(seen[np.newaxis])[0])
    together = function(NETWORK, batched=True)
    expected = commanded(policy(graph=NETWORK), np.empty((3, 0)), rows=slice(0, 3), count=3)

    for own in (alone, together):
        found = commanded(policy(graph=own), np.empty((3, 0)), rows=slice(0, 3), count=3)
        assert found.tobytes() == expected.tobytes()
    assert policy(graph=alone).inputs == 3 + 2 + 2 + 3
    assert (
        "10 observations, 2 motors and the function mine:policy" in policy(graph=alone).description
    )


def test_a_function_is_called_for_one_robot_after_another_or_once_for_all():
    shapes = list[tuple[int, ...]]()

    def told(seen: np.ndarray) -> np.ndarray:
        shapes.append(seen.shape)
        return np.zeros((*seen.shape[:-1], 2))

    for batched in (False, True):
        function(told, batched=batched).step(np.zeros((3, 10)), ())
    assert shapes == [(10,)] * 3 + [(3, 10)]


@pytest.mark.parametrize("batched", [False, True])
def test_a_simulation_that_diverged_has_no_action_and_the_others_have_theirs(*, batched: bool):
    def careful(seen: np.ndarray) -> np.ndarray:
        assert np.isfinite(seen).all()
        return seen[..., :2]

    rows = np.arange(12.0).reshape(3, 4)
    rows[1, 3] = np.nan
    found, _ = function(careful, batched=batched).step(rows, ())
    np.testing.assert_array_equal(found, [[0, 1], [np.nan] * 2, [8, 9]])


def test_a_function_may_not_change_what_the_robot_observes():
    rows = np.ones((2, 4))
    function(lambda seen: np.subtract(seen, 1, out=seen)[:2]).step(rows, ())
    np.testing.assert_array_equal(rows, np.ones((2, 4)))


CALLS = list[int]()


def with_a_state(_: np.ndarray) -> list[float]:
    CALLS.append(0)
    return [len(CALLS) / 4, 0]


def failing(_: np.ndarray) -> None:
    raise ValueError("two\nlines")


WRONG = {
    r"returns int64 numbers of the shape \(3,\), expected real .* \(2,\)": lambda _: [1, 2, 3],
    r"returns object numbers of the shape": lambda _: None,
    r"returns complex128 numbers of the shape \(2,\), expected real": lambda _: [1j, 2],
    r"returns \[1.0, nan\], expected finite numbers": lambda _: [1, np.nan],
    "failed: ValueError: two lines$": failing,
    "failed: ValueError: could not convert": lambda _: "left",
    "returns two actions for one observation, which differ by 0.5: it has a state": with_a_state,
}


@pytest.mark.parametrize(("match", "own"), WRONG.items())
def test_what_is_no_function_of_the_observation_is_refused_by_its_name(
    match: str, own: Callable[[np.ndarray], object]
):
    with pytest.raises(TrialError, match=f"the function mine:policy {match}"):
        function(own).check(np.zeros(4))


def test_a_function_called_batched_has_to_take_a_batch():
    own = function(lambda seen: seen[:2], batched=True)
    with pytest.raises(TrialError, match=r"of the shape \(1, 4\), expected .* \(1, 2\)"):
        own.check(np.zeros(4))
