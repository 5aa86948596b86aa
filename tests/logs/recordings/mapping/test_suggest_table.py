"""Promises of a mapping suggested for a table: it fits where the names are usual."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.logs.recordings.mapping.column_words import classified
from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from selfmodel.logs.recordings.mapping.suggest import suggest
from selfmodel.robot.robot import Robot
from tests.logs.recordings.tables.tables import HINGES, write_csv, write_npz


def suggestion(path: Path, robot: Robot) -> str:
    return suggest(path, robot, "biped.xml", with_timestep=True)


@pytest.mark.parametrize(
    ("position", "velocity", "command"),
    [
        ("position.{}", "velocity.{}", "command.{}"),
        ("{}_pos", "{}_vel", "{}_target"),
        ("q_{}", "dq_{}", "q_des_{}"),
        ("joint_{}_angle", "{}.qd", "{}.cmd"),
    ],
)
def test_usual_names_are_mapped(
    position: str, velocity: str, command: str, biped: Robot, tmp_path: Path
):
    row = np.zeros(3)
    found = {"timestamp_ms": np.arange(3)}
    for form in (position, velocity, command):
        found |= {form.format(hinge): row for hinge in HINGES}

    mapping = parse_mapping(suggestion(write_csv(tmp_path / "t.csv", found), biped), "MAP.toml")

    assert mapping.time is not None
    assert (mapping.time.column, mapping.time.unit) == ("timestamp_ms", 10**6)
    for hinge in HINGES:
        assert mapping.joints.links[hinge].name == position.format(hinge)
        assert mapping.joints.velocities[hinge] == velocity.format(hinge)
        assert mapping.commands.links[hinge].name == command.format(hinge)


def test_numbered_columns_are_mapped_in_order_and_marked(biped: Robot, tmp_path: Path):
    names = [f"q{k}" for k in range(4)] + [f"action[{k}]" for k in range(4)]
    found = {"t": np.arange(3.0), **{name: np.zeros(3) for name in names}}

    text = suggestion(write_npz(tmp_path / "t.npz", found), biped)

    assert 'left_hip_y = "q1"  # CHECK: not sure' in text
    assert 'right_hip_y = "action[3]"  # CHECK: not sure' in text


@pytest.mark.parametrize(("period", "unit"), [(0.005, "s"), (5.0, "ms"), (5e3, "us"), (5e6, "ns")])
def test_the_unit_of_time_is_guessed_from_the_rows(
    period: float, unit: str, biped: Robot, tmp_path: Path
):
    path = write_npz(tmp_path / "t.npz", {"time": np.arange(5) * period, "q": np.zeros(5)})

    assert f'unit = "{unit}"  # CHECK' in suggestion(path, biped)


@pytest.mark.parametrize(("unit", "line"), [("deg", 'unit = "deg"\n'), ("rad", 'unit = "rad"')])
def test_degrees_are_in_the_names_of_the_angles(unit: str, line: str, biped: Robot, tmp_path: Path):
    names = [f"{hinge}_angle_{unit}" for hinge in HINGES]
    path = write_csv(tmp_path / "t.csv", {name: np.zeros(2) for name in ("time", *names)})

    assert f"[joints]\n{line}" in suggestion(path, biped)


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_dates_are_nanoseconds(form: str, biped: Robot, tmp_path: Path):
    dates = np.datetime64("2026-01-01", "ns") + np.arange(5) * np.timedelta64(5, "ms")
    if form == "npz":
        path = write_npz(tmp_path / "t.npz", {"time": dates})
    else:
        path = tmp_path / "t.csv"
        path.write_text("\n".join(["time", *map(str, dates)]))

    assert 'unit = "ns"  # CHECK' in suggestion(path, biped)


def test_vectors_are_of_the_base_or_of_the_imu():
    names = [f"base_quat.{axis}" for axis in "xyzw"] + [f"odom_pos_{axis}" for axis in "xyz"]
    names += [f"gyro[{axis}]" for axis in "xyz"] + [f"imu_quat_{axis}" for axis in "wxyz"]

    found = classified(names)

    assert found.base["orientation"] == tuple(f"base_quat.{axis}" for axis in "wxyz")
    assert found.base["position"] == tuple(f"odom_pos_{axis}" for axis in "xyz")
    assert found.imu["angular_velocity"] == tuple(f"gyro[{axis}]" for axis in "xyz")
    assert found.imu["orientation"] == tuple(f"imu_quat_{axis}" for axis in "wxyz")


def test_missing_columns_are_to_be_filled_in(biped: Robot, tmp_path: Path):
    path = write_csv(tmp_path / "t.csv", {"left_force": np.zeros(3), "a": np.zeros(3)})

    text = suggestion(path, biped)

    assert 'column = "?"  # CHANGE: the table has left_force, a' in text
    assert text.count('"?"  # CHANGE') == 9  # the time, four hinges and four motors
    assert '[touch.left_touch]\ncolumn = "left_force"' in text
