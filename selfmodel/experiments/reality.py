"""Reality gap and structural mismatch of a simulated physical robot, drawn from a seed."""

import json
from dataclasses import dataclass

from selfmodel.experiments.arguments import RobotSource, check_seed, hypothesis_of, robot_of
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.physical.reality_gap import RealityGap, draw_gap, perturbed_model
from selfmodel.physical.simulated_robot import SimulatedRobot
from selfmodel.physical.structural_mismatch import StructuralMismatch, draw_structural_mismatch
from selfmodel.recovery.random_streams import gap_stream, structure_stream
from selfmodel.robot.parameters import with_model
from selfmodel.robot.robot import Robot


@dataclass(frozen=True)
class Reality:
    """Difference between a physical robot and its model, apart from faults.

    Attributes:
        gap: The reality gap; level 0 is none.
        structure: Structural mismatches; None without any.
    """

    gap: RealityGap
    structure: StructuralMismatch | None

    @property
    def text(self) -> str | None:
        """Hidden record of a trial log, as JSON; None if the robot equals its model."""
        if self.gap.level == 0 and self.structure is None:
            return None
        structure = None if self.structure is None else self.structure.as_dict()
        return json.dumps({**self.gap.as_dict(), "structure": structure}, allow_nan=False)

    def hidden_model(self, robot: Robot) -> Robot:
        """Returns a robot whose model has the factors and the delay of the gap, for an oracle."""
        model = perturbed_model(robot.model, self.gap)
        return with_model(robot, model, robot.control_delay + self.gap.delay)

    def robot(self, robot: Robot, hidden: Hypothesis = INTACT, stream: int = 0) -> SimulatedRobot:
        """Returns the physical robot with hidden faults; see ``SimulatedRobot``."""
        return SimulatedRobot(robot, hidden, self.gap, self.structure, stream)


def simulated_robot(
    robot: RobotSource,
    hypothesis: Hypothesis | str = INTACT,
    *,
    gap: float = 0.0,
    structure: bool = False,
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
        structure: Whether the physical robot also differs in structure from its model.
        seed: Seed of the gap, the structure and the noise.

    Raises:
        InputError: The level is out of range, the seed is negative, the robot is unknown, or the
            notation is invalid.
    """
    check_seed(seed)
    robot = robot_of(robot)
    hidden = hypothesis_of(hypothesis, robot)
    stream = 1 if hidden.faults else 0
    return draw_reality(robot, seed, gap, structure=structure).robot(robot, hidden, stream)


def draw_reality(robot: Robot, seed: int, level: float, *, structure: bool) -> Reality:
    """Returns the reality gap and the structural mismatch of a physical robot.

    Args:
        robot: The nominal robot.
        seed: Seed; a search with the same seed draws other numbers.
        level: Level of the reality gap.
        structure: Whether structural mismatches are drawn.

    Raises:
        InputError: The level is out of range.
    """
    return Reality(
        gap=draw_gap(robot, level, gap_stream(seed)),
        structure=draw_structural_mismatch(robot, structure_stream(seed)) if structure else None,
    )
