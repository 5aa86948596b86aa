"""Tests of the settings with a value for each joint."""

from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings, value_of
from tests.robot.mjcf.awkward import mjcf


def test_one_number_is_for_all_joints_and_a_table_for_those_that_its_patterns_fit():
    settings = checked_settings({"kp": 40, "kd": {"*_knee": 2, "left_knee": 3}})

    assert value_of(settings.kp, "any") == 40.0
    assert [value_of(settings.kd, joint) for joint in ("left_knee", "right_knee", "hip")] == [
        3,
        2,
        None,
    ]


def test_they_are_beside_the_other_settings():
    settings = checked_settings({"forward": "-x", "pose": {"knee": -1}})

    assert settings.pose == {"knee": -1.0}
    assert settings.forward == "-x"


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"kp": -1}, "kp needs a number from above 0"),
        ({"kp": "stiff"}, "such as kp = 40"),
        ({"kp": 0}, "kp needs a number from above 0"),
        ({"reach": {"knee": 0}}, "reach needs a number from above 0"),
        ({"kd": {"knee": True}}, "got True for 'knee'"),
        ({"effort": float("inf")}, "effort needs a number"),
        ({"pose": 0.5}, "pose needs angles by joint"),
        ({"pose": {"knee": float("nan")}}, "pose needs a number"),
        ({"pose": {"k" * 1000: 1}}, "pose needs a number"),
        ({"kp": 10**400}, "kp needs a number"),
    ],
)
def test_other_values_are_refused_with_an_example(given: dict, sentence: str):
    with pytest.raises(InputError) as refusal:
        checked_settings(given)

    assert sentence in str(refusal.value)
    assert len(str(refusal.value)) < 1000


def test_the_effort_and_the_pose_are_refused_for_an_mjcf(tmp_path: Path):
    path = tmp_path / "robot.xml"
    path.write_text(mjcf())

    with pytest.raises(InputError, match="settings for a URDF"):
        load_mjcf(path, checked_settings({"effort": 10}))
