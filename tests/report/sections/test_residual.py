import dataclasses

import numpy as np
import pytest

from selfmodel.comparators import COMPARATORS
from selfmodel.diagnosis.verdicts.change_point import Change
from selfmodel.faults.hypothesis import INTACT
from selfmodel.report.charts import HeatMap, LineChart
from selfmodel.report.sections.residual import residual_section
from selfmodel.report.subject import Subject


def test_the_losses_are_those_of_the_comparator(subject: Subject):
    section = residual_section(subject)
    assert section is not None
    by_hypothesis, by_signal, _ = section.items
    assert isinstance(by_hypothesis, LineChart)
    assert isinstance(by_signal, LineChart)

    best = by_hypothesis.series[0]
    (losses,) = subject.evidence.losses([subject.diagnosis.best], subject.damaged)

    assert best.y == tuple(losses)
    assert np.allclose(np.sum([one.y for one in by_signal.series], axis=0), losses)
    assert [one.name.split(":")[0] for one in by_hypothesis.series][0::2] == ["best", "healthy"]


def test_the_second_trial_begins_after_the_first(subject: Subject):
    section = residual_section(subject)
    assert section is not None

    names = [(mark.label, mark.value) for mark in section.items[0].marks]

    assert names == [("01-after", 0.0), ("02-recovery", pytest.approx(0.6))]


def test_a_change_is_marked_with_its_interval_in_its_trial(subject: Subject):
    change = Change("02-recovery", 1, 0.3, 0.2, 0.4, INTACT, subject.diagnosis.best)
    diagnosis = dataclasses.replace(subject.diagnosis, change=change)

    section = residual_section(dataclasses.replace(subject, diagnoses=(diagnosis,)))

    assert section is not None
    mark = section.items[0].marks[-1]
    assert (mark.value, mark.low, mark.high) == pytest.approx((0.9, 0.8, 1.0))
    assert (
        "changed at about t = 0.3 s (0.2 to 0.4) of 02-recovery; before: intact" in section.text[1]
    )


def test_the_heat_map_has_a_row_for_each_sensor_and_encoder(subject: Subject):
    section = residual_section(subject)
    assert section is not None
    heat = section.items[-1]
    assert isinstance(heat, HeatMap)

    names = subject.damaged[0].behaviour.names
    assert [row.label for row in heat.rows] == [
        *names.sensors,
        *(f"encoder {one}" for one in names.hinges),
    ]
    assert all(len(row.values) == len(heat.begin) == len(heat.end) for row in heat.rows)


def test_a_comparator_of_whole_trials_has_the_errors_by_sensor_alone(subject: Subject):
    section = residual_section(dataclasses.replace(subject, comparator=COMPARATORS["gait-pattern"]))

    assert section is not None
    assert [type(item) for item in section.items] == [HeatMap]
