"""Section of the gait: contacts of the touch sensors over time."""

from collections.abc import Sequence

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.report.charts import GaitDiagram, Lane
from selfmodel.report.document import Section
from selfmodel.report.rollouts import TrialRollouts
from selfmodel.report.subject import Subject
from selfmodel.trials.behaviour import Behaviour

MAX_DIAGRAMS = 12
"""Trials with a diagram, at most: the last ones."""


def gait_section(subject: Subject, rolled: Sequence[TrialRollouts]) -> Section | None:
    """Returns the section of the gait; None for a robot without touch sensors.

    Args:
        subject: The subject.
        rolled: Rollouts of every trial.
    """
    sensors = subject.robot.anatomy.sensors
    touch = [(i, one.name) for i, one in enumerate(sensors) if one.kind == "touch"]
    diagrams = tuple(_diagram(one, touch) for one in rolled[-MAX_DIAGRAMS:] if touch)
    shown = tuple(one for one in diagrams if any(one.groups.values()))
    if not shown:
        return None
    text = (
        "A bar is the time in which a touch sensor has contact (after Hildebrand, 1965). The "
        "sensors of a detached limb have none."
    )
    return Section("gait", "Gait diagram", (text,), shown)


def _diagram(one: TrialRollouts, touch: Sequence[tuple[int, str]]) -> GaitDiagram:
    motions = [("measured", one.trial.behaviour)]
    motions += [(each.name, each.behaviour) for each in one.rollouts[:1] if not each.diverged]
    return GaitDiagram(
        title=f"Contacts in {one.name}",
        groups={
            name: tuple(
                Lane(sensor, _spans(behaviour, behaviour["sensors"][:, i])) for i, sensor in touch
            )
            for name, behaviour in motions
            if np.isfinite(behaviour["sensors"][:, [i for i, _ in touch]]).any()
        },
        end=float(one.trial.behaviour.time[-1]),
    )


def _spans(behaviour: Behaviour, readings: FloatArray) -> tuple[tuple[float, float], ...]:
    """Returns the times from the first step with contact to the first without."""
    contact = np.concatenate([[False], readings > 0.5, [False]])
    edges = np.flatnonzero(contact[1:] != contact[:-1])
    last = behaviour.steps - 1
    return tuple(
        (float(behaviour.time[begin]), float(behaviour.time[min(end, last)]))
        for begin, end in edges.reshape(-1, 2)
    )
