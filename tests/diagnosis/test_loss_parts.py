"""Tests of losses on parts of trials, of their times, and of their signals."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.comparators import (
    FORWARD_DISPLACEMENT,
    SEGMENT_PREDICTION,
    SEGMENT_PREDICTION_ONBOARD,
)
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial, TrialPart, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import exploding
from tests.helpers.memory import in_memory

STEPS = 240


@pytest.fixture(scope="module")
def trials(quadruped: Robot) -> list[Trial]:
    """Two trials of a jammed robot, of different lengths."""
    damaged = SimulatedRobot(quadruped, parse("jam:front_left_knee", quadruped.anatomy))
    return [
        in_memory(quadruped)(damaged, TrialPlan(f"{k}", "after", controller, STEPS - 60 * k, 0))
        for k, controller in enumerate(random_controllers(quadruped, 3)[1:])
    ]


@pytest.fixture(scope="module")
def evidence(quadruped: Robot) -> LossTable:
    return LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION)


@pytest.fixture(scope="module")
def two(quadruped: Robot) -> list[Hypothesis]:
    return [INTACT, parse("break:back_left_knee", quadruped.anatomy)]


def test_a_part_without_bounds_is_the_whole_trial(
    evidence: LossTable, trials: list[Trial], two: list[Hypothesis]
):
    parts = [TrialPart(trial) for trial in trials]

    np.testing.assert_array_equal(evidence.losses(two, parts), evidence.losses(two, trials))
    np.testing.assert_array_equal(evidence.distances(two, parts), evidence.distances(two, trials))
    assert evidence.by_signal(INTACT, parts).keys() == evidence.by_signal(INTACT, trials).keys()


@settings(max_examples=30)
@given(times=st.tuples(st.floats(-1, 3), st.floats(-1, 3)))
def test_losses_of_a_part_are_the_columns_of_the_whole_within_its_bounds(
    evidence: LossTable, trials: list[Trial], two: list[Hypothesis], times: tuple[float, float]
):
    begin, end = sorted(times)
    trial, other = trials
    timeline = evidence.timeline([trial])
    assert timeline is not None
    inside = (timeline.begin >= begin) & (timeline.end <= end)
    part = TrialPart(trial, begin, end)
    whole = evidence.losses(two, [trial, other])
    found = evidence.losses(two, [part, other])

    pieces = len(timeline.begin)
    np.testing.assert_array_equal(found[:, : inside.sum()], whole[:, :pieces][:, inside])
    np.testing.assert_array_equal(found[:, inside.sum() :], whole[:, pieces:])
    if inside.any():
        expected = evidence.losses(two, [trial])[:, inside].mean(axis=1)
        np.testing.assert_allclose(evidence.distances(two, [part]), expected)


def test_the_timeline_has_the_times_of_the_columns_of_the_losses(
    evidence: LossTable, trials: list[Trial]
):
    timeline = evidence.timeline(trials)
    assert timeline is not None
    shape = evidence.losses([INTACT], trials)[0].shape
    counts = [evidence.losses([INTACT], [trial]).shape[1] for trial in trials]

    assert timeline.trial.shape == timeline.begin.shape == timeline.end.shape == shape
    assert timeline.trial.tolist() == [0] * counts[0] + [1] * counts[1]
    seconds = SEGMENT_PREDICTION.horizon * 0.01
    np.testing.assert_allclose(timeline.end - timeline.begin, seconds)
    for index, trial in enumerate(trials):
        own = timeline.trial == index
        assert timeline.begin[own][0] == trial.behaviour.time[0]
        assert timeline.end[own][-1] == trial.behaviour.time[-1]
        assert (np.diff(timeline.begin[own]) > 0).all()


def test_an_error_within_a_piece_is_in_the_column_of_its_time(
    evidence: LossTable, quadruped: Robot, trials: list[Trial]
):
    """A logged angle that is wrong in one step raises the losses of the pieces with that step."""
    trial, jam = trials[0], parse("jam:front_left_knee", quadruped.anatomy)
    signals = {name: values.copy() for name, values in trial.behaviour.signals.items()}
    signals["base_orientation"][100:103] = [0, 1, 0, 0]
    behaviour = type(trial.behaviour)(trial.behaviour.names, trial.behaviour.time, signals)
    wrong = Trial(trial.plan, trial.robot, behaviour, "wrong")
    timeline = evidence.timeline([wrong])
    assert timeline is not None
    changed = evidence.losses([jam], [wrong])[0] > evidence.losses([jam], [trial])[0] + 0.1

    touched = (timeline.begin <= 1.02) & (timeline.end >= 1.0)
    assert changed.any()
    assert not changed[~touched].any()


def test_a_comparator_without_times_has_no_timeline_and_no_signals(
    quadruped: Robot, trials: list[Trial], two: list[Hypothesis]
):
    evidence = LossTable(Simulator(quadruped, 1), FORWARD_DISPLACEMENT)

    assert evidence.timeline(trials) is None
    assert evidence.by_signal(INTACT, trials) == {}
    part = TrialPart(trials[0], 1.0, 2.0)
    np.testing.assert_array_equal(evidence.losses(two, [part]), evidence.losses(two, trials[:1]))


@pytest.mark.parametrize("comparator", [SEGMENT_PREDICTION, SEGMENT_PREDICTION_ONBOARD])
@pytest.mark.parametrize("bounds", [(-np.inf, np.inf), (0.5, 1.7)])
def test_the_losses_of_the_signals_sum_to_the_mean_loss(
    quadruped: Robot,
    trials: list[Trial],
    two: list[Hypothesis],
    comparator: Comparator,
    bounds: tuple[float, float],
):
    evidence = LossTable(Simulator(quadruped, 1), comparator)
    parts = [TrialPart(trials[0], *bounds), trials[1]]
    for hypothesis in two:
        found = evidence.by_signal(hypothesis, parts)

        assert {"commands", "joint_positions", "sensors", "encoder motion"} <= set(found)
        expected = evidence.losses([hypothesis], parts).mean()
        assert sum(found.values()).mean() == pytest.approx(expected)
        assert expected > 0


def test_a_hypothesis_that_diverged_has_no_by_signal(quadruped: Robot, trials: list[Trial]):
    simulator = Simulator(quadruped, 1)
    bad = exploding(simulator, "jam:front_left_knee")

    assert LossTable(simulator, SEGMENT_PREDICTION).by_signal(bad, trials) == {}


def test_the_losses_of_hinges_have_the_pieces_of_the_losses(
    evidence: LossTable, trials: list[Trial], two: list[Hypothesis], quadruped: Robot
):
    parts = [trials[0], TrialPart(trials[1], begin=0.5)]
    losses, hinges = evidence.losses(two, parts), evidence.by_hinge(two, parts)

    assert hinges.shape == (*losses.shape, len(quadruped.anatomy.hinges))
    first = evidence.by_hinge(two, trials[:1])
    np.testing.assert_array_equal(hinges[:, : first.shape[1]], first)


def test_losses_their_signals_and_those_of_hinges_are_of_one_simulation(
    quadruped: Robot, trials: list[Trial], two: list[Hypothesis], evidence: LossTable
):
    simulator = Simulator(quadruped, 1)
    once = LossTable(simulator, SEGMENT_PREDICTION)
    hinges = once.by_hinge(two, trials)
    steps = simulator.stats.steps

    np.testing.assert_array_equal(once.losses(two, trials), evidence.losses(two, trials))
    np.testing.assert_array_equal(once.by_hinge(two, trials), hinges)
    assert once.by_signal(INTACT, trials)
    assert simulator.stats.steps == steps


def test_a_jam_shows_in_the_loss_of_its_hinge(evidence: LossTable, trials: list[Trial]):
    names = trials[0].behaviour.names.hinges
    mean = evidence.by_hinge([INTACT], trials)[0].mean(axis=0)

    assert names[int(np.argmax(mean))] == "front_left_knee"


def test_a_detached_hinge_has_no_losses_and_the_others_have(
    evidence: LossTable, trials: list[Trial], two: list[Hypothesis]
):
    unknown = np.isnan(evidence.by_hinge(two, trials)).all(axis=1)
    names = trials[0].behaviour.names.hinges

    assert not unknown[0].any()
    assert [name for name, is_unknown in zip(names, unknown[1], strict=True) if is_unknown] == [
        "back_left_knee"
    ]


def test_a_jam_at_the_angle_of_an_exact_encoder_has_losses(
    evidence: LossTable, trials: list[Trial], quadruped: Robot
):
    """A detached hinge is predicted at that angle too, and has none."""
    jam = parse("jam:front_left_knee", quadruped.anatomy)
    losses = evidence.by_hinge([jam], trials)

    assert np.isfinite(losses).all()
    assert losses.max() < 1e-6


def test_the_losses_of_hinges_are_infinite_where_a_hypothesis_diverges(
    quadruped: Robot, trials: list[Trial]
):
    simulator = Simulator(quadruped, 1)
    bad = exploding(simulator, "jam:front_left_knee")
    losses = LossTable(simulator, SEGMENT_PREDICTION).by_hinge([bad, INTACT], trials)

    assert np.isinf(losses[0]).all()
    assert np.isfinite(losses[1]).all()


def test_a_comparator_of_displacements_predicts_no_hinges(quadruped: Robot, trials: list[Trial]):
    evidence = LossTable(Simulator(quadruped, 1), FORWARD_DISPLACEMENT)

    assert evidence.by_hinge([INTACT], trials) is None
