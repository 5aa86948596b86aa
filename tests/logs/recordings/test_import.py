"""What an import says is what was recorded, and nothing more."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError
from selfmodel.logs import read_log
from selfmodel.logs.log_file import read_contents
from selfmodel.logs.recordings.importer import import_recording, write_recording
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.logs.salvage import salvage
from selfmodel.robot.robot import Robot
from tests.logs.conftest import MJCF
from tests.logs.recordings.bags import ROS, T0, Item, imu, joint_state, trajectory, write_bag
from tests.logs.recordings.conftest import JOINTS, MAPPING, angle, imported, recorded


def without(topic: str, items: list[Item]) -> list[Item]:
    return [item for item in items if item[0] != topic]


def test_a_recording_is_told_in_the_model_s_terms(bag: Path, biped: Robot):
    recording = imported(bag, biped)
    trajectory = recording.trajectory
    seconds = trajectory.time
    assert trajectory.steps == 99  # the odometry ends at 0.98 s
    truth = np.array([[angle(j, t) for j in range(4)] for t in seconds])
    truth[:, 1] = 0.1 - truth[:, 1]
    assert np.allclose(trajectory["joint_positions"], truth, rtol=0, atol=1e-12)
    assert np.allclose(trajectory["commands"], truth, rtol=0, atol=1e-12)
    moving = np.array([[angle(j, t) for j in range(4)] for t in seconds]) * [1, -1, 1, 1]
    assert np.allclose(trajectory["joint_velocities"], moving, rtol=0, atol=1e-12)
    assert np.isnan(trajectory["joint_efforts"]).all()
    touch = [float(k % 20 >= 10) for k in range(99)]
    sensors = trajectory["sensors"]
    assert np.array_equal(sensors[:, 0], touch)
    assert np.isnan(sensors[:, 1]).all()  # nobody tells of the right foot
    assert np.allclose(sensors[:, 2], truth[:, 1] / np.deg2rad(30))
    # The base drove along +y of the odometry, heading 1 rad from its +x: seen from the start.
    assert np.allclose(trajectory["base_position"][0], [0, 0, 0.5])
    travelled = seconds / 2
    assert np.allclose(trajectory["base_position"][:, 0], travelled * np.sin(1))
    assert np.allclose(trajectory["base_position"][:, 1], travelled * np.cos(1))
    half = seconds / 10
    turned = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    assert np.allclose(trajectory["base_orientation"], turned)
    heading = np.stack([np.cos(2 * half), np.sin(2 * half), 0 * half], axis=1)
    assert np.allclose(trajectory["base_linear_velocity"], 0.5 * heading)
    assert np.allclose(trajectory["base_angular_velocity"][:, 2], seconds)  # the imu's
    assert recording.valid["joint_efforts"] == 0
    assert recording.valid["joint_positions"] == 1


def test_a_frame_as_recorded_stays(bag: Path, biped: Robot):
    text = MAPPING.replace('"/odom"', '"/odom"\nframe = "recorded"\nunit = "cm"')
    trajectory = imported(bag, biped, text).trajectory
    assert np.allclose(trajectory["base_position"][0], [0.02, 0.03, 0.005])
    assert np.allclose(trajectory["base_orientation"][0], [np.cos(0.5), 0, 0, np.sin(0.5)])
    assert np.allclose(np.linalg.norm(trajectory["base_linear_velocity"], axis=1), 0.005)


def test_start_and_duration_choose_a_part(bag: Path, biped: Robot):
    whole = imported(bag, biped).trajectory
    part = imported(bag, biped, "start = 0.2\nduration = 0.5\n" + MAPPING).trajectory
    assert part.steps == 50
    assert part.time[0] == 0
    assert np.array_equal(part["commands"], whole["commands"][20:70])
    for wrong, line in (("duration = 5.0", 1), ("start = 2.0", 1)):
        with pytest.raises(
            InputError, match=rf"MAP\.toml:{line}: every role has data for 0\.980 s"
        ):
            imported(bag, biped, f"{wrong}\n{MAPPING}")


def test_of_parts_that_are_left_out_the_commands_alone_are_known(bag: Path, biped: Robot):
    whole = imported(bag, biped).trajectory
    part = imported(bag, biped, "leave_out = [[0.2, 0.3], [0.5, 9]]\n" + MAPPING).trajectory
    out = (abs(whole.time - 0.25) < 0.051) | (whole.time > 0.499)
    for signal, values in whole.signals.items():
        kept = values if signal == "commands" else np.where(out[:, np.newaxis], np.nan, values)
        np.testing.assert_array_equal(part[signal], kept)
    for nothing in ("[0.3, 0.2]", "[50, 90]", "[0.201, 0.204]"):
        with pytest.raises(InputError, match=rf"MAP\.toml:2: .*{re.escape(nothing)}"):
            imported(bag, biped, f"start = 0.0\nleave_out = [{nothing}]\n{MAPPING}")


def test_messages_may_be_partial_and_in_any_order(biped: Robot, tmp_path: Path):
    items = without("/joint_states", recorded())
    for k in range(200):
        stamp = T0 + k * 5_000_000
        at = [angle(j, k / 200) for j in range(4)]
        for some in ([3, 0], [1, 2]):
            names, values = [JOINTS[j] for j in some], [at[j] for j in some]
            late = stamp + 3_000_000 * (1 + some[0])
            items.append(("/joint_states", late, joint_state(stamp, names, values)))
    trajectory = imported(write_bag(tmp_path / "bag", items), biped).trajectory
    truth = np.array([[angle(j, t) for j in range(4)] for t in trajectory.time])
    truth[:, 1] = 0.1 - truth[:, 1]
    assert np.allclose(trajectory["joint_positions"], truth, rtol=0, atol=1e-12)
    assert np.isnan(trajectory["joint_velocities"]).all()


def test_messages_that_contradict_themselves_are_left_out_and_counted(biped: Robot, tmp_path: Path):
    items = recorded()
    for k, message in enumerate(
        [
            joint_state(T0 + 7, JOINTS, [9.0] * 3),
            joint_state(T0 + 7, [*JOINTS[:3], JOINTS[0]], [9.0] * 4),
            joint_state(T0, JOINTS, [9.0] * 4),  # its stamp is the first message's
            joint_state(T0 + 900 * 10**9, JOINTS, [9.0] * 4),
            joint_state(T0 + 500_000_001, JOINTS, [np.nan] * 4),
        ]
    ):
        items.append(("/joint_states", T0 + 600_000_000 + k, message))
    recording = imported(write_bag(tmp_path / "bag", items), biped)
    found = recording.qualities["/joint_states"]
    assert sum(found.refused.values()) == 2
    assert (found.repeated, found.strays, found.reordered) == (1, 1, 2)
    assert "messages left out: 1 with more or fewer numbers than names, 1 with a name twice" in (
        " ".join(recording.notes)
    )
    assert np.nanmax(np.abs(recording.trajectory["joint_positions"])) < 1


@pytest.mark.parametrize("kind", ["JointState", "JointTrajectory"])
def test_commands_come_in_several_types(kind: str, biped: Robot, tmp_path: Path):
    items = without("/commands", recorded())
    for k in range(100):
        stamp, at = T0 + k * 10**7, [angle(j, k / 100) for j in range(4)]
        # A trajectory that is to start at once has no stamp.
        told = joint_state(stamp, JOINTS, at) if kind == "JointState" else trajectory(0, JOINTS, at)
        items.append(("/commands", stamp, told))
    text = MAPPING.replace('order = ["RHY", "RHX", "LHY", "LHX"]\n', "")
    recording = imported(write_bag(tmp_path / "bag", items), biped, text)
    truth = [[angle(j, t) for j in (0, 2, 3)] for t in recording.trajectory.time]
    assert np.allclose(recording.trajectory["commands"][:, [0, 2, 3]], truth)
    assert ("no time stamp" in " ".join(recording.notes)) == (kind == "JointTrajectory")


@pytest.mark.parametrize("known", [True, False])
def test_without_odometry_the_imu_has_the_orientation_if_it_knows_it(
    *, known: bool, biped: Robot, tmp_path: Path
):
    items = without("/imu", without("/odom", recorded()))
    turned = (np.cos(0.2), 0, 0, np.sin(0.2))
    stamps = T0 + np.arange(100) * 10**7
    items += [("/imu", int(t), imu(int(t), turned, (0, 0, 1), known=known)) for t in stamps]
    text = MAPPING.replace('[base]\ntopic = "/odom"\n', "")
    recording = imported(write_bag(tmp_path / "bag", items), biped, text)
    orientation = recording.trajectory["base_orientation"]
    assert np.allclose(orientation, [1, 0, 0, 0]) if known else np.isnan(orientation).all()
    assert np.allclose(recording.trajectory["base_angular_velocity"], [0, 0, 1])
    assert "where the base was is not known" in " ".join(recording.notes)


def test_stamps_of_another_clock_are_refused_unless_told_so(biped: Robot, tmp_path: Path):
    late = [(topic, time + 10**12, message) for topic, time, message in recorded()]
    folder = write_bag(tmp_path / "bag", late)
    with pytest.raises(InputError, match=r'MAP\.toml:5: .* 1000 s apart .* clock = "log"'):
        imported(folder, biped)
    recording = imported(folder, biped, 'clock = "log"\n' + MAPPING)
    assert "all times are log times" in " ".join(recording.notes)
    assert recording.origin == T0 + 10**12 + 15_000_000


def test_a_log_of_an_import_reads_as_what_was_imported(bag: Path, biped: Robot, tmp_path: Path):
    text = f'stage = "before"\n{MAPPING}'
    mapping = parse_mapping(text, "MAP.toml")
    recording = import_recording(bag, mapping, biped)
    path = write_recording(tmp_path / "trial.mcap", biped, recording, mapping, None)
    trial = read_log(path).trial
    for signal, values in recording.trajectory.signals.items():
        assert np.array_equal(trial.trajectory[signal], values, equal_nan=True)
    assert isinstance(trial.plan.controller, Playback)
    assert trial.plan.stage == "before"
    with path.open("rb") as file:
        reader = make_reader(file)
        (told,) = [r.metadata for r in reader.iter_metadata() if r.name == "selfmodel.import"]
        (attached,) = [a.data for a in reader.iter_attachments() if a.name == "mapping.toml"]
    assert attached.decode() == text
    assert json.loads(told["sources_sha256"]).keys() == {"bag.mcap"}
    assert json.loads(told["topics"])["/odom"]["latency"] == pytest.approx(0.015)
    topics = read_contents(path).topics
    for topic in ("/joint_states", "/tf", "/robot_description"):
        assert topics[topic].times[0] == (recording.origin, recording.origin)
    whole = read_log(path).acceleration
    path.write_bytes(path.read_bytes()[:-100])
    salvage(path, tmp_path / "saved.mcap")
    saved = read_log(tmp_path / "saved.mcap")
    assert saved.trial.trajectory.steps == trial.trajectory.steps
    felt = np.array([[k, 0, 9] if not 20 <= k < 30 else [np.nan] * 3 for k in range(99)])
    for acceleration in (whole, saved.acceleration):
        assert np.array_equal(acceleration, felt, equal_nan=True)
    for k, payload in enumerate(topics["/imu"].payloads):
        told = ROS.deserialize_cdr(payload, "sensor_msgs/msg/Imu")
        assert told.linear_acceleration_covariance[0] == (-1 if 20 <= k < 30 else 0)
        assert told.angular_velocity.z == trial.trajectory["base_angular_velocity"][k, 2]
        assert told.orientation.w == trial.trajectory["base_orientation"][k, 0]
        assert told.orientation_covariance[0] == told.angular_velocity_covariance[0] == 0
        assert told.header.frame_id == "torso"


def test_a_cut_between_two_messages_of_a_step_loses_that_step_alone(
    bag: Path, biped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("selfmodel.logs.log_file.CHUNK", 1)  # a message each
    mapping = parse_mapping(f'stage = "before"\n{MAPPING}', "MAP.toml")
    recording = import_recording(bag, mapping, biped)
    path = write_recording(tmp_path / "trial.mcap", biped, recording, mapping, None)
    content, steps = path.read_bytes(), []
    for number, end in enumerate(range(len(content) // 2, len(content), len(content) // 20)):
        path.write_bytes(content[:end])
        salvage(path, tmp_path / f"{number}.mcap")
        saved = read_log(tmp_path / f"{number}.mcap")
        assert len(saved.acceleration) == saved.trial.trajectory.steps
        steps.append(saved.trial.trajectory.steps)
    assert steps == sorted(steps)
    assert len(set(steps)) > 4


def test_a_recording_with_jitter_has_its_gap_marked_and_its_angles_right(
    biped: Robot, tmp_path: Path
):
    rng, items = np.random.default_rng(3), without("/joint_states", recorded())
    stamps = np.array([T0 + 5_000_000 * k for k in range(200) if not 100 <= k < 110])
    stamps += np.rint(rng.normal(0, 300_000, len(stamps))).astype(int)
    told = np.array([[angle(j, (stamp - T0) / 1e9) for j in range(4)] for stamp in stamps])
    for stamp, row in zip(stamps.tolist(), told, strict=True):
        state = joint_state(stamp, JOINTS[::-1], row[::-1], np.full(4, np.nan))
        items.append(("/joint_states", stamp + 2_000_000, state))
    recording = imported(write_bag(tmp_path / "bag", items), biped)
    positions = recording.trajectory["joint_positions"]

    at = recording.origin + np.arange(recording.trajectory.steps) * 10_000_000
    before, periods = np.searchsorted(stamps, at, side="right") - 1, np.diff(stamps)
    unknown = (periods[before] > 1.5 * np.median(periods)) & (stamps[before] != at)
    assert unknown.sum() == 5
    for marked in (np.isnan(positions).all(axis=1), np.isnan(positions).any(axis=1)):
        assert np.array_equal(marked, unknown)
    for column in (0, 2, 3):
        expected = np.interp(at - T0, stamps - T0, told[:, column])
        assert np.allclose(positions[~unknown, column], expected[~unknown], rtol=0, atol=1e-12)
    assert np.isnan(recording.trajectory["joint_velocities"]).all()
    assert np.isfinite(recording.trajectory["base_position"]).all()
    silent = f"/joint_states: silent for {periods.max() / 1e6:.0f} ms"
    assert any(note.startswith(silent) for note in recording.notes)


def test_a_pause_that_is_shorter_than_a_control_step_is_no_gap(biped: Robot, tmp_path: Path):
    items = without("/joint_states", recorded())
    for stamp in (T0 + 1_000_000 * k for k in range(1000) if not 100 < k < 106):
        items.append(("/joint_states", stamp, joint_state(stamp, JOINTS, [0.0] * 4)))
    recording = imported(write_bag(tmp_path / "bag", items), biped)

    assert recording.qualities["/joint_states"].longest == pytest.approx(0.006)
    assert recording.qualities["/joint_states"].gaps == ()
    assert np.isfinite(recording.trajectory["joint_positions"]).all()


@pytest.mark.parametrize("limited", [True, False])
def test_only_a_hinge_without_limits_goes_round(*, limited: bool, tmp_path: Path):
    items = without("/joint_states", recorded())
    for k in range(200):
        stamp, turn = T0 + k * 5_000_000, (k / 40 + np.pi) % (2 * np.pi) - np.pi
        items.append(("/joint_states", stamp, joint_state(stamp, JOINTS, [turn, 0, 0, 0])))
    hinge = 'name="left_hip_x" axis="1 0 0"'
    mjcf = MJCF if limited else MJCF.replace(f'{hinge} range="-30 30"', hinge)
    robot = Robot("biped", mjcf, 0.01)
    trajectory = imported(write_bag(tmp_path / "bag", items), robot).trajectory
    angles = trajectory["joint_positions"][:, 0]
    assert angles.max() < np.pi if limited else np.allclose(angles, trajectory.time * 5)


# ---------------------------------------------------------------- lost encoders

LOST = MAPPING.replace('left_hip_x = "LHX"', 'left_hip_x = "none"', 1)
"""Mapping of the biped whose first hinge has no encoder."""


def test_a_hinge_without_an_encoder_is_not_observed_and_the_rest_is_as_ever(
    bag: Path, biped: Robot
):
    whole, found = imported(bag, biped), imported(bag, biped, LOST)

    assert found.trajectory.time.tobytes() == whole.trajectory.time.tobytes()
    for signal in ("joint_positions", "joint_velocities", "joint_efforts"):
        assert np.isnan(found.trajectory[signal][:, 0]).all()
        np.testing.assert_array_equal(
            found.trajectory[signal][:, 1:], whole.trajectory[signal][:, 1:]
        )
    np.testing.assert_array_equal(found.trajectory["commands"], whole.trajectory["commands"])
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
    *, named: bool, bag: Path, biped: Robot, tmp_path: Path
):
    whole = imported(bag, biped).trajectory
    found = imported(write_bag(tmp_path / "lost", lost_from(0.5, named=named)), biped)
    angles = found.trajectory["joint_positions"]

    assert found.trajectory.steps == whole.steps
    np.testing.assert_array_equal(angles[:, 1:], whole["joint_positions"][:, 1:])
    np.testing.assert_array_equal(angles[:50, 0], whole["joint_positions"][:50, 0])
    assert np.isnan(angles[50:, 0]).all()
    assert "no angle of left_hip_x was observed from 0.500 s on" in found.notes
