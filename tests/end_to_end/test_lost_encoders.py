"""A limb that was lost with its encoders is diagnosed."""

import dataclasses

import numpy as np
import pytest

import selfmodel
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

pytestmark = pytest.mark.search

JOINTS: tuple[Signal, ...] = ("joint_positions", "joint_velocities", "joint_efforts")
SETTINGS = selfmodel.Settings(generations=2).scaled(8)


def lost(
    robot: Robot, truth: str, hinges: tuple[str, ...], steps: slice, length: int = 500
) -> Trial:
    """A trial of a robot in which the encoders of some hinges measure nothing at some steps."""
    physical = selfmodel.simulated_robot(robot, truth, gap=0.05, seed=3)
    gait = random_controllers(robot, 1, seed=5)[0]
    plan = TrialPlan("after", "after", gait, length, seed=0)
    trial = in_memory(robot)(physical, plan)
    signals = {signal: trial.trajectory[signal].copy() for signal in SIGNALS}
    for signal in JOINTS:
        signals[signal][steps, [robot.anatomy.hinges.index(hinge) for hinge in hinges]] = np.nan
    for column, sensor in enumerate(robot.anatomy.sensors):
        if sensor.kind == "angle" and sensor.hinge in hinges:
            signals["sensors"][steps, column] = np.nan
    return dataclasses.replace(
        trial, trajectory=dataclasses.replace(trial.trajectory, signals=signals)
    )


def diagnosis(
    trial: Trial,
    robot: Robot,
    comparator: str = "segment-prediction",
    kinds: str = "paper",
) -> Diagnosis:
    return selfmodel.diagnose(
        trial,
        robot=robot,
        settings=SETTINGS,
        comparator=comparator,
        kinds=kinds,
        seed=0,
        threads=1,
    )


@pytest.mark.parametrize(
    ("truth", "hinges", "first"),
    [
        ("break:front_left_shoulder", ("front_left_shoulder", "front_left_knee"), 0),
        ("jam:back_right_shoulder", ("front_left_knee",), 200),
    ],
)
def test_a_fault_is_found_without_the_encoders_of_a_limb(
    truth: str, hinges: tuple[str, ...], first: int, quadruped: Robot
):
    trial = lost(quadruped, truth, hinges, slice(first, None))
    assert str(diagnosis(trial, quadruped).best) == truth


@pytest.mark.parametrize(
    "comparator",
    ["segment-prediction-onboard", "gait-pattern", "noisy-transfer"],
)
def test_every_comparator_of_joints_judges_a_trial_without_an_encoder(
    comparator: str, quadruped: Robot
):
    trial = lost(quadruped, "break:front_left_knee", ("front_left_knee",), slice(None), 120)
    found = diagnosis(trial, quadruped, comparator, "break")
    assert np.isfinite(found.ranked[0].distance)
    assert found.ranked[0].distance < found.intact_distance
