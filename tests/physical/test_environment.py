"""Promises of driving any environment: the same robot, and marks of when it was observed."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.comparators.readings import command_errors
from selfmodel.controllers.controller import Controller, make_batch
from selfmodel.errors import InputError, TrialError
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.environment import EnvironmentRobot, StepTimer
from selfmodel.physical.interface import TimedRobot
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS, load
from selfmodel.tasks.walking import motion_capture
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import TrialPlan
from tests.helpers.bench import (
    CONTROLLER,
    NAMES,
    QUADRUPED,
    STEPS,
    TIMESTEP,
    Bench,
    bench_robot,
    driven,
    observation,
)
from tests.helpers.drivers import random_controllers


@pytest.mark.parametrize(
    ("name", "text"), [("quadruped", "break:{0}"), ("hexapod", "sensor:{1}+friction=0.5")]
)
def test_our_own_tasks_give_the_simulated_robots_trial_to_the_bit(name: str, text: str):
    robot = ROBOTS[name].robot()
    anatomy = robot.anatomy
    text = text.format(anatomy.joints[0].name, anatomy.sensors[-1].name)
    env = load(robot.name, "walk", {"hypothesis": text})
    driver = random_controllers(robot, 1)[0]
    physical = EnvironmentRobot(env, robot, observe=motion_capture(env))
    for _ in range(2):  # again on the same environment
        got = collect(anatomy.names, physical.run(driver, 60))
        expected = collect(
            anatomy.names, SimulatedRobot(robot, parse(text, anatomy)).run(driver, 60)
        )
        assert got.time.tobytes() == expected.time.tobytes()
        assert got.late is not None
        assert not got.late.any()
        for signal in SIGNALS:
            assert got[signal].tobytes() == expected[signal].tobytes(), signal


def test_what_an_environment_does_not_observe_is_marked():
    env = load("quadruped", "walk")
    got = collect(NAMES, EnvironmentRobot(env, QUADRUPED).run(CONTROLLER, 3))

    unobserved = [signal for signal in SIGNALS if np.isnan(got[signal]).all()]
    assert unobserved == ["joint_efforts", "base_position"]


def test_times_are_those_aimed_at_and_marks_tell_when_steps_were():
    bench = Bench({5: 2 * TIMESTEP, 9: 1.1 * TIMESTEP, 12: 0.5 * TIMESTEP, 20: None})
    samples = list(bench_robot(bench).run(CONTROLLER, STEPS))
    moments = [sample.moment for sample in samples]

    assert isinstance(bench_robot(bench), TimedRobot)
    assert not isinstance(SimulatedRobot(QUADRUPED), TimedRobot)
    assert [sample.time for sample in samples] == [k * TIMESTEP for k in range(STEPS)]
    assert [k for k, moment in enumerate(moments) if moment.late] == [5, 12]
    assert [k for k, moment in enumerate(moments) if moment.missing] == [20]
    took = np.diff([moment.elapsed for moment in moments])
    np.testing.assert_allclose(took[[4, 8, 11, 15]] / TIMESTEP, [2, 1.1, 0.5, 1])


@pytest.mark.parametrize("nothing", [None, TimeoutError("too late"), observation(0, sensors=None)])
def test_the_controller_goes_on_with_the_readings_that_it_had(nothing: object):
    bench = Bench({7: nothing, 8: nothing})
    got = driven(bench)
    assert np.array_equal(np.array(bench.commands), got["commands"][:-1])
    held = got["sensors"].copy()
    assert np.isnan(held[7:9]).all()
    assert not np.isnan(held[[6, 9]]).any()
    held[7:9] = held[6]

    brain = make_batch([CONTROLLER], [frozenset()], len(NAMES.sensors))
    commands = np.empty((1, len(NAMES.motors)))
    for k in range(STEPS):
        brain.readings[0] = held[k]
        brain.step(commands)
        assert got["commands"][k].tobytes() == commands[0].tobytes()


def test_the_robot_is_made_safe_before_it_starts_and_when_it_is_done():
    bench = Bench()
    driven(bench, 3)
    assert bench.done == ["stop", "reset", "step", "step", "stop"]
    bench.done.clear()
    with closing(bench_robot(bench).run(CONTROLLER, STEPS)) as samples:
        next(samples)
        next(samples)
    assert bench.done == ["stop", "reset", "step", "stop"], "a caller that stops iterating"


def test_a_robot_that_cannot_be_read_at_the_start_is_not_driven():
    bench = Bench({0: None})
    with pytest.raises(TrialError, match=r"no reading of front_left_touch, .* at step 0"):
        driven(bench)
    assert bench.done == ["stop", "reset", "stop"]


def test_without_a_way_to_stop_the_safe_targets_are_stepped_to():
    bench = Bench()
    safe = np.linspace(-0.1, 0.1, len(NAMES.motors))
    physical = EnvironmentRobot(bench, QUADRUPED, safe=safe, clock=bench.clock)
    bench.step_number = 0
    list(physical.run(CONTROLLER, 3))

    assert bench.done == ["step", "reset", "step", "step", "step"]
    assert [np.array_equal(one, safe) for one in bench.commands] == [True, False, False, True]


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"safe": np.zeros(3)}, r"the safe targets must be .* of the 8 motors .* shape \(3,\)"),
        ({"env": load("hexapod", "walk")}, r"the environment's actions must be .* shape \(18,\)"),
    ],
)
def test_what_does_not_fit_the_robot_is_said_before_it_is_driven(
    options: dict[str, object], match: str
):
    with pytest.raises(InputError, match=match):
        EnvironmentRobot(**{"env": Bench(), "robot": QUADRUPED, **options})


@pytest.mark.parametrize(
    ("told", "match"),
    [
        (np.zeros(3), "a mapping by name, got a ndarray: give observe="),
        ({"position": np.zeros(3)}, "some of sensors, .*, got one of position: give observe="),
    ],
)
def test_an_observation_without_our_names_is_refused(told: object, match: str):
    with pytest.raises(InputError, match=match):
        driven(Bench({0: told}))


def test_an_observation_in_other_words_is_translated():
    def observe(told: dict[str, object]) -> dict[str, object]:
        return {"sensors": told["feel"]}

    happens = {k: {"feel": np.full(len(NAMES.sensors), 0.01 * k)} for k in range(STEPS)}
    got = driven(Bench(happens), observe=observe)

    assert got["sensors"][:, 0].tolist() == [0.01 * k for k in range(STEPS)]


def test_an_observation_that_comes_again_is_missing():
    happens: dict[int, object] = {k: observation(k, time=5 + k * TIMESTEP) for k in range(STEPS)}
    happens |= {11: observation(99, time=5 + 10 * TIMESTEP)}  # still that of step 10
    # Steps 20 and 22 do not have a time: a log cannot contain an infinite one.
    happens |= {20: observation(20), 22: observation(22, time=np.inf), 25: None}
    samples = list(bench_robot(Bench(happens)).run(CONTROLLER, STEPS))
    moments = [sample.moment for sample in samples]

    assert [k for k, moment in enumerate(moments) if moment.missing] == [11, 25]
    assert [k for k, moment in enumerate(moments) if moment.late] == [20, 22]
    assert np.isnan(samples[11].values["sensors"]).all()
    assert [k for k, moment in enumerate(moments) if np.isnan(moment.elapsed)] == [11, 20, 22, 25]


@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=30))
def test_a_step_is_late_exactly_where_its_time_is_off_by_more_than_the_tolerance(took: list[float]):
    timer, now = StepTimer(1.0, 0.25), 7.0
    assert not timer.update(now, {}).late
    for each in took:
        before, now = now, now + each
        moment = timer.update(now, {})
        if abs(abs(now - before - 1) - 0.25) > 1e-9:
            assert moment.late == (abs(now - before - 1) > 0.25)
        assert moment.elapsed == now - 7.0


def test_the_log_of_a_recovery_s_trial_has_the_timing_of_a_robot_with_a_clock(tmp_path: Path):
    run_trial = TrialRunner(tmp_path, QUADRUPED, Settings())
    bench = Bench({5: 2 * TIMESTEP, 8: None})
    trial = run_trial(bench_robot(bench), TrialPlan("00-before", "before", CONTROLLER, STEPS, 0))
    timing = read_log(trial.path).timing

    assert timing is not None
    assert np.flatnonzero(timing.late).tolist() == [5]
    assert np.flatnonzero(timing.missing).tolist() == [8]
    assert np.flatnonzero(trial.trajectory.late).tolist() == [5]
    assert isinstance(trial.plan.controller, Controller)
    assert np.isnan(command_errors(trial)[8:]).all()
    assert not np.any(command_errors(trial)[:8])
