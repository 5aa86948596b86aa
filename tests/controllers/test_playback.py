"""Tests of playbacks: the recorded commands are repeated, independently of the sensors."""

import numpy as np
import pytest

from selfmodel.controllers.controller import make_batch
from selfmodel.controllers.playback import Playback, played_back

COMMANDS = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])


def test_commands_are_repeated_in_order_and_the_last_is_held():
    robots = [Playback(("a", "b"), COMMANDS), Playback(("a", "b"), -COMMANDS[:1])]
    brains = make_batch(robots, [frozenset(), {1}], sensors=4)
    targets = np.zeros((2, 2))
    given = []
    for _ in range(5):
        brains.readings[:] = np.random.default_rng(0).normal(size=brains.readings.shape)
        brains.step(targets)
        given.append(targets.copy())

    assert np.array_equal([step[0] for step in given], COMMANDS[[0, 1, 2, 2, 2]])
    assert np.array_equal([step[1] for step in given], -COMMANDS[[0] * 5])


def test_two_recordings_are_equal_when_their_motors_and_bits_are():
    same = Playback(("a", "b"), COMMANDS.copy())

    assert Playback(("a", "b"), COMMANDS) == same
    assert hash(Playback(("a", "b"), COMMANDS)) == hash(same)
    assert Playback(("a", "c"), COMMANDS) != same
    assert Playback(("a", "b"), COMMANDS + 1e-30) == same
    assert Playback(("a", "b"), np.nextafter(COMMANDS, 1)) != same
    assert same != "a recording"


def test_a_missing_command_is_replaced_by_the_one_before_it():
    lost = COMMANDS.copy()
    lost[1, 0] = lost[1:, 1] = np.nan

    expected = [[0.1, 0.2], [0.1, 0.2], [0.5, 0.2]]
    assert np.array_equal(played_back(("a", "b"), lost).commands, expected)
    lost[0] = np.nan
    with pytest.raises(ValueError, match="of step 0 are not all finite"):
        played_back(("a", "b"), lost)


@pytest.mark.parametrize(
    ("commands", "match"),
    [
        (np.zeros((0, 2)), r"got \(0, 2\)"),
        (np.zeros((3, 1)), r"got \(3, 1\)"),
        (np.zeros(2), r"got \(2,\)"),
        (np.array([[0.0, 1.0], [np.nan, 1.0]]), "of step 1 are not all finite"),
        (np.array([[0.0, np.inf]]), "of step 0 are not all finite"),
    ],
)
def test_commands_that_do_not_fit_are_refused(commands: np.ndarray, match: str):
    with pytest.raises(ValueError, match=match):
        Playback(("a", "b"), commands)


def test_a_recording_cannot_be_changed_from_outside():
    values = COMMANDS.copy()
    playback = Playback(("a", "b"), values)
    values[:] = 9

    assert np.array_equal(playback.commands, COMMANDS)
    with pytest.raises(ValueError, match="read-only"):
        playback.commands[0] = 1
