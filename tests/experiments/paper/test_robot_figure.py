"""Promises of Figure 1: every joint and sensor of the robot is drawn, and its true outline."""

import numpy as np
import pytest

from selfmodel.experiments.paper.robot_figure import of_robots
from selfmodel.robot.robot import Robot


def test_both_views_have_every_joint_sensor_and_limb(robot: Robot):
    anatomy = robot.anatomy
    kinds = [sensor.kind for sensor in anatomy.sensors]

    for axes in of_robots([robot]).axes:
        counts = {line.get_label(): len(line.get_xdata()) for line in axes.get_lines()}
        assert counts == {
            "joint": len(anatomy.joints),
            "angle sensor": kinds.count("angle"),
            "touch sensor": kinds.count("touch"),
        }
        assert len(axes.patches) == np.count_nonzero(robot.model.geom_bodyid > 0)


def test_the_robot_is_drawn_to_scale_on_the_ground(quadruped: Robot):
    side, above = of_robots([quadruped]).axes
    outlines = np.concatenate([patch.get_xy() for patch in side.patches])
    width = np.concatenate([patch.get_xy() for patch in above.patches])[:, 1]

    # The torso is 0.8 m long; the legs are capsules 0.25 m to the left and right, 0.04 m thick.
    assert np.ptp(outlines[:, 0]) == pytest.approx(0.8, abs=0.01)
    assert outlines[:, 1].min() == pytest.approx(0.0, abs=0.02)
    assert np.ptp(width) == pytest.approx(2 * (0.25 + 0.04), abs=0.005)
