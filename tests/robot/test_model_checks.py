"""Models with numbers that no robot has."""

from dataclasses import replace

import pytest

from selfmodel.robot.robot import Robot


@pytest.mark.parametrize("text", ["nan", "inf", "1e300", "-2e10"])
@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("<option ", '<option gravity="0 0 {}" ', "option gravity"),
        ("<option ", '<option wind="{} 0 0" ', "option wind"),
        ("<freejoint", '<inertial pos="0 0 {}" mass="1" diaginertia="1 1 1"/><freejoint', "body"),
    ],
)
def test_a_number_that_is_not_finite_or_absurd_is_refused_by_name(
    quadruped: Robot, old: str, new: str, name: str, text: str
):
    with pytest.raises(ValueError, match=f"expected finite numbers .* in the model's {name}"):
        replace(quadruped, mjcf=quadruped.mjcf.replace(old, new.format(text), 1))


def test_an_absurd_gain_is_refused(quadruped: Robot):
    with pytest.raises(ValueError, match=r"in the model's actuator gainprm, got 1e\+300"):
        replace(quadruped, mjcf=quadruped.mjcf.replace('kp="60"', 'kp="1e300"'))
