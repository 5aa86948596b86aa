"""Tests of the position servos of a robot from a URDF."""

import math

import pytest

from selfmodel.errors import InputError
from tests.robot.urdf.samples import converted, elements, joint, link, urdf


def servo(
    kind: str = "revolute", *, settings: dict | None = None, **limits: float
) -> dict[str, float]:
    text = urdf(link("a"), link("b"), joint("knee", "a", "b", kind=kind, **limits))
    found = elements(converted(text, base="fixed", **(settings or {})), "actuator/position")["knee"]
    low, high = map(float, found.get("ctrlrange", "").split())
    assert (
        found.get("forcerange")
        == f"{-float(found.get('forcerange').split()[1])!r} " + (found.get("forcerange").split()[1])
    )
    return {
        "kp": float(found.get("kp", "")),
        "kd": float(found.get("kv", "")),
        "effort": float(found.get("forcerange", "").split()[1]),
        "low": low,
        "high": high,
    }


def test_it_has_the_limits_of_the_joint_and_full_effort_at_half_a_radian():
    found = servo(low=-1.5, high=0.75, effort=20, velocity=10)

    assert found == {"kp": 40, "kd": 2, "effort": 20, "low": -1.5, "high": 0.75}


def test_a_narrow_joint_has_full_effort_at_half_its_range():
    assert servo(low=-0.1, high=0.3, effort=20)["kp"] == pytest.approx(100)


@pytest.mark.parametrize(("velocity", "time"), [(1e6, 0.02), (0.1, 0.1), (0, 0.1)])
def test_its_damping_stays_in_bounds_if_the_velocity_limit_is_absurd(velocity: float, time: float):
    found = servo(velocity=velocity)

    assert found["kd"] == pytest.approx(time * found["kp"])


def test_a_continuous_joint_has_commands_of_a_full_turn():
    found = servo("continuous")

    assert (found["low"], found["high"]) == (-math.pi, math.pi)


def test_settings_override_gains_and_effort():
    found = servo(settings={"kp": 5, "kd": {"kn*": 0.5}, "effort": 3})

    assert (found["kp"], found["kd"], found["effort"]) == (5, 0.5, 3)


def test_with_a_swing_commands_are_near_the_initial_pose_and_within_the_range():
    found = servo(low=-1, high=1, settings={"swing": 0.4, "pose": {"knee": 0.75}})

    assert (found["low"], found["high"]) == (0.35, 1)


def test_a_joint_without_an_effort_limit_is_refused_unless_the_settings_have_one():
    with pytest.raises(InputError, match=r"'knee' has no effort limit above 0.*effort = "):
        servo(effort=0)

    assert servo(effort=0, settings={"effort": {"knee": 7}})["effort"] == 7


def test_a_setting_that_fits_no_joint_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="knee"):
        servo(settings={"kp": {"kneee": 4}})
