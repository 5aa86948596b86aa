"""An encoder that was lost does not end a trial, and is named in the notes of the import."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from tests.logs.recordings.bags import T0, Item, joint_state, write_bag
from tests.logs.recordings.conftest import JOINTS, MAPPING, angle, imported, recorded

LOST = MAPPING.replace('left_hip_x = "LHX"', 'left_hip_x = "none"', 1)
"""Mapping of the biped whose first hinge has no encoder."""


def test_a_hinge_without_an_encoder_is_not_observed_and_the_rest_is_as_ever(
    bag: Path, biped: Robot
):
    whole, found = imported(bag, biped), imported(bag, biped, LOST)

    assert found.behaviour.time.tobytes() == whole.behaviour.time.tobytes()
    for signal in ("joint_positions", "joint_velocities", "joint_efforts"):
        assert np.isnan(found.behaviour[signal][:, 0]).all()
        np.testing.assert_array_equal(
            found.behaviour[signal][:, 1:], whole.behaviour[signal][:, 1:]
        )
    np.testing.assert_array_equal(found.behaviour["commands"], whole.behaviour["commands"])
    assert "no angle of left_hip_x was observed, as 'none' says" in found.notes


def lost_from(second: float, *, named: bool) -> list[Item]:
    """A recording whose first encoder is NaN, or no longer named, from some second on."""
    items = [item for item in recorded() if item[0] != "/joint_states"]
    for k in range(200):
        stamp, at = T0 + k * 5_000_000, [angle(j, k / 200) for j in range(4)]
        first = 0
        if k / 200 >= second:
            at[0], first = np.nan, 0 if named else 1
        items.append(("/joint_states", stamp, joint_state(stamp, JOINTS[first:], at[first:])))
    return items


@pytest.mark.parametrize("named", [True, False], ids=["NaN", "gone"])
def test_an_encoder_that_is_lost_midway_does_not_end_the_trial(
    named: bool,  # noqa: FBT001 - a parameter of the test
    bag: Path,
    biped: Robot,
    tmp_path: Path,
):
    whole = imported(bag, biped).behaviour
    found = imported(write_bag(tmp_path / "lost", lost_from(0.5, named=named)), biped)
    angles = found.behaviour["joint_positions"]

    assert found.behaviour.steps == whole.steps
    np.testing.assert_array_equal(angles[:, 1:], whole["joint_positions"][:, 1:])
    np.testing.assert_array_equal(angles[:50, 0], whole["joint_positions"][:50, 0])
    assert np.isnan(angles[50:, 0]).all()
    assert "no angle of left_hip_x was observed from 0.500 s on" in found.notes


def test_an_encoder_of_nothing_but_nan_is_lost(biped: Robot, tmp_path: Path):
    found = imported(write_bag(tmp_path / "lost", lost_from(0.0, named=True)), biped)

    assert np.isnan(found.behaviour["joint_positions"][:, 0]).all()
    assert "no angle of left_hip_x was observed" in found.notes


def test_a_recording_without_any_angle_is_refused(biped: Robot, tmp_path: Path):
    items = [item for item in recorded() if item[0] != "/joint_states"]
    items += [("/joint_states", T0 + k, joint_state(T0 + k, JOINTS, [np.nan] * 4)) for k in (1, 2)]

    with pytest.raises(InputError, match="/joint_states has no number for left_hip_x"):
        imported(write_bag(tmp_path / "bag", items), biped)
