"""Recordings of the A1 in PyBullet: the robot of its URDF, with the faults that are stated."""

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="PyBullet is in the dependency group other-engine")

from benchmarks.foreign.cases import Fault, Faults
from benchmarks.foreign.motion import Motion
from benchmarks.other_engine.recordings import Reality, a1, simulated

ROBOT = a1()
CALF = "FR_lower_joint"
HINGE = ROBOT.hinges.index(CALF)


def standing(*faults: Fault) -> Motion:
    stance = np.tile([0.0, 0.9, -1.8], 4)
    reality = Reality(masses={}, torques=np.ones(12), friction=0.8, delay=5)
    return simulated(ROBOT, reality, faults, lambda *_: stance, 0.1)


def test_the_healthy_robot_stands_near_its_stance():
    motion = standing()
    assert motion.is_upright()
    np.testing.assert_allclose(motion.angles[-1], np.tile([0.0, 0.9, -1.8], 4), atol=0.1)


@pytest.mark.parametrize(
    ("fault", "angle"),
    [(Fault("jam", CALF, -1.5), -1.5), (Fault("lost", CALF), np.nan)],
    ids=["locked", "lost"],
)
def test_a_locked_joint_has_its_angle_and_a_lost_one_none(fault: Fault, angle: float):
    np.testing.assert_array_equal(standing(fault).angles[:, HINGE], angle)


def test_a_weak_motor_yields_to_the_load():
    weak: Faults = (Fault("motor", CALF, 0.4),)
    assert standing(*weak).angles[-1, HINGE] < standing().angles[-1, HINGE] - 0.02
