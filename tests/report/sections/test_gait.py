import dataclasses

import numpy as np

from selfmodel.report.charts import GaitDiagram
from selfmodel.report.rollouts import TrialRollouts
from selfmodel.report.sections.gait import gait_section
from selfmodel.report.subject import Subject


def test_the_spans_of_a_lane_are_the_times_of_contact(
    subject: Subject, rolled: tuple[TrialRollouts, ...]
):
    section = gait_section(subject, rolled)
    assert section is not None
    diagram = section.items[0]
    assert isinstance(diagram, GaitDiagram)

    behaviour = rolled[0].trial.behaviour
    for lane in diagram.groups["measured"]:
        column = behaviour.names.sensors.index(lane.label)
        contact = np.zeros(behaviour.steps, dtype=bool)
        for begin, end in lane.spans:
            contact |= (behaviour.time >= begin) & (behaviour.time < end)
        logged = behaviour["sensors"][:, column] > 0.5
        assert np.array_equal(contact[:-1], logged[:-1])


def test_a_simulation_that_diverged_has_no_contacts(
    subject: Subject, rolled: tuple[TrialRollouts, ...]
):
    first = dataclasses.replace(rolled[0].rollouts[0], diverged=True)
    diverged = dataclasses.replace(rolled[0], rollouts=(first,))

    section = gait_section(subject, (diverged,))

    assert section is not None
    assert isinstance(section.items[0], GaitDiagram)
    assert list(section.items[0].groups) == ["measured"]
