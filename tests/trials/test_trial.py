"""Promises of trials: those of arrays, which are checked; their names, parts and magnitudes."""

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import selfmodel
from selfmodel import Trial
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import columns_of
from selfmodel.trials.trial import (
    MAX_VALUE,
    TrialPart,
    check_magnitudes,
    observed_as,
    trial_names,
    whole,
)
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import gait, logged
from tests.helpers.hostile import with_value
from tests.logs.conftest import biped  # noqa: F401 - a fixture

WALK = logged(gait(steps=200))


def arrays(robot: Robot, steps: int = 6) -> dict[str, Any]:
    names = robot.anatomy.names
    rng = np.random.default_rng(1)
    return {
        "joint_positions": rng.normal(size=(steps, len(names.hinges))),
        "commands": rng.normal(size=(steps, len(names.motors))),
    }


def test_signals_that_were_not_measured_are_nan_and_columns_may_be_in_another_order(
    biped: Robot,  # noqa: F811
):
    given, order = arrays(biped), biped.anatomy.hinges[::-1]
    trial = Trial.from_arrays(biped, **given, stage="before", joint_names=order)
    reversed_angles = given["joint_positions"][:, ::-1]

    np.testing.assert_array_equal(trial.trajectory["commands"], given["commands"])
    np.testing.assert_array_equal(trial.trajectory["joint_positions"], reversed_angles)
    assert np.isnan(trial.trajectory["base_position"]).all()
    assert np.isnan(trial.displacement)
    assert trial.plan.stage == "before"
    assert isinstance(trial.plan.controller, Playback)


def test_trials_of_other_numbers_have_other_paths(biped: Robot):  # noqa: F811
    first, second = arrays(biped), arrays(biped)
    second["commands"] = second["commands"] + 1

    paths = [Trial.from_arrays(biped, **given).path for given in (first, first, second)]
    assert paths[0] == paths[1] != paths[2]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"joint_positions": np.zeros((6, 3))},
            r"joint_positions must have the shape \(steps, hinges\) = \(6, 4\), got \(6, 3\): ",
        ),
        ({"commands": np.zeros(6)}, r"commands must have the shape \(steps, motors\)"),
        ({"commands": [["a"]]}, "commands must be an array of numbers, got list"),
        ({"commands": np.full((6, 4), np.nan)}, "begin the arrays at the first row with all"),
        (
            {"time": np.arange(6) * 0.02},
            r"row 1 is 0.02 s after row 0, not 0.01 s: load the robot with",
        ),
        ({"time": [0, 0.01, 0.02, np.nan, 0.04, 0.05]}, "row 3 is nan s after row 0"),
        ({"joint_positions": np.full((6, 4), np.inf)}, "infinite number in row 0, column 0: set"),
        ({"base_orientation": np.zeros((6, 4))}, "one of length 0 in row 0: normalise it, or"),
        ({"stage": "befor"}, "unknown stage 'befor': did you mean before"),
        ({"robot": "biped"}, r"got its name 'biped': use selfmodel\.load_robot\('biped'\)"),
        ({"time": np.arange(5) * 0.01}, r"time must have the shape \(steps,\) = \(6,\)"),
        ({"joint_names": ("a", "b", "c", "d")}, "unknown column of joint_positions 'a'"),
        ({"joint_names": ("left_hip_x",) * 4}, "must be each of left_hip_x, .* once, got"),
        (
            {"joint_positions": np.zeros((0, 4)), "commands": np.zeros((0, 4))},
            "a trial needs at least two rows",
        ),
    ],
)
def test_an_error_has_the_expected_shape_and_the_remedy(
    change: dict[str, Any],
    message: str,
    biped: Robot,  # noqa: F811
):
    with pytest.raises(InputError, match=message):
        Trial.from_arrays(**{"robot": biped, **arrays(biped), **change})


def test_times_may_begin_anywhere_and_jitter_and_orientations_be_rounded_or_missing(
    biped: Robot,  # noqa: F811
):
    time = 1.7e9 + 0.01 * np.arange(6) + [0, 0.004, -0.004, 0.004, 0, 0]
    given = np.tile([0.7071, 0, 0, 0.7071], (6, 1))
    given[2] = np.nan
    trial = Trial.from_arrays(biped, **arrays(biped), time=time, base_orientation=given)

    np.testing.assert_allclose(trial.trajectory.time, 0.01 * np.arange(6))
    np.testing.assert_array_equal(trial.trajectory["base_orientation"], given)


def test_a_trial_is_a_table_of_pandas(biped: Robot):  # noqa: F811
    position = np.tile([1.0, np.nan, 1.0], (6, 1))
    trial = Trial.from_arrays(biped, **arrays(biped), base_position=position)

    table = trial.to_pandas()

    assert isinstance(table, pd.DataFrame)
    assert list(table) == list(columns_of(trial.trajectory))
    assert {"time", "position.left_hip_x", "command.left_hip_x", "base_position.y"} <= set(table)
    assert "velocity.left_hip_x" not in table


def test_a_trial_of_the_arrays_of_a_log_is_that_of_the_log(quadruped: Robot, tmp_path: Path):
    (walk,) = random_controllers(quadruped, 1)
    damaged = selfmodel.simulated_robot(quadruped, "break:front_left_knee")
    path = tmp_path / "a.mcap"
    logged = selfmodel.run_trial(damaged, walk, path, robot=quadruped, steps=60)
    trial = Trial.from_arrays(quadruped, **logged.trajectory.signals, controller=walk)
    again = selfmodel.write_log(trial, tmp_path / "b.mcap", quadruped)

    assert trial.content == logged.content == selfmodel.read_log(again).trial.content


def test_a_copy_of_a_log_has_its_late_steps(biped: Robot, tmp_path: Path):  # noqa: F811
    one = Trial.from_arrays(biped, **arrays(biped))
    late = np.arange(one.trajectory.steps) % 3 == 1
    disturbed = dataclasses.replace(one, trajectory=dataclasses.replace(one.trajectory, late=late))
    again = selfmodel.read_log(selfmodel.write_log(disturbed, tmp_path / "a.mcap", biped)).trial

    assert again.content == disturbed.content != one.content


def test_a_trial_is_known_by_what_was_run_and_observed_and_not_by_its_path(biped: Robot):  # noqa: F811
    one = Trial.from_arrays(biped, **arrays(biped))
    signals = dict(one.trajectory.signals)
    signals["joint_positions"] = signals["joint_positions"] + 5.0
    moved = dataclasses.replace(one.trajectory, signals=signals)
    later = dataclasses.replace(one.trajectory, time=one.trajectory.time + 1)
    silent = dataclasses.replace(
        one.plan,
        controller=Playback(biped.anatomy.motors, np.zeros((1, len(biped.anatomy.motors)))),
    )

    assert dataclasses.replace(one, path="elsewhere.mcap").content == one.content
    for other in ({"trajectory": moved}, {"trajectory": later}, {"plan": silent}):
        assert dataclasses.replace(one, **other).content != one.content


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (("runs/monday.mcap", "tuesday.2.MCAP"), ("monday", "tuesday.2")),
        (("a/walk.mcap", "b/walk.mcap", "b/run.mcap"), ("a/walk.mcap", "b/walk.mcap", "run")),
        (("made-up (0a1b)",), (WALK.plan.name,)),
        (("made-up (0a1b)", "made-up (2c3d)"), ("made-up (0a1b)", "made-up (2c3d)")),
    ],
)
def test_a_trial_has_the_name_of_its_file_or_plan_or_where_it_is_ambiguous_its_path(
    paths: tuple[str, ...], names: tuple[str, ...]
):
    found = trial_names([dataclasses.replace(WALK, path=path) for path in paths])

    assert found == dict(zip(paths, names, strict=True))


def test_a_part_has_the_rows_between_its_times_with_both_ends_and_their_late_steps():
    late = np.zeros(200, dtype=bool)
    late[60] = True
    own = logged(dataclasses.replace(WALK.trajectory, late=late))
    rows = TrialPart(own, 0.5, 1.0).rows

    for signal, values in WALK.trajectory.signals.items():
        np.testing.assert_array_equal(rows.trajectory[signal], values[50:101])
    assert np.flatnonzero(rows.trajectory.late).tolist() == [10]
    assert (rows.plan, rows.path) == (own.plan, own.path)


def test_a_part_is_whole_only_without_any_bound():
    part = TrialPart(WALK, begin=0.0)

    assert whole(WALK).is_whole
    assert whole(part) is part
    assert not part.is_whole
    assert not TrialPart(WALK, end=1e300).is_whole


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e308, -1.001 * MAX_VALUE])
def test_the_first_number_that_no_robot_has_is_named_with_its_column_and_step(value: float):
    wrong = with_value(WALK, "joint_velocities", 3, 2, value)
    name = WALK.trajectory.names.hinges[2]
    with pytest.raises(
        InputError, match=re.escape(f"joint_velocities {name} is {value:g} at step 3, ")
    ):
        check_magnitudes(wrong, SIGNALS)
    check_magnitudes(wrong, ("base_position", "commands"))


@pytest.mark.parametrize("value", [np.nan, MAX_VALUE, -5e6])
def test_what_was_not_observed_and_coordinates_of_maps_are_no_absurd_numbers(value: float):
    check_magnitudes(with_value(WALK, "base_position", 0, 1, value), SIGNALS)


@pytest.mark.parametrize("lost", [[2], [1, 3]])
def test_a_reference_lacks_what_one_of_the_others_lacks(lost: list[int]):
    angles = WALK.trajectory["joint_positions"].copy()
    angles[:, lost] = np.nan
    signals = {**WALK.trajectory.signals, "joint_positions": angles}
    damaged = logged(dataclasses.replace(WALK.trajectory, signals=signals))
    found = observed_as(WALK, [WALK, damaged])

    known = np.isfinite(found.trajectory["joint_positions"]).all(axis=0)
    assert np.flatnonzero(~known).tolist() == lost
    assert observed_as(damaged, [damaged]) is damaged
    assert observed_as(WALK, []) is WALK


def test_the_time_step_of_a_trial_is_the_mean_of_all():
    trajectory = WALK.trajectory
    time = trajectory.time.copy()
    time[1:] += 0.1

    changed = dataclasses.replace(trajectory, time=time)
    assert changed.timestep == pytest.approx((time[-1] - time[0]) / (len(time) - 1))
    assert changed.timestep > trajectory.timestep
