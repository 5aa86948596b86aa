"""Encoder of control steps as the messages of a log."""

import dataclasses
from collections.abc import Mapping
from itertools import repeat
from operator import itemgetter

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.logs.topics import TIMING, Part, frames_stride, topics, transforms
from selfmodel.logs.viewers import (
    Kinematics,
    body_names,
    parent_names,
    to_body_frame,
    to_micrometres,
)
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Sample
from selfmodel.trials.signals import SIGNALS, Names


def empty_rows(names: Names, steps: int, *, timed: bool) -> dict[Part, FloatArray]:
    """Returns uninitialised rows of the numbers to log, ``(steps, width)`` each.

    Args:
        names: Columns of a robot's signals.
        steps: Number of rows.
        timed: Whether the steps have a step timing.
    """
    rows: dict[Part, FloatArray] = {
        signal: np.empty((steps, names.width(signal))) for signal in SIGNALS
    }
    if timed:
        rows["timing"] = np.empty((steps, 3))
    return rows


def sample_rows(sample: Sample) -> dict[Part, FloatArray]:
    """Returns the numbers of a sample, ``(width,)`` each."""
    parts: dict[Part, FloatArray] = {}
    parts.update(sample.values.items())
    if sample.moment is not None:
        parts["timing"] = np.array(dataclasses.astuple(sample.moment), dtype=np.float64)
    return parts


class Encoder:
    """Encoder of the messages of one trial.

    Args:
        robot: Robot as its model describes it.
        timed: Whether the steps have a step timing.

    Attributes:
        topics: Topics, in the order of a step's messages.
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
            first: Index of the first step.
            rows: Signals, ``(steps, width)`` each, with ``timing`` on a timed robot.

        Returns:
            Step, index into ``topics``, time in ns, and payload of each message.
        """
        count = len(rows["sensors"])
        steps = np.arange(first, first + count)
        stamps = np.rint(steps * self._timestep * 1e9).astype(np.int64)
        with_frames = slice(-first % self._stride, None, self._stride)
        every = slice(None)
        parts: dict[Part, FloatArray] = {
            "child_linear_velocity": to_micrometres(
                to_body_frame(rows["base_linear_velocity"], rows["base_orientation"])
            ),
            "transforms": self._kinematics.transforms(
                rows["joint_positions"][with_frames],
                rows["base_position"][with_frames],
                rows["base_orientation"][with_frames],
            ),
        }
        parts.update(rows)
        messages: list[tuple[int, int, int, bytes]] = []
        for number, topic in enumerate(self.topics):
            chosen = with_frames if number == len(self.topics) - 1 else every
            payloads = topic.template.encode(stamps[chosen], topic.pack(parts))
            messages += zip(
                steps[chosen].tolist(), repeat(number), stamps[chosen].tolist(), payloads
            )
        messages.sort(key=itemgetter(0, 1))
        return messages
