"""What a simulated physical robot is like beside its fault, drawn from the command's seed."""

import json
from dataclasses import dataclass

from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.physical.reality_gap import RealityGap, draw_gap
from selfmodel.physical.simulated_robot import SimulatedRobot
from selfmodel.physical.structural_mismatch import StructuralMismatch, draw_structural_mismatch
from selfmodel.recovery.random_streams import gap_stream, structure_stream
from selfmodel.robot.robot import Robot


@dataclass(frozen=True)
class Reality:
    """How a physical robot differs from its model, whatever fails.

    Attributes:
        gap: What is drawn at a level; at level 0, nothing differs.
        structure: Mismatches of structure, if there are any.
    """

    gap: RealityGap
    structure: StructuralMismatch | None

    @property
    def text(self) -> str | None:
        """What a log hides of it, as JSON; None where the robot is as its model."""
        if self.gap.level == 0 and self.structure is None:
            return None
        structure = None if self.structure is None else self.structure.as_dict()
        return json.dumps({**self.gap.as_dict(), "structure": structure}, allow_nan=False)

    def robot(self, robot: Robot, hidden: Hypothesis = INTACT, stream: int = 0) -> SimulatedRobot:
        """Returns the physical robot; see ``SimulatedRobot``."""
        return SimulatedRobot(robot, hidden, self.gap, self.structure, stream)


def simulated_robot(
    robot: Robot,
    hypothesis: Hypothesis = INTACT,
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
        >>> robot = selfmodel.load_robot("quadruped")
        >>> damaged = selfmodel.parse_hypothesis("break:front_left_knee", robot)
        >>> physical = selfmodel.simulated_robot(robot, damaged, gap=0.05)

    Args:
        robot: The nominal robot.
        hypothesis: The faults of the physical robot.
        gap: Level of the reality gap, the relative standard deviation of its factors; 0 is none.
        structure: Whether the physical robot also differs in structure from its model.
        seed: Seed of the gap, the structure and the noise.

    Raises:
        InputError: The level is out of range.
    """
    stream = 1 if hypothesis.faults else 0
    return draw_reality(robot, seed, gap, structure=structure).robot(robot, hypothesis, stream)


def draw_reality(robot: Robot, seed: int, level: float, *, structure: bool) -> Reality:
    """Returns what a physical robot is like.

    Args:
        robot: The robot as its model describes it.
        seed: The command's; a search of the same seed draws nothing of this.
        level: The gap's.
        structure: Whether there are mismatches of structure.

    Raises:
        InputError: The level is out of range.
    """
    return Reality(
        gap=draw_gap(robot, level, gap_stream(seed)),
        structure=draw_structural_mismatch(robot, structure_stream(seed)) if structure else None,
    )
