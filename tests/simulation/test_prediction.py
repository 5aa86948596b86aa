"""Promises of prediction: from logged states it makes the trial again, late commands and all."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest

from selfmodel import arguments
from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import played_back
from selfmodel.errors import InputError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.physical.gap import draw_gap
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.batch import SimulationStats
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.simulation.prediction import predict
from selfmodel.simulation.requests import END, Segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour, collect
from selfmodel.trials.estimation import JOINTS, ONBOARD, STATE
from selfmodel.trials.rotation import rotation_between
from selfmodel.trials.signals import SIGNALS, Signal
from tests.helpers.drivers import random_motion
from tests.helpers.hostile import exploding

HORIZON, STEPS = 12, 100
RECORD: tuple[Signal, ...] = (*STATE, "sensors")
EXACT = 1e-6


def moved(robot: Robot, steps: int = STEPS) -> CommandSource:
    """A driver that moves every joint."""
    return played_back(robot.anatomy.motors, random_motion(robot, steps))


def trial(robot: Robot, hypothesis: Hypothesis = INTACT) -> Behaviour:
    """One run without noise."""
    batch = Simulator(robot, 1).run([(hypothesis, moved(robot))], STEPS, SIGNALS).behaviour
    return Behaviour(batch.names, batch.time, {signal: batch[signal][0] for signal in SIGNALS})


def cut(
    run: Behaviour, starts: Sequence[int], signals: tuple[Signal, ...] = STATE, lead: int = 0
) -> Segments:
    commands = np.concatenate([np.zeros((lead, run["commands"].shape[1])), run["commands"]])
    return Segments(
        states={signal: run[signal][list(starts)] for signal in signals},
        commands=np.stack([commands[k : k + lead + HORIZON] for k in starts]),
        lead=lead,
        record=RECORD,
    )


def furthest(predicted: Behaviour, run: Behaviour, starts: Sequence[int]) -> float:
    """By how much the first of the models is wrong anywhere."""
    worst = 0.0
    for signal in STATE:
        logged = np.stack([run[signal][k : k + HORIZON + 1] for k in starts])
        made = predicted[signal][0]
        apart = rotation_between(made, logged) if signal == "base_orientation" else made - logged
        worst = max(worst, float(np.abs(apart).max()))
    return worst


def late(robot: Robot, delay: int) -> Robot:
    return with_parameters(robot, dataclasses.replace(nominal(robot), delay=delay))


def test_every_single_fault_is_predicted_as_it_was(robot: Robot):
    faults = [fault for kind in PAPER_KINDS for fault in kind.candidates(robot.anatomy)]
    simulator = Simulator(robot, 1)
    starts = range(0, STEPS - HORIZON, 15)

    assert {fault.kind.name for fault in faults} == {"break", "jam", "sensor"}
    for hypothesis in (INTACT, *(canonical([fault], robot.anatomy) for fault in faults)):
        run = trial(robot, hypothesis)
        outcome = simulator.predict([hypothesis], cut(run, starts))

        assert furthest(outcome.behaviour, run, starts) < EXACT, str(hypothesis)
        assert not outcome.diverged.any()


def test_another_hypothesis_predicts_another_motion(quadruped: Robot):
    run, starts = trial(quadruped), range(0, STEPS - HORIZON, 15)
    broken = parse("break:front_left_knee", quadruped.anatomy)
    outcome = Simulator(quadruped, 1).predict([broken], cut(run, starts))

    assert furthest(outcome.behaviour, run, starts) > 0.1


def test_a_jammed_joint_begins_where_it_is_held(quadruped: Robot):
    run = trial(quadruped)
    jammed = parse("jam:front_left_knee=0.3", quadruped.anatomy)
    outcome = Simulator(quadruped, 1).predict([jammed], cut(run, [20, 40]))
    knee = quadruped.anatomy.hinges.index("front_left_knee")

    np.testing.assert_allclose(outcome.behaviour["joint_positions"][..., knee], 0.3, atol=EXACT)
    np.testing.assert_allclose(outcome.behaviour["joint_velocities"][..., knee], 0, atol=1e-4)


@pytest.mark.parametrize("signals", [STATE, ONBOARD], ids=["whole", "onboard"])
def test_the_joints_of_a_lost_limb_rest_where_noise_hides_them(
    robot: Robot, signals: tuple[Signal, ...]
):
    anatomy = robot.anatomy
    joint = anatomy.joints[0]
    broken = parse(f"break:{joint.name}", anatomy)
    segments = cut(trial(robot, broken), range(0, STEPS - HORIZON, 15), signals)
    rng = np.random.default_rng(0)
    shifted = segments.states["joint_positions"] + rng.normal(
        0.2, 0.1, segments.states["joint_positions"].shape
    )
    noisy = {**segments.states, "joint_positions": shifted, "joint_velocities": shifted}
    shaken = dataclasses.replace(segments, states=noisy)
    outcome = Simulator(robot, 1).predict([INTACT, broken], shaken)
    beyond = [joint, *(other for other in anatomy.joints if other.name in joint.descendants)]
    lost = [anatomy.hinges.index(hinge) for each in beyond for hinge in each.hinges]
    positions = outcome.behaviour["joint_positions"][..., lost]
    velocities = outcome.behaviour["joint_velocities"][..., lost]

    last_third = shifted[round((1 - END) * len(shifted)) :, lost]
    np.testing.assert_allclose(
        positions[1], np.broadcast_to(np.median(last_third, axis=0), positions[1].shape)
    )
    assert shaken.resting_angles is not None
    np.testing.assert_array_equal(positions[1, 0, 0], shaken.resting_angles[lost])
    np.testing.assert_array_equal(velocities[1], 0)
    assert len(beyond) > 1
    np.testing.assert_allclose(positions[0, :, 0], shifted[:, lost])


def test_a_lost_limb_rests_wherever_it_starts():
    # The hopper's knee starts beyond its limit, which would push it all through the trial.
    robot = arguments.robot_entry("suite-hopper-hop").robot()
    broken = parse("break:knee", robot.anatomy)
    run, starts = trial(robot, broken), range(0, STEPS - HORIZON, 15)
    outcome = Simulator(robot, 1).predict([broken], cut(run, starts))
    knee = robot.anatomy.hinges.index("knee")

    assert run["joint_positions"][0, knee] < robot.anatomy.joint("knee").limits[0][0]
    assert furthest(outcome.behaviour, run, starts) < EXACT


@pytest.mark.parametrize("delay", [1, 2, 5])
def test_a_delay_is_the_same_in_a_run_a_prediction_and_a_physical_robot(
    quadruped: Robot, delay: int
):
    slow, prompt = late(quadruped, delay), late(quadruped, 0)
    run = trial(slow)
    gap = draw_gap(quadruped, 0.0, np.random.default_rng(0))
    gap = dataclasses.replace(gap, level=1e-12, delay=delay)
    physical = SimulatedRobot(prompt, gap=gap).run(moved(slow), STEPS)
    observed = collect(slow.anatomy.names, physical)
    exact = collect(slow.anatomy.names, SimulatedRobot(slow).run(moved(slow), STEPS))
    starts = range(0, STEPS - HORIZON, 10)
    segments = cut(run, starts, lead=5)

    def predicted(robot: Robot, steps: int | None) -> Behaviour:
        built = [build(robot, INTACT)]
        return predict(
            robot, built, segments, threads=1, stats=SimulationStats(), delay=steps
        ).behaviour

    for signal in SIGNALS:
        assert exact[signal].tobytes() == run[signal].tobytes(), signal
        if signal != "sensors":  # a touch may come a step later
            np.testing.assert_allclose(observed[signal], run[signal], atol=1e-5, err_msg=signal)
    assert furthest(predicted(slow, None), run, starts) < EXACT
    assert furthest(predicted(prompt, delay), run, starts) < EXACT
    assert furthest(predicted(prompt, None), run, starts) > 0.01


def test_segments_that_do_not_say_what_is_still_on_its_way_are_refused(quadruped: Robot):
    segments = cut(trial(quadruped), range(0, STEPS - HORIZON, 10), lead=1)
    Simulator(late(quadruped, 1), 1).predict([INTACT], segments)

    said = "take effect 2 steps late, and segments have a lead of 1"
    with pytest.raises(InputError, match=said):
        Simulator(late(quadruped, 2), 1).predict([INTACT], segments)
    with pytest.raises(InputError, match=said):
        predict(
            quadruped,
            [build(quadruped, INTACT)],
            segments,
            threads=1,
            stats=SimulationStats(),
            delay=2,
        )


def test_without_the_base_a_segment_goes_on_where_the_one_before_it_ended(robot: Robot):
    run, starts = trial(robot), range(0, STEPS - HORIZON, HORIZON)
    outcome = Simulator(robot, 1).predict([INTACT, INTACT], cut(run, starts, ONBOARD))
    base = outcome.behaviour["base_position"]

    assert len(starts) > 5
    assert base[:, 1:, 0].tobytes() == base[:, :-1, -1].tobytes()
    # What was logged is what was predicted, so the whole chain is the trial.
    assert furthest(outcome.behaviour, run, starts) < 10 * EXACT


@pytest.mark.parametrize("signals", [STATE, ONBOARD], ids=["whole", "onboard"])
def test_a_prediction_has_the_same_bits_in_any_batch_and_number_of_threads(
    robot: Robot, signals: tuple[Signal, ...]
):
    joints = [joint.name for joint in robot.anatomy.joints]
    texts = ("intact", f"break:{joints[0]}", f"jam:{joints[1]}=0.2", f"break:{joints[-1]}")
    hypotheses = [parse(text, robot.anatomy) for text in texts]
    segments = cut(trial(robot), range(0, STEPS - HORIZON, 9), signals)

    def bits(chosen: Sequence[Hypothesis], threads: int) -> list[bytes]:
        made = Simulator(robot, threads).predict(chosen, segments).behaviour
        return [b"".join(made[s][i].tobytes() for s in RECORD) for i in range(len(chosen))]

    expected = bits(hypotheses, 1)

    assert len(set(expected)) == len(hypotheses)
    assert bits(hypotheses, 2) == bits(hypotheses, 3) == expected
    assert bits(hypotheses[::-1], 2) == expected[::-1]
    assert [bits([one], 2)[0] for one in hypotheses] == expected


def test_a_whole_state_is_predicted_alike_in_any_choice_of_segments(quadruped: Robot):
    run, simulator = trial(quadruped), Simulator(quadruped, 2)
    all_of_them = simulator.predict([INTACT], cut(run, [0, 30, 60])).behaviour
    for place, start in enumerate([0, 30, 60]):
        alone = simulator.predict([INTACT], cut(run, [start])).behaviour
        for signal in RECORD:
            assert alone[signal][0, 0].tobytes() == all_of_them[signal][0, place].tobytes()


def test_a_prediction_that_diverges_is_flagged_counted_and_alone(quadruped: Robot):
    segments = cut(trial(quadruped), [0, 30, 60])
    expected = Simulator(quadruped, 1).predict([INTACT], segments).behaviour
    simulator = Simulator(quadruped, 1)
    bad = exploding(simulator, "jam:front_left_knee=0.1")
    outcome = simulator.predict([bad, INTACT], segments)

    assert outcome.diverged.tolist() == [True, False]
    assert (simulator.stats.runs, simulator.stats.diverged) == (2, 1)
    assert simulator.stats.steps == 2 * 3 * HORIZON
    for signal in RECORD:
        assert outcome.behaviour[signal][1].tobytes() == expected[signal][0].tobytes()


def unknown(segments: Segments, run: Behaviour, hinge: str) -> Segments:
    """The segments, with an encoder that was lost."""
    column = run.names.hinges.index(hinge)
    states = {signal: values.copy() for signal, values in segments.states.items()}
    for signal in JOINTS:
        states[signal][:, column] = np.nan
    return dataclasses.replace(segments, states=states)


def test_an_unknown_hinge_continues_from_the_segment_before(quadruped: Robot):
    run, starts = trial(quadruped), range(0, STEPS - HORIZON, HORIZON)
    segments = unknown(cut(run, starts), run, "back_left_knee")

    predicted = Simulator(quadruped, 1).predict([INTACT], segments).behaviour
    assert furthest(predicted, run, starts) < EXACT


def test_the_hinges_of_a_lost_limb_need_no_known_angle(quadruped: Robot):
    lost = parse("break:front_left_knee", quadruped.anatomy)
    run, starts = trial(quadruped, lost), range(0, STEPS - HORIZON, HORIZON)
    segments = unknown(cut(run, starts), run, "front_left_knee")

    predicted = Simulator(quadruped, 1).predict([lost], segments).behaviour
    column = run.names.hinges.index("front_left_knee")
    assert np.all(predicted["joint_positions"][0, :, 0, column] == 0)
    apart = np.delete(predicted["joint_positions"][0, :, -1], column, axis=1) - np.delete(
        run["joint_positions"][np.array(starts) + HORIZON], column, axis=1
    )
    assert np.abs(apart).max() < EXACT
