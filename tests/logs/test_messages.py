import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays
from mcap.reader import make_reader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from selfmodel.arrays import FloatArray
from selfmodel.logs import SchemaMismatchError, read_log
from selfmodel.logs.log_file import read_contents
from selfmodel.logs.messages import (
    DEFINITIONS,
    description,
    imu,
    names_in,
    schema_text,
    topics,
    transforms,
)
from selfmodel.logs.records import TRIAL, TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import Names, Signal
from tests.logs.conftest import MJCF, plan_of
from tests.logs.edits import rewritten, says

OURS = "selfmodel_msgs/msg/SensorReadings"

NAME = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
SOME = st.lists(NAME, min_size=1, max_size=5).map(tuple)


@pytest.fixture(scope="module")
def store() -> Typestore:
    """Rosbags' types: the authority on what a message looks like."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(
        get_types_from_msg("std_msgs/Header header\nstring[] name\nfloat64[] value", OURS)
    )
    return store


def numbers(value: object) -> Iterator[float]:
    """All float64 values of a message in order; of a covariance the first one."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, list | np.ndarray):
        for item in value:
            yield from numbers(item)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            own = getattr(value, field.name)
            yield from numbers(own[:1] if field.name.endswith("covariance") else own)


@settings(max_examples=8, deadline=None)
@given(data=st.data(), names=st.builds(Names, SOME, SOME, SOME), frames=SOME)
def test_messages_are_rosbags_messages_to_the_byte(
    store: Typestore, data: st.DataObject, names: Names, frames: tuple[str, ...]
):
    every = *topics(names, frames[0], timed=True), imu(frames[0]), transforms(frames, frames[::-1])
    for topic in every:
        values = data.draw(arrays(np.float64, (3, sum(topic.parts.values()))))
        stamps = data.draw(st.lists(st.integers(0, 2**31 * 10**9 - 1), min_size=3, max_size=3))
        payloads = topic.template.encode(np.array(stamps), values)
        for payload, row, stamp in zip(payloads, values, stamps, strict=True):
            message = store.deserialize_cdr(payload, topic.type)
            assert bytes(store.serialize_cdr(message, topic.type)) == payload, topic.name
            assert np.array(list(numbers(message))).tobytes() == row.tobytes()
            header = getattr(message, "header", None) or message.transforms[0].header
            assert header.stamp.sec * 10**9 + header.stamp.nanosec == stamp
            if topic.name == "/tf":
                assert [t.child_frame_id for t in message.transforms] == list(frames)
                assert [t.header.frame_id for t in message.transforms] == list(frames[::-1])
            elif topic.name == "/odom":
                assert (header.frame_id, message.child_frame_id) == ("world", frames[0])
            elif topic.name == "/imu":
                assert header.frame_id == frames[0]
            elif hasattr(message, "name"):
                assert names_in(payload) == tuple(message.name)
        read_stamps, read_values = topic.template.decode(payloads)
        assert read_stamps.tolist() == stamps
        assert read_values.tobytes() == values.tobytes()


@given(text=NAME)
def test_the_description_is_rosbags_string_to_the_byte(store: Typestore, text: str):
    made = store.types["std_msgs/msg/String"](text)
    assert description(text) == bytes(store.serialize_cdr(made, "std_msgs/msg/String"))


@pytest.mark.parametrize("name", [kind.replace("/", "/msg/") for kind in DEFINITIONS])
def test_schemas_are_rosbags_schemas(store: Typestore, name: str):
    assert schema_text(name) == store.generate_msgdef(name, ros_version=2)[0]


@pytest.mark.parametrize("where", ["name", "frame", "length", "covariance"])
def test_a_message_of_another_layout_is_not_decoded(where: str):
    names = Names(("touch",), ("motor",), ("hinge",))
    topic = topics(names, "torso")[3 if where == "covariance" else 0]
    values = np.ones((4, sum(topic.parts.values())))
    payloads = topic.template.encode(np.arange(4), values)
    third = bytearray(payloads[2])
    if where == "length":
        third += b"\0"
    else:
        third[{"name": 24, "frame": 12, "covariance": 160}[where]] ^= 1
    payloads[2] = bytes(third)
    with pytest.raises(ValueError, match="message 2 has"):
        topic.template.decode(payloads)


@pytest.mark.parametrize("lost", ["base_position", "base_orientation", "base_linear_velocity"])
def test_viewers_are_told_where_each_body_is_and_how_the_base_moves_as_far_as_observed(
    store: Typestore, biped: Robot, tmp_path: Path, lost: Signal
):
    plan, from_step = plan_of(biped, 80), 30
    samples = list(SimulatedRobot(biped).run(plan.controller, 80))
    for sample in samples[from_step:]:
        sample.values[lost][-1] = np.nan
    path = write_trial(tmp_path / "b.mcap", biped, plan, samples, TrialHeader(Settings()))
    topics_read, data = read_contents(path).topics, mujoco.MjData(biped.model)
    for step in (5, 25, 30, 75):
        values, whole = samples[step].values, step < from_step
        has_pose = whole or lost == "base_linear_velocity"
        odom = store.deserialize_cdr(topics_read["/odom"].payloads[step], "nav_msgs/msg/Odometry")
        marks = [part.covariance[0] for part in (odom.pose, odom.twist)]
        # Without an orientation, there is no velocity in the base's frame.
        has_twist = whole or lost == "base_position"
        assert marks == [0.0 if has_pose else -1.0, 0.0 if has_twist else -1.0]
        if has_pose:
            data.qpos[:7] = [*values["base_position"], *values["base_orientation"]]
        if whole:
            linear, back = odom.twist.twist.linear, np.zeros(3)
            told = np.array([linear.x, linear.y, linear.z])
            mujoco.mju_rotVecQuat(back, told, values["base_orientation"])
            np.testing.assert_allclose(back, values["base_linear_velocity"], atol=2e-6)
        data.qpos[7:] = values["joint_positions"]
        mujoco.mj_kinematics(biped.model, data)
        frames = store.deserialize_cdr(
            topics_read["/tf"].payloads[step // 5], "tf2_msgs/msg/TFMessage"
        )
        torso = data.body("torso")
        # Without its pose, the base has no transform, and the frames begin with it.
        where = {"torso": (torso.xpos, torso.xquat)}
        if has_pose:
            where = {"world": (np.zeros(3), np.array([1.0, 0, 0, 0]))}
        for frame in frames.transforms:
            moved = composed(where[frame.header.frame_id], frame.transform)
            where[frame.child_frame_id] = moved
        where.pop("world", None)
        assert set(where) == {"torso", "left_leg", "left_foot", "right_leg", "right_foot"}
        for name, (place, turn) in where.items():
            np.testing.assert_allclose(place, data.body(name).xpos, atol=5e-6)
            np.testing.assert_allclose(turn, data.body(name).xquat, atol=5e-6)


def test_a_player_keeps_the_description_for_who_comes_later(log: Path):
    with log.open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    (told,) = [one.metadata for one in channels if one.topic == "/robot_description"]
    (offered,) = parse_qos(told["offered_qos_profiles"])
    assert (offered.durability, offered.depth) == (QosDurability.TRANSIENT_LOCAL, 1)
    assert (offered.reliability, offered.history) == (QosReliability.RELIABLE, QosHistory.KEEP_LAST)


def test_a_command_has_the_name_of_the_joint_that_its_motor_alone_drives(tmp_path: Path):
    mjcf = MJCF.replace('position name="left_hip_x"', 'position name="m1"')
    both = mjcf.replace(
        "</actuator>", '<motor name="m2" joint="right_hip_x" ctrlrange="-1 1"/></actuator>'
    )
    robot = Robot("biped", both, 0.01)
    plan = plan_of(robot, 20)
    samples = SimulatedRobot(robot).run(plan.controller, 20)
    path = write_trial(tmp_path / "b.mcap", robot, plan, samples, TrialHeader(Settings()))
    told = names_in(read_contents(path).topics["/joint_commands"].payloads[0])
    assert told == ("left_hip_x", "left_hip_y", "right_hip_x", "right_hip_y", "m2")
    motors = ("m1", *told[1:])
    assert read_log(path).trial.trajectory.names.motors == motors
    rewritten(path, says(TRIAL, motors='["m1"]'))
    with pytest.raises(SchemaMismatchError, match="1 motors, its commands are of 5"):
        read_log(path)


def composed(
    parent: tuple[FloatArray, FloatArray],
    transform: Any,  # noqa: ANN401  # rosbags makes its class
) -> tuple[FloatArray, FloatArray]:
    """Where a frame is whose pose is told in its parent's, as a viewer computes it."""
    place, turn = transform.translation, transform.rotation
    moved, turned = np.zeros(3), np.zeros(4)
    mujoco.mju_rotVecQuat(moved, np.array([place.x, place.y, place.z]), parent[1])
    mujoco.mju_mulQuat(turned, parent[1], np.array([turn.w, turn.x, turn.y, turn.z]))
    return parent[0] + moved, turned
