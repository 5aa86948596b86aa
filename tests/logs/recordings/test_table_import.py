"""Promises of a table's tracks: units, signs, times and missing numbers."""

import math
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.importer import ImportedTrial, import_recording
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.robot.robot import Robot
from tests.logs.recordings.table_files import MAPPING, WRITERS, columns, write_csv, write_npz


def imported(path: Path, robot: Robot, mapping: str = MAPPING) -> ImportedTrial:
    return import_recording(path, parse_mapping(mapping, "MAP.toml"), robot)


@pytest.mark.parametrize("form", WRITERS)
def test_columns_become_signals_in_the_models_units_and_signs(
    form: str, biped: Robot, tmp_path: Path
):
    found = columns()

    recording = imported(WRITERS[form](tmp_path / f"t.{form}", found), biped)

    signals = recording.behaviour
    assert signals.steps == 20
    np.testing.assert_array_equal(signals["joint_positions"][:, 0], found["q_0"][::2])
    np.testing.assert_array_equal(signals["joint_positions"][:, 1], 0.1 - found["q_1"][::2])
    np.testing.assert_array_equal(signals["joint_velocities"][:, 1], -found["qd_1"][::2])
    assert np.isnan(signals["joint_velocities"][:, 0]).all()
    np.testing.assert_array_equal(signals["commands"][:, 2], found["cmd_2"][::2])
    assert np.allclose(signals["base_position"][-1], [0.19, 0.19, 2.19])
    assert np.isnan(signals["base_orientation"]).all()
    assert signals["sensors"][:, 0].tolist() == ([0.0] * 5 + [1.0] * 5) * 2
    assert recording.clock == "column"
    assert recording.qualities["table"].rate == pytest.approx(200)


@pytest.mark.parametrize(
    ("unit", "times"),
    [
        ("s", columns()["time"] + 1.7e9),
        ("ms", np.arange(40) * 5),
        ("us", columns()["time"] * 1e6),
        ("ns", np.arange(40) * 5_000_000 + 1_700_000_000_123_456_789),
    ],
)
def test_times_may_be_absolute_or_relative_in_any_unit(
    unit: str, times: np.ndarray, biped: Robot, tmp_path: Path
):
    path = write_csv(tmp_path / "t.csv", {**columns(), "time": times})

    recording = imported(path, biped, MAPPING.replace('unit = "s"', f'unit = "{unit}"'))

    assert recording.behaviour.steps == 20
    if unit == "ns":
        assert recording.origin == 1_700_000_000_123_456_789


def test_degrees_and_velocities_in_the_world_are_converted(biped: Robot, tmp_path: Path):
    found = columns()
    half = math.sqrt(0.5)
    base = {"w": half, "x": 0.0, "y": 0.0, "z": half}
    found |= {f"quat_{axis}": np.full(40, value) for axis, value in base.items()}
    found |= {f"vel_{axis}": np.full(40, float(k)) for k, axis in enumerate("xyz")}
    text = MAPPING.replace('[joints]\nunit = "rad"', '[joints]\nunit = "deg"').replace(
        'unit = "mm"',
        'unit = "m"\norientation = ["quat_w", "quat_x", "quat_y", "quat_z"]\n'
        'linear_velocity = ["vel_x", "vel_y", "vel_z"]\nvelocity_frame = "world"',
    )
    text = text.replace("[commands]\n", '[joints.efforts]\nleft_hip_y = "cmd_1"\n\n[commands]\n')
    path = write_npz(tmp_path / "t.npz", found)

    signals = imported(path, biped, text).behaviour
    of_base = imported(path, biped, text.replace('velocity_frame = "world"', "")).behaviour

    assert np.allclose(signals["joint_positions"][:, 0], np.deg2rad(found["q_0"][::2]))
    # The heading at the start, +y, is turned to +x: so is the velocity.
    assert np.allclose(signals["base_linear_velocity"][0], [1.0, 0.0, 2.0])
    # There, the axes of the base are those of the world.
    assert np.allclose(of_base["base_linear_velocity"][0], [0.0, 1.0, 2.0])
    # A torque has the sign of its angle.
    np.testing.assert_array_equal(signals["joint_efforts"][:, 1], -found["cmd_1"][::2])


def test_rows_without_a_time_are_left_out_and_a_gap_is_nan(biped: Robot, tmp_path: Path):
    found = columns()
    found["time"][7] = np.nan
    found["q_2"][20:24] = np.nan

    recording = imported(write_csv(tmp_path / "t.csv", found), biped)

    assert recording.qualities["table"].refused == {"without a time": 1}
    assert any("1 without a time" in note for note in recording.notes)
    assert np.flatnonzero(np.isnan(recording.behaviour["joint_positions"][:, 2])).tolist() == [
        *(10, 11)
    ]


def test_a_date_that_is_missing_is_a_row_without_a_time(biped: Robot, tmp_path: Path):
    found = columns()
    dates = np.datetime64("2026-01-01", "ns") + np.arange(40) * np.timedelta64(5, "ms")
    dates[7] = np.datetime64("NaT")
    path = write_npz(tmp_path / "t.npz", {**found, "time": dates})

    recording = imported(path, biped, MAPPING.replace('unit = "s"', 'unit = "ns"'))

    assert recording.behaviour.steps == 20
    assert recording.origin == 1767225600 * 10**9
    assert recording.qualities["table"].refused == {"without a time": 1}


def test_rows_are_sorted_and_the_first_of_equal_times_is_kept(biped: Robot, tmp_path: Path):
    found = columns()
    order = np.r_[20:40, 0:20, 5]
    twice = {name: values[order] for name, values in found.items()}
    twice["q_0"][-1] = 9.0

    recording = imported(write_csv(tmp_path / "t.csv", twice), biped)

    np.testing.assert_array_equal(recording.behaviour["joint_positions"][:, 0], found["q_0"][::2])
    assert any("out of order" in note for note in recording.notes)
    assert any("1 with a stamp that another has" in note for note in recording.notes)


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e300])
def test_a_number_that_no_robot_has_is_missing(value: float, biped: Robot, tmp_path: Path):
    found = columns()
    found["q_0"][20] = value

    recording = imported(write_npz(tmp_path / "t.npz", found), biped)

    positions = recording.behaviour["joint_positions"][:, 0]
    assert np.flatnonzero(np.isnan(positions)).tolist() == [10]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("q_3", "q_9"), "MAP.toml:14: unknown column of the table 'q_9': did you mean q_"),
        (('left_hip_y = "qd_1"', 'knee = "qd_1"'), "unknown hinge of the robot 'knee'"),
        (('"base_pos_x", ', ""), "position must be a list of length 3"),
        (('[time]\ncolumn = "time"\nunit = "s"', ""), r"MAP.toml:6: .*the mapping \[time\]"),
        (('unit = "s"', 'unit = "min"'), "unknown unit 'min'"),
        (("[commands]\n", '[commands]\ntopic = "/x"\n'), "unknown key of .commands. 'topic'"),
    ],
)
def test_an_error_of_the_mapping_names_its_line(
    change: tuple[str, str], message: str, biped: Robot, tmp_path: Path
):
    path = write_npz(tmp_path / "t.npz", columns())
    assert change[0] in MAPPING

    with pytest.raises(InputError, match=message):
        imported(path, biped, MAPPING.replace(*change))


def test_columns_of_other_lengths_and_impossible_times_are_refused(biped: Robot, tmp_path: Path):
    path = write_npz(tmp_path / "t.npz", {**columns(), "q_0": np.zeros(39)})
    with pytest.raises(InputError, match="expected 40 rows in q_0, as in time, got 39"):
        imported(path, biped)

    for start in (5e9, 1.7e18):  # s
        path = write_npz(tmp_path / "u.npz", {**columns(), "time": columns()["time"] + start})
        with pytest.raises(InputError, match="in row 1: check the unit in"):
            imported(path, biped)


def test_a_trial_is_of_a_length_that_its_log_may_have(biped: Robot, tmp_path: Path):
    path = write_csv(tmp_path / "t.csv", {**columns(), "time": columns()["time"] * 1e4})
    with pytest.raises(InputError, match=r"2 to 100000 steps, got 195001"):
        imported(path, biped)


def test_the_mapping_of_a_table_is_not_that_of_a_bag(biped: Robot, tmp_path: Path):
    with pytest.raises(InputError, match=r"\[time\] is for tables"):
        imported(tmp_path, biped)
