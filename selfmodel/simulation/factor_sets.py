"""Nested sets of factors: what each shares, its prior and its bounds."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import (
    JOINT_QUANTITIES,
    SHARED,
    Parameters,
    joint_of_motor,
    kinds_of_joints,
)

FACTORS = "factors"
"""Name of the set of factors of a robot with a floating base."""

JOINT_SETS = ("shared", "kinds", "joints")
"""Names of the nested sets of factors of a robot with a fixed base: one per quantity, one per
quantity and kind of joint, one per quantity and joint."""

PRIOR_DEVIATIONS = {"root_mass": 0.15, "limb_mass": 0.15, "motor_gains": 0.15}
PRIOR_DEVIATIONS |= {"friction": 0.3, "damping": 0.3}
"""Standard deviation of the prior on the logarithm of a factor. That of friction and of damping is
larger: models often contain guesses of them."""

JOINT_PRIOR_DEVIATIONS = {"motor_gains": 0.3, "joint_damping": 0.5}
JOINT_PRIOR_DEVIATIONS |= {"dry_friction": 1.0, "armature": 1.0}
"""As ``PRIOR_DEVIATIONS``, of a robot with a fixed base. Data sheets state gains; models often
contain guesses of friction and armature. The gains include the unknown masses."""

MAX_LOG_FACTOR, MAX_JOINT_LOG_FACTOR = 1.2, 3.0
"""Bound on the absolute logarithm of a factor, 0.3 to 3.3; and of damping, dry friction and
armature of a joint, 0.05 to 20."""


def prior_deviations(robot: Robot) -> dict[str, FloatArray]:
    """Returns the standard deviation of the prior of each factor's logarithm, by quantity."""
    sizes = {"motor_gains": robot.model.nu}
    sizes |= dict.fromkeys(JOINT_QUANTITIES, len(robot.anatomy.hinges))
    own = PRIOR_DEVIATIONS | (JOINT_PRIOR_DEVIATIONS if robot.has_fixed_base else {})
    return {name: np.full(sizes.get(name, 1), deviation) for name, deviation in own.items()}


@dataclass(frozen=True, eq=False)
class Basis:
    """Coordinates of a set of factors: each is shared by a group of motors or hinges.

    Attributes:
        groups: For each quantity the coordinate of each of its factors.
        prior: Standard deviation of the prior of each coordinate, ``(coordinates,)``.
        bounds: Bound on the absolute value of each coordinate, ``(coordinates,)``.
    """

    groups: dict[str, IndexArray]
    prior: FloatArray
    bounds: FloatArray

    def by_quantity(self, coordinates: FloatArray) -> dict[str, FloatArray]:
        """Returns the value of each factor by quantity, given that of each coordinate."""
        return {quantity: coordinates[groups] for quantity, groups in self.groups.items()}

    def applied(self, start: Parameters, logarithms: FloatArray) -> Parameters:
        """Returns parameters with the factors of some logarithms; all else is the start's."""
        factors: dict[str, Any] = {
            quantity: tuple(values.tolist()) if quantity not in SHARED else float(values[0])
            for quantity, values in self.by_quantity(np.exp(logarithms)).items()
        }
        return replace(start, **factors)

    def coordinates(self, parameters: Parameters) -> FloatArray:
        """Returns the mean logarithm of each group, ``(coordinates,)``."""
        sums, counts = np.zeros((2, len(self.prior)))
        for quantity, groups in self.groups.items():
            factors = getattr(parameters, quantity) or (1.0,) * len(groups)
            np.add.at(sums, groups, np.log(factors))
            np.add.at(counts, groups, 1.0)
        return np.asarray(sums / counts)


def bases(robot: Robot) -> Iterator[tuple[str, Basis]]:
    """Yields the name and the coordinates of each set of factors of a robot."""
    prior = prior_deviations(robot)
    if not robot.has_fixed_base:
        quantities = (*SHARED, "motor_gains")
        deviations = np.concatenate([prior[quantity] for quantity in quantities])
        ends = np.cumsum([len(prior[quantity]) for quantity in quantities])
        groups = np.split(np.arange(len(deviations)), ends[:-1])
        names = dict(zip(quantities, groups, strict=True))
        yield FACTORS, Basis(names, deviations, np.full(len(deviations), MAX_LOG_FACTOR))
        return
    hinges, last = np.arange(len(robot.anatomy.hinges)), 0
    for name, kinds in zip(
        JOINT_SETS, (np.zeros_like(hinges), kinds_of_joints(robot), hinges), strict=True
    ):
        names, deviations, bounds = {}, np.empty(0), np.empty(0)
        for quantity in JOINT_PRIOR_DEVIATIONS:
            joints = joint_of_motor(robot) if quantity == "motor_gains" else hinges
            _, own = np.unique(kinds[joints], return_inverse=True)
            names[quantity] = len(deviations) + own
            size = int(own.max(initial=-1)) + 1
            bound = MAX_LOG_FACTOR if quantity == "motor_gains" else MAX_JOINT_LOG_FACTOR
            deviations = np.append(deviations, np.full(size, JOINT_PRIOR_DEVIATIONS[quantity]))
            bounds = np.append(bounds, np.full(size, bound))
        if len(deviations) > last:  # joints may all be of one kind, or each of its own
            last = len(deviations)
            yield name, Basis(names, deviations, bounds)
