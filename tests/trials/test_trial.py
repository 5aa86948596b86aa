"""Promises of a trial of arrays: every shape is checked, and it is worth as much as a log."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmodel
from selfmodel import Trial
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError
from selfmodel.robot.robot import Robot
from selfmodel.trials.columns import columns_of
from tests.logs.conftest import biped  # noqa: F401 - a fixture


def arrays(robot: Robot, steps: int = 6) -> dict[str, Any]:
    names = robot.anatomy.names
    rng = np.random.default_rng(1)
    return {
        "joint_positions": rng.normal(size=(steps, len(names.hinges))),
        "commands": rng.normal(size=(steps, len(names.motors))),
    }


def test_signals_that_were_not_measured_are_nan(biped: Robot):  # noqa: F811
    given = arrays(biped)

    trial = Trial.from_arrays(biped, **given, stage="before")

    np.testing.assert_array_equal(trial.behaviour["commands"], given["commands"])
    assert np.isnan(trial.behaviour["base_position"]).all()
    assert np.isnan(trial.displacement)
    assert trial.plan.stage == "before"
    assert isinstance(trial.plan.controller, Playback)


def test_columns_may_be_in_another_order(biped: Robot):  # noqa: F811
    given, hinges = arrays(biped), biped.anatomy.hinges
    order = hinges[::-1]

    trial = Trial.from_arrays(biped, **given, joint_names=order)

    np.testing.assert_array_equal(
        trial.behaviour["joint_positions"], given["joint_positions"][:, ::-1]
    )


def test_trials_of_other_numbers_have_other_paths(biped: Robot):  # noqa: F811
    first, second = arrays(biped), arrays(biped)
    second["commands"] = second["commands"] + 1

    paths = [Trial.from_arrays(biped, **given).path for given in (first, first, second)]

    assert paths[0] == paths[1] != paths[2]


def test_a_trial_is_known_by_what_was_run_and_observed_and_not_by_its_path(biped: Robot):  # noqa: F811
    one = Trial.from_arrays(biped, **arrays(biped))
    signals = dict(one.behaviour.signals)
    signals["base_position"] = signals["base_position"] + 5.0
    moved = dataclasses.replace(one.behaviour, signals=signals)
    later = dataclasses.replace(one.behaviour, time=one.behaviour.time + 1)
    silent = dataclasses.replace(
        one.plan,
        controller=Playback(biped.anatomy.motors, np.zeros((1, len(biped.anatomy.motors)))),
    )

    assert dataclasses.replace(one, path="elsewhere.mcap").content == one.content
    for other in ({"behaviour": moved}, {"behaviour": later}, {"plan": silent}):
        assert dataclasses.replace(one, **other).content != one.content


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"joint_positions": np.zeros((6, 3))},
            r"joint_positions must have the shape \(steps, hinges\) = \(6, 4\), got \(6, 3\): ",
        ),
        ({"joint_velocities": np.zeros((5, 4))}, r"= \(6, 4\), got \(5, 4\)"),
        ({"commands": np.zeros(6)}, r"commands must have the shape \(steps, motors\)"),
        ({"commands": [["a"]]}, "commands must be an array of numbers, got list"),
        ({"commands": np.full((6, 4), np.nan)}, "begin the arrays at the first row with all"),
        ({"base_orientation": np.zeros((6, 3))}, "its columns are w, x, y, z"),
        (
            {"time": np.arange(6) * 0.02},
            r"row 1 is 0.02 s after row 0, not 0.01 s: load the robot with",
        ),
        ({"time": np.arange(6) * 0.0112}, "row 5 is 0.056 s after row 0, not 0.05 s"),
        ({"time": [0, 0.01, 0.02, np.nan, 0.04, 0.05]}, "row 3 is nan s after row 0"),
        ({"joint_positions": np.full((6, 4), np.inf)}, "infinite number in row 0, column 0: set"),
        ({"base_orientation": np.zeros((6, 4))}, "one of length 0 in row 0: normalise it, or"),
        ({"stage": "befor"}, "unknown stage 'befor': did you mean before"),
        ({"robot": "biped"}, r"got its name 'biped': use selfmodel\.load_robot\('biped'\)"),
        ({"time": np.arange(5) * 0.01}, r"time must have the shape \(steps,\) = \(6,\)"),
        ({"joint_names": ("a", "b", "c", "d")}, "unknown column of joint_positions 'a'"),
        ({"joint_names": ("left_hip_x",) * 4}, "must be each of left_hip_x, .* once, got"),
    ],
)
def test_an_error_has_the_expected_shape_and_the_remedy(
    change: dict[str, Any],
    message: str,
    biped: Robot,  # noqa: F811
):
    with pytest.raises(InputError, match=message):
        Trial.from_arrays(**{"robot": biped, **arrays(biped), **change})


def test_times_may_begin_anywhere_and_jitter(biped: Robot):  # noqa: F811
    time = 1.7e9 + 0.01 * np.arange(6) + [0, 0.004, -0.004, 0.004, 0, 0]

    trial = Trial.from_arrays(biped, **arrays(biped), time=time)

    np.testing.assert_allclose(trial.behaviour.time, 0.01 * np.arange(6))


def test_orientations_may_be_rounded_or_missing(biped: Robot):  # noqa: F811
    given = np.tile([0.7071, 0, 0, 0.7071], (6, 1))
    given[2] = np.nan

    trial = Trial.from_arrays(biped, **arrays(biped), base_orientation=given)

    np.testing.assert_array_equal(trial.behaviour["base_orientation"], given)


def test_fewer_than_two_rows_are_no_trial(biped: Robot):  # noqa: F811
    with pytest.raises(InputError, match="a trial needs at least two rows"):
        Trial.from_arrays(biped, np.zeros((0, 4)), np.zeros((0, 4)))


def test_a_trial_is_a_table_of_pandas(biped: Robot):  # noqa: F811
    pandas = pytest.importorskip(
        "pandas", reason="pandas is not installed: pip install 'selfmodel[tables]'"
    )
    trial = Trial.from_arrays(biped, **arrays(biped), base_position=np.ones((6, 3)))

    table = trial.to_pandas()

    assert isinstance(table, pandas.DataFrame)
    assert list(table) == list(columns_of(trial.behaviour))
    assert {"time", "position.left_hip_x", "command.left_hip_x", "base_position.z"} <= set(table)
    assert "velocity.left_hip_x" not in table


@pytest.mark.search
def test_a_trial_of_arrays_is_diagnosed_calibrated_and_logged_as_its_log(tmp_path: Path):
    robot = selfmodel.load_robot("quadruped")
    settings = selfmodel.Settings(steps=60, generations=2).scaled(6)
    walk = selfmodel.evolve_controller(robot, settings=settings)
    damaged = selfmodel.simulated_robot(robot, "break:front_left_knee")
    logged = selfmodel.run_trial(damaged, walk, tmp_path / "a.mcap", robot=robot, steps=60)

    trial = Trial.from_arrays(robot, **logged.behaviour.signals, controller=walk)

    first, second = (
        selfmodel.diagnose(one, robot=robot, settings=settings, seed=1) for one in (logged, trial)
    )
    assert first.to_dict() == second.to_dict()
    assert selfmodel.calibrate(trial, robot).error == selfmodel.calibrate(logged, robot).error
    again = selfmodel.read_log(selfmodel.write_log(trial, tmp_path / "b.mcap", robot)).trial
    for signal, values in logged.behaviour.signals.items():
        np.testing.assert_array_equal(again.behaviour[signal], values)
