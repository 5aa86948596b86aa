"""From the rows of some steps to the messages that a log gets for them."""

import dataclasses
from collections.abc import Mapping
from itertools import repeat
from operator import itemgetter

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.frames import (
    Kinematics,
    body_names,
    into_child_frame,
    parent_names,
    to_micrometres,
)
from selfmodel.logs.topics import TIMING, Part, frames_stride, topics, transforms
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import SIGNALS, Names, Sample


def empty_rows(names: Names, steps: int, *, timed: bool) -> dict[Part, FloatArray]:
    """Returns room for what so many steps have to be told of, ``(steps, width)`` each.

    Args:
        names: The columns of a robot's signals.
        steps: How many rows.
        timed: Whether the steps say when they really happened.
    """
    rows: dict[Part, FloatArray] = {
        signal: np.empty((steps, names.width(signal))) for signal in SIGNALS
    }
    if timed:
        rows["timing"] = np.empty((steps, 3))
    return rows


def parts_of(sample: Sample) -> dict[Part, FloatArray]:
    """Returns what a sample tells, ``(width,)`` each."""
    parts: dict[Part, FloatArray] = {}
    parts.update(sample.values.items())
    if sample.moment is not None:
        parts["timing"] = np.array(dataclasses.astuple(sample.moment), dtype=np.float64)
    return parts


class Encoder:
    """Makes the messages of one trial.

    Args:
        robot: As its model describes it.
        timed: Whether the rows say when they really happened.

    Attributes:
        topics: What there are messages of, in the order in which a step has them.
    """

    def __init__(self, robot: Robot, *, timed: bool = False) -> None:
        frames = transforms(body_names(robot.model), parent_names(robot.model))
        every = topics(robot.anatomy.names, robot.root)
        self.topics = (*every, *([TIMING] if timed else []), frames)
        self._timestep = robot.control_timestep
        self._kinematics = Kinematics(robot)
        self._stride = frames_stride(robot.control_timestep)

    def encode(
        self, first: int, rows: Mapping[Part, FloatArray]
    ) -> list[tuple[int, int, int, bytes]]:
        """Returns the messages of some steps, in order.

        Args:
            first: The number of the first step.
            rows: Each signal, ``(steps, width)``, and ``timing`` if there is one.

        Returns:
            Step, index into ``topics``, time in ns, and payload of each.
        """
        count = len(rows["sensors"])
        steps = np.arange(first, first + count)
        stamps = np.rint(steps * self._timestep * 1e9).astype(np.int64)
        seen = slice(-first % self._stride, None, self._stride)
        every = slice(None)
        parts: dict[Part, FloatArray] = {
            "child_linear_velocity": to_micrometres(
                into_child_frame(rows["base_linear_velocity"], rows["base_orientation"])
            ),
            "transforms": self._kinematics.transforms(
                rows["joint_positions"][seen],
                rows["base_position"][seen],
                rows["base_orientation"][seen],
            ),
        }
        parts.update(rows)
        told: list[tuple[int, int, int, bytes]] = []
        for number, topic in enumerate(self.topics):
            chosen = seen if number == len(self.topics) - 1 else every
            payloads = topic.template.encode(stamps[chosen], topic.pack(parts))
            told += zip(steps[chosen].tolist(), repeat(number), stamps[chosen].tolist(), payloads)
        told.sort(key=itemgetter(0, 1))
        return told
