"""What a finding says about each part, as a ``DiagnosticArray`` of ROS 2 has it."""

import re
from typing import get_args

import pytest

import selfmodel
from selfmodel.robot.robot import Robot
from selfmodel.watching import Finding, Level, PartStatus, Rated, part_statuses
from selfmodel.watching.finding import Status
from tests.conftest import ROBOTS

JAM = "jam:front_left_knee=0.3"


@pytest.fixture(scope="module")
def hexapod() -> Robot:
    return ROBOTS["hexapod"].robot()


def finding(robot: Robot, status: Status, *hypotheses: str, shown_by: tuple[str, ...] = ()):
    remaining = tuple(Rated(selfmodel.parse_hypothesis(one, robot), 0.25) for one in hypotheses)
    times = {"onset": 1.5, "earliest": 1.25, "latest": 2.0} if shown_by or remaining else {}
    return Finding(3.0, status, "why", **times, shown_by=shown_by, remaining=remaining)


def by_name(robot: Robot, told: Finding) -> dict[str, PartStatus]:
    return {one.name.removeprefix("selfmodel: "): one for one in part_statuses(robot, told)}


def at_fault(robot: Robot, told: Finding, level: Level) -> set[str]:
    """The parts, without the robot as a whole, with a level."""
    return {name for name, one in by_name(robot, told).items() if one.level == level} - {robot.name}


@pytest.mark.parametrize("status", get_args(Status))
def test_every_status_has_a_state_of_the_robot_and_of_each_hinge_and_sensor(
    quadruped: Robot, status: Status
):
    told = part_statuses(quadruped, finding(quadruped, status))
    names = quadruped.anatomy.names

    expected = ["quadruped", *names.hinges, *names.sensors]
    assert [one.name for one in told] == [f"selfmodel: {name}" for name in expected]
    assert {one.hardware_id for one in told} == {"quadruped"}
    assert told[0].message.startswith(status)
    assert {one.level for one in told[1:]} == {Level.STALE if status == "stale" else Level.OK}


@pytest.mark.parametrize(
    ("status", "level", "of_part"),
    [
        ("changed", Level.WARN, Level.WARN),
        ("ambiguous", Level.ERROR, Level.WARN),
        ("unexplained", Level.ERROR, Level.WARN),
    ],
)
def test_a_part_that_shows_a_change_is_a_warning_until_its_fault_is_known(
    quadruped: Robot, status: Status, level: Level, of_part: Level
):
    told = finding(quadruped, status, shown_by=("front_left_knee", "base_position"))
    states = by_name(quadruped, told)

    assert states["quadruped"].level == level
    assert at_fault(quadruped, told, of_part) == {"front_left_knee"}
    assert states["front_left_knee"].values == {"onset": "1.5", "earliest": "1.25", "latest": "2.0"}
    assert states["back_left_knee"].values == {}


def test_causes_that_are_left_are_said_of_their_parts_and_of_none_if_no_fault_explains(
    quadruped: Robot,
):
    causes = (JAM, "friction=0.4", "sensor:back_left_touch", "motor:front_left_knee=0.5")
    several = finding(quadruped, "ambiguous", *causes)
    none = finding(quadruped, "unexplained", *causes)
    knee = by_name(quadruped, several)["front_left_knee"]

    assert at_fault(quadruped, several, Level.WARN) == {"front_left_knee", "back_left_touch"}
    assert knee.message == "perhaps the joint front_left_knee is stuck at 0.30 rad"
    assert (knee.values["hypothesis"], knee.values["loss"]) == (JAM, "0.25")
    assert "fault_code" not in knee.values
    assert at_fault(quadruped, none, Level.OK) == set(by_name(quadruped, none)) - {"quadruped"}


@pytest.mark.parametrize(
    ("cause", "parts", "code"),
    [
        ("jam:front_left_hip", {"front_left_hip_swing", "front_left_hip_lift"}, "front_left_hip"),
        ("sensor:back_left_touch", {"back_left_touch"}, "back_left_touch"),
        ("friction=0.4", set(), ""),
        ("payload:front=0.2", set(), "front"),
        (
            "leg:back_right=locked",
            {f"back_right_{one}" for one in ("hip_swing", "hip_lift", "knee")},
            "back_right",
        ),
    ],
)
def test_a_cause_is_an_error_of_the_hinges_or_the_sensor_that_it_is_about(
    hexapod: Robot, cause: str, parts: set[str], code: str
):
    told = finding(hexapod, "explained", cause, shown_by=("middle_left_knee",))
    kind = re.split("[:=]", cause)[0]

    assert at_fault(hexapod, told, Level.ERROR) == parts
    assert at_fault(hexapod, told, Level.WARN) == set()
    for name in (hexapod.name, *parts):
        state = by_name(hexapod, told)[name]
        assert state.level == Level.ERROR
        assert state.values["fault_code"] == f"{kind}_{code}".strip("_").upper()


@pytest.mark.parametrize(
    ("one", "other"),
    [("jam:front_left_knee", JAM), ("motor:back_left_knee=0.5", "motor:back_left_knee=0.8")],
)
def test_a_fault_code_is_the_same_at_every_severity(quadruped: Robot, one: str, other: str):
    codes = {
        by_name(quadruped, finding(quadruped, "explained", cause))["quadruped"].values["fault_code"]
        for cause in (one, other)
    }

    assert len(codes) == 1
    assert re.fullmatch("[A-Z0-9_]+", codes.pop())
