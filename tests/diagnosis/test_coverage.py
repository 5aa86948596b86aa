"""What the healthy trials cover is told by the speeds of commands, by joint."""

import dataclasses
import re

import numpy as np
import pytest

from selfmodel.controllers.playback import played_back
from selfmodel.diagnosis.adequacy import COVERAGE, fast_parts, faster_joints
from selfmodel.robot.robot import Robot
from tests.diagnosis.doubts import KNEE, STEPS, WEAK, doubted, moved, problem_of, table_of, unlike
from tests.helpers.memory import trial_of


def test_speeds_are_those_of_commands_by_joint(quadruped: Robot):
    table = table_of(quadruped)
    slow, fast = (moved(quadruped, "third", pace=pace) for pace in (1, 2))
    problem, other = problem_of(table, fast, [slow]), problem_of(table, slow, [fast])

    faster = faster_joints(problem.trials, problem)

    assert set(faster) == {joint.name for joint in quadruped.anatomy.joints}
    for speed, covered in faster.values():
        assert COVERAGE * covered < speed < 2.1 * covered
        assert covered <= 0.6 * 2 * np.pi  # 0.6 rad at 1 Hz
    assert faster_joints(other.trials, other) == {}


def test_a_part_of_an_imported_trial_that_is_faster_may_be_left_out(
    quadruped: Robot,
):
    table, real = table_of(quadruped), unlike(quadruped)
    healthy = [moved(real, "first"), moved(real, "second")]
    slow, fast = (
        np.array(one.trajectory["commands"])
        for one in (moved(real, "first"), moved(real, "first", pace=3))
    )
    slow[250:300] = fast[250:300]
    driver = played_back(real.anatomy.motors, slow)
    run = trial_of(real, WEAK, driver, steps=STEPS, name="imported")
    trial = dataclasses.replace(run, path="logs/part.mcap")
    problem, times = problem_of(table, trial, healthy), trial.trajectory.time
    doubt = doubted(problem, WEAK)

    assert doubt is not None
    part = re.search(r"leave_out = \[\[(.*), (.*)\]\] in the mapping file of 'part'", doubt.remedy)
    assert part is not None
    begin, end = map(float, part.groups())
    assert (begin, end) == pytest.approx((times[250], times[300]), abs=0.11)

    signals = {name: np.array(values) for name, values in trial.trajectory.signals.items()}
    for name in signals.keys() - {"commands"}:
        signals[name][(times >= begin) & (times <= end)] = np.nan
    without = dataclasses.replace(trial, trajectory=trial.trajectory.with_signals(signals))
    rest = problem_of(table, without, healthy)
    assert not faster_joints(rest.trials, rest)

    written = dataclasses.replace(trial, plan=dataclasses.replace(run.plan, name="after"))
    for other in (moved(real, "first", pace=3), written):  # fast throughout; and not imported
        assert not fast_parts([KNEE], problem_of(table, other, healthy))
