"""Calibration of a robot with a fixed base: gain, damping, dry friction and armature of its joints.

A fixed base determines neither the mass of the root nor the friction of the ground. The masses of
the limbs are not fitted: only ratios are identifiable, and the gains include them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmodel.robot.joint_parameters import (
    QUANTITIES,
    JointParameters,
    changed,
    joint_parameters,
    model_with_joint_parameters,
    names_of,
)
from selfmodel.robot.parameters import with_model
from selfmodel.robot.robot import Robot
from selfmodel.simulation.joints.fit import Experiment, JointFit, simulated_models
from selfmodel.simulation.joints.segments import JointSegments
from selfmodel.simulation.joints.sets import NOMINAL, PRIOR_DEVIATIONS

UNDETERMINED_SHARE = 0.7
"""Deviation of a parameter, relative to that of its prior, from which on the trials count as not
having determined it."""


@dataclass(frozen=True, eq=False)
class JointCalibration:
    """Result of the calibration of the joints of a robot with a fixed base.

    Attributes:
        robot: The robot with the fitted parameters in its MJCF; the robot itself if no set of
            parameters was significantly better.
        before: The parameters of the robot's own model.
        parameters: The fitted parameters.
        sets: Fits of the nominal set and of each chosen set; the last one is the result.
    """

    robot: Robot
    before: JointParameters
    parameters: JointParameters
    sets: tuple[JointFit, ...]

    @property
    def nominal(self) -> JointFit:
        """The nominal set."""
        return self.sets[0]

    @property
    def best(self) -> JointFit:
        """The chosen set."""
        return self.sets[-1]

    @property
    def worst_joint(self) -> tuple[str, float]:
        """Name of the joint with the largest error after the fit, and the error, rad."""
        worst = int(np.argmax(self.best.joint_errors))
        return self.robot.anatomy.hinges[worst], float(self.best.joint_errors[worst])

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yields name, quantity, values, deviation and whether the trials determine each value."""
        for quantity in QUANTITIES:
            columns = (
                names_of(self.robot, quantity),
                self.before.values[quantity],
                self.parameters.values[quantity],
                self.best.deviations[quantity],
            )
            for name, before, value, deviation in zip(*columns, strict=True):
                limit = UNDETERMINED_SHARE * PRIOR_DEVIATIONS[quantity]
                yield {
                    "name": name,
                    "quantity": quantity,
                    "before": float(before),
                    "value": float(value),
                    "deviation": float(deviation),
                    "determined": self.best.name != NOMINAL and bool(deviation < limit),
                }

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values."""
        joint, error = self.worst_joint
        return {
            "set": self.best.name,
            "delay": self.best.delay,
            "error_before": self.nominal.error,
            "error": self.best.error,
            "held_out_error_before": self.nominal.held_out_error,
            "held_out_error": self.best.held_out_error,
            "worst_joint": joint,
            "worst_joint_error": error,
            "parameters": list(self.rows()),
        }


def calibrated_joints(
    robot: Robot, data: Sequence[JointSegments], threads: int
) -> JointCalibration:
    """Fits the joints of a robot with a fixed base.

    The result does not depend on the number of threads. The robot is returned unchanged, to the
    bit, if no set of parameters predicts segments that were left out of its fit significantly
    better than the model as it is.

    Args:
        robot: The robot as its model describes it.
        data: Segments of at least one trial of the healthy robot.
        threads: Threads of MuJoCo's steps.

    Raises:
        InputError: Every simulation of the nominal model diverged.
    """
    sets = tuple(Experiment(robot, data, threads).chosen_sets())
    best = sets[-1]
    parameters = changed(robot, best.logarithms)
    fitted = robot
    if best.name != NOMINAL:
        fitted = with_model(robot, model_with_joint_parameters(robot, parameters), best.delay)
    return JointCalibration(fitted, joint_parameters(robot), parameters, sets)


def nominal_error(robot: Robot, data: Sequence[JointSegments], threads: int) -> float:
    """Returns the root mean square error of a robot's own model, in its signals' scales.

    Args:
        robot: The robot as its model describes it.
        data: Segments of at least one trial.
        threads: Threads of MuJoCo's steps.
    """
    errors = Experiment(robot, data, threads).nominal_errors()
    return float(np.sqrt(np.mean(errors**2)))


def simulated_joint_steps(robot: Robot, data: Sequence[JointSegments]) -> int:
    """Returns the number of control steps that ``calibrated_joints`` simulates at most.

    Args:
        robot: The robot as its model describes it.
        data: Segments of at least one trial.
    """
    return simulated_models(robot) * sum(own.judged.size for own in data)
