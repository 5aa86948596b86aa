"""Nested sets of parameters of joints, and the coordinates in which they are fitted."""

from dataclasses import dataclass

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.joint_parameters import QUANTITIES, joint_of_motor, kinds_of_joints
from selfmodel.robot.robot import Robot

NOMINAL = "nominal"
SETS = (NOMINAL, "shared", "kinds", "joints")
"""Names of the nested sets of parameters: none, one per quantity, one per quantity and kind of
joint, one per quantity and joint."""

PRIOR_DEVIATIONS = {"gain": 0.3, "damping": 0.5, "dry friction": 1.0, "armature": 1.0}
"""Standard deviation of the prior on the logarithm of each quantity's factor. Data sheets state
gains; models often contain guesses of friction and armature."""

MAX_LOG_FACTORS = {"gain": 1.2, "damping": 3.0, "dry friction": 3.0, "armature": 3.0}
"""Bound on the absolute logarithm of each quantity's factor."""


@dataclass(frozen=True, eq=False)
class Point:
    """A model of the robot: logarithms of the factors by quantity, and the control delay."""

    logarithms: dict[str, FloatArray]
    delay: float


@dataclass(frozen=True, eq=False)
class Basis:
    """Coordinates of a set of parameters: each is shared by a group of motors or hinges.

    Attributes:
        groups: For each quantity the coordinate of each motor or hinge.
        hinges: For each coordinate the hinges that it applies to.
        deviations: Standard deviation of the prior of each coordinate, ``(coordinates,)``.
        bounds: Bound on the absolute value of each coordinate, ``(coordinates,)``.
    """

    groups: dict[str, IndexArray]
    hinges: tuple[IndexArray, ...]
    deviations: FloatArray
    bounds: FloatArray

    @classmethod
    def of(cls, robot: Robot, name: str) -> "Basis":
        """Returns the coordinates of a set of ``SETS`` other than the nominal one."""
        hinges = len(robot.anatomy.hinges)
        hinge_groups = np.zeros(hinges, dtype=np.intp)
        if name == "kinds":
            hinge_groups = kinds_of_joints(robot)
        elif name == "joints":
            hinge_groups = np.arange(hinges)
        groups, applies_to, deviations, bounds, first = {}, [], [], [], 0
        for quantity in QUANTITIES:
            joints = joint_of_motor(robot) if quantity == "gain" else np.arange(hinges)
            _, own = np.unique(hinge_groups[joints], return_inverse=True)
            groups[quantity] = first + own
            size = int(own.max(initial=-1)) + 1
            applies_to += [joints[own == number] for number in range(size)]
            deviations += [PRIOR_DEVIATIONS[quantity]] * size
            bounds += [MAX_LOG_FACTORS[quantity]] * size
            first += size
        return cls(groups, tuple(applies_to), np.array(deviations), np.array(bounds))

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.deviations)

    def limbs_of(self, coordinate: int, limbs: IndexArray) -> IndexArray:
        """Returns the limbs whose hinges a coordinate applies to."""
        return np.unique(limbs[self.hinges[coordinate]])

    def independent(self, limbs: IndexArray) -> list[list[int]]:
        """Returns batches of coordinates of which no two apply to the same limb."""
        batches: list[tuple[set[int], list[int]]] = []
        for coordinate in range(self.size):
            own = set(self.limbs_of(coordinate, limbs).tolist())
            free = next((batch for taken, batch in batches if not taken & own), None)
            if free is None:
                batches.append((own, [coordinate]))
            else:
                next(taken for taken, batch in batches if batch is free).update(own)
                free.append(coordinate)
        return [batch for _, batch in batches]

    def spread(self, coordinates: FloatArray) -> dict[str, FloatArray]:
        """Returns the value of each motor or hinge."""
        return {quantity: coordinates[groups] for quantity, groups in self.groups.items()}

    def point(self, coordinates: FloatArray, delay: float) -> Point:
        """Returns the model at some coordinates."""
        return Point(self.spread(coordinates), delay)

    def coordinates(self, point: Point) -> FloatArray:
        """Returns the mean logarithm of each group."""
        sums, counts = np.zeros(self.size), np.zeros(self.size)
        for quantity, groups in self.groups.items():
            np.add.at(sums, groups, point.logarithms[quantity])
            np.add.at(counts, groups, 1.0)
        return np.asarray(sums / counts)
