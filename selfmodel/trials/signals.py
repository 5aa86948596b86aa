"""The signals of a run: their names and columns, their differences, and their scales.

The scales differ on purpose, for the reason that each gives. Their units are those of ``SIGNALS``;
an orientation is compared as a rotation angle, rad, or as directions.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.rotation import directions, rotation_between

Signal = Literal[
    "sensors",
    "commands",
    "joint_positions",
    "joint_velocities",
    "joint_efforts",
    "base_position",
    "base_orientation",
    "base_linear_velocity",
    "base_angular_velocity",
]

SIGNALS: tuple[Signal, ...] = get_args(Signal)
"""Every signal of a run, in the order of the trial log.

``sensors``: the readings that the controller received (touch 0 or 1, angles scaled to the joint's
range). ``commands``: actuator controls, each in its own unit: a position servo's target, rad.
``joint_positions``: rad. ``joint_velocities``: rad/s.
``joint_efforts``: torque at the joint over the last physics step, N m; 0 at the start.
``base_position``: root body, world frame, m. ``base_orientation``: unit quaternion, w x y z.
``base_linear_velocity``: world frame, m/s. ``base_angular_velocity``: body frame, rad/s.
"""


@dataclass(frozen=True)
class Names:
    """Column names of the signals of a trajectory, in the order of the controller and the model."""

    sensors: tuple[str, ...]
    motors: tuple[str, ...]
    hinges: tuple[str, ...]

    def width(self, signal: Signal) -> int:
        """Number of columns of a signal."""
        return len(self.columns(signal))

    def columns(self, signal: Signal) -> tuple[str, ...]:
        """Column names of a signal."""
        if signal.startswith("joint_"):
            return self.hinges
        others = {"sensors": self.sensors, "commands": self.motors}
        xyz = ("x", "y", "z")
        return others.get(signal, ("w", *xyz) if signal == "base_orientation" else xyz)


def difference(signal: Signal, one: FloatArray, other: FloatArray) -> FloatArray:
    """Returns ``one - other``, ``(..., width)``; of orientations the rotation, ``(..., 3)``."""
    if signal == "base_orientation":
        return rotation_between(one, other)
    return np.asarray(one - other)


def comparable(signal: Signal, values: FloatArray) -> FloatArray:
    """Returns columns that may be averaged and subtracted: an orientation's direction cosines."""
    return directions(values) if signal == "base_orientation" else values


_SCALES: Mapping[Signal, tuple[float | None, ...]] = {
    # prediction, hinge, calibration, disagreement, ensemble, full scale
    "sensors": (0.3, None, None, 1.0, 0.1, None),
    "commands": (0.05, None, None, None, None, None),
    "joint_positions": (0.1, 0.03, 0.03, 0.3, 0.05, None),
    "joint_velocities": (3.0, 0.5, 1.0, None, None, 2.0),
    "joint_efforts": (None, None, None, None, None, 5.0),
    "base_position": (0.03, None, 0.01, 0.1, None, 0.1),
    "base_orientation": (0.1, None, 0.03, 0.3, 0.1, 0.1),
    "base_linear_velocity": (0.3, None, 0.1, 0.3, 0.1, 0.5),
    "base_angular_velocity": (1.0, None, 0.3, 1.0, None, 0.5),
}


def _column(number: int) -> Mapping[Signal, float]:
    rows = ((signal, scales[number]) for signal, scales in _SCALES.items())
    return MappingProxyType({signal: scale for signal, scale in rows if scale is not None})


PREDICTION_ERROR_SCALES = _column(0)
"""Error of a short prediction that counts as large (``segment-prediction``).

About three times the scales of calibration: the robot is damaged, and the loss of the true
hypothesis must stay small in spite of the reality gap. The scale of commands is for the paper's
command range, and is multiplied by a motor's own range over the paper's."""

HINGE_ERROR_SCALES = _column(1)
"""Error of a short prediction of one hinge that counts as large (``hinge_errors``).

Those of calibration or smaller: losses are compared between hypotheses about one joint, and with
those of the same joint in healthy trials, so the error of the model is on both sides."""

CALIBRATION_ERROR_SCALES = _column(2)
"""Error of a short prediction above which calibration counts it linearly, below quadratically.

Smaller than the scales of diagnosis: a healthy robot differs from its model by parameters only, and
the fit is to find small differences. An impact that is predicted a step early or late has a large
error and contains no information about masses."""

DISAGREEMENT_SCALES = _column(3)
"""Difference of two predictions that counts as full disagreement; larger ones count no more.

As large as the scales of diagnosis or larger, because two predictions are compared over 100 steps
instead of 12: a difference must exceed the effect of the reality gap."""

ENSEMBLE_DEVIATION_FLOORS = _column(4)
"""Standard deviation added in squares to that of the members (``noisy-transfer``).

It represents variation that the members do not have, such as measurement noise. The base's position
is left out: it is a sum over the trial, so early differences of the members remain until its end.
"""

SERIES_SPREAD_FLOORS = MappingProxyType({**ENSEMBLE_DEVIATION_FLOORS, "base_position": 0.05})
"""Lower bound of the standard deviation that scales a column (``sensor-series``): a column that
hardly moves in the trial must not make a small difference infinite."""

MEASUREMENT_FULL_SCALES = _column(5)
"""Full scale of each logged signal; the level of measurement noise is a fraction of it.

Amplitudes of the signals of a walking robot. The full scale of a joint position is half the range
of its hinge. Commands have no noise: they are not measured."""
