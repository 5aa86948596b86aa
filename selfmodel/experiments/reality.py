"""Reality gap of a simulated physical robot, drawn from a seed."""

import json
from dataclasses import dataclass

from selfmodel.experiments.arguments import RobotSource, check_seed, hypothesis_of, robot_of
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.physical.gap import draw_gap
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.random_streams import gap_stream
from selfmodel.robot.parameters import with_model
from selfmodel.robot.robot import Robot
from selfmodel.simulation.reality_gap import RealityGap, perturbed_model


@dataclass(frozen=True)
class Reality:
    """Difference between a physical robot and its model, apart from faults.

    Attributes:
        gap: The reality gap; level 0 is none.
    """

    gap: RealityGap

    @property
    def text(self) -> str | None:
        """Hidden record of a trial log, as JSON; None if the robot equals its model."""
        if self.gap.level == 0:
            return None
        return json.dumps({**self.gap.as_dict(), "structure": None}, allow_nan=False)

    def hidden_model(self, robot: Robot) -> Robot:
        """Returns a robot whose model has the factors and the delay of the gap, for an oracle."""
        model = perturbed_model(robot.model, self.gap)
        return with_model(robot, model, robot.control_delay + self.gap.delay)

    def robot(self, robot: Robot, hidden: Hypothesis = INTACT, stream: int = 0) -> SimulatedRobot:
        """Returns the physical robot with hidden faults; see ``SimulatedRobot``."""
        return SimulatedRobot(robot, hidden, self.gap, stream)


def simulated_robot(
    robot: RobotSource,
    hypothesis: Hypothesis | str = INTACT,
    *,
    gap: float = 0.0,
    seed: int = 0,
) -> SimulatedRobot:
    """Returns a physical robot in simulation, with hidden faults and a reality gap.

    Robots of the same seed and gap are one robot before and after its failure; the healthy and the
    damaged robot have different streams of measurement noise.

    Example:
        >>> import selfmodel
        >>> physical = selfmodel.simulated_robot("quadruped", "break:front_left_knee", gap=0.05)

    Args:
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        hypothesis: The faults of the physical robot, or their notation.
        gap: Level of the reality gap, the relative standard deviation of its factors; 0 is none.
        seed: Seed of the gap and of the noise.

    Raises:
        InputError: The level is out of range, the seed is negative, the robot is unknown, or the
            notation is invalid.
    """
    check_seed(seed)
    robot = robot_of(robot)
    hidden = hypothesis_of(hypothesis, robot)
    stream = 1 if hidden.faults else 0
    return draw_reality(robot, seed, gap).robot(robot, hidden, stream)


def draw_reality(robot: Robot, seed: int, level: float) -> Reality:
    """Returns the reality gap of a physical robot.

    Args:
        robot: The nominal robot.
        seed: Seed; a search with the same seed draws other numbers.
        level: Level of the reality gap.

    Raises:
        InputError: The level is out of range.
    """
    return Reality(draw_gap(robot, level, gap_stream(seed)))
