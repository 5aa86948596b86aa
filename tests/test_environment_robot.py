"""Promises of driving any environment: the same robot, marks of its clock, and the way it stops."""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import dm_env
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selfmodel.behaviour import SIGNALS, Behaviour, Sample, collect
from selfmodel.comparators.arithmetic import command_errors
from selfmodel.controller import Controller, Population
from selfmodel.environment_robot import EnvironmentRobot
from selfmodel.errors import InputError, TrialError
from selfmodel.limits import joint_limits, tilt_limit
from selfmodel.logs import read_log
from selfmodel.logs.journal import open_journal
from selfmodel.logs.verify import verify
from selfmodel.logs.writer import write_trial
from selfmodel.notation import parse
from selfmodel.physical import SimulatedRobot, Timed
from selfmodel.playback import Playback
from selfmodel.robot import Robot
from selfmodel.settings import Settings
from selfmodel.stopwatch import Stopwatch
from selfmodel.tasks import ROBOTS, load
from selfmodel.tasks.walking import motion_capture
from selfmodel.trial import Plan
from tests.conftest import random_controllers

STEPS = 30
QUADRUPED = ROBOTS["quadruped"].robot()
(CONTROLLER,) = random_controllers(QUADRUPED, 1)
NAMES = QUADRUPED.anatomy.names
TIMESTEP = QUADRUPED.control_timestep


class Bench(dm_env.Environment):
    """A robot on a bench: what it observes at each step is made up, and so is its clock.

    Args:
        happens: By step what is other than usual: an observation, None, an exception to raise, or
            the seconds that the step takes.
    """

    def __init__(self, happens: dict[int, object] | None = None, last: int = 10**9) -> None:
        self.happens, self.last = happens or {}, last
        self.now, self.done = 100.0, []
        self.commands: list[np.ndarray] = []

    def reset(self) -> dm_env.TimeStep:
        """Observes step 0."""
        self.done.append("reset")
        self.step_number = 0
        return dm_env.restart(self._observe())

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Observes the next step."""
        self.done.append("step")
        self.commands.append(action)
        self.step_number += 1
        make = dm_env.termination if self.step_number == self.last else dm_env.transition
        return make(0.0, self._observe())

    def stop(self) -> None:
        """Is the safe command."""
        self.done.append("stop")

    def clock(self) -> float:
        """Tells the made-up time."""
        return self.now

    def _observe(self) -> object:
        happens = self.happens.get(self.step_number, TIMESTEP)
        if isinstance(happens, BaseException):
            raise happens
        self.now += happens if isinstance(happens, float) else TIMESTEP
        return observation(self.step_number) if isinstance(happens, float) else happens

    def action_spec(self) -> dm_env.specs.Array:
        """Returns that of the quadruped."""
        return dm_env.specs.Array((len(NAMES.motors),), float)

    def observation_spec(self) -> dict[str, dm_env.specs.Array]:
        """Returns nothing: nobody asks."""
        return {}


def observation(step: int, **changed: object) -> dict[str, object]:
    """An observation of which no two are alike."""
    rng = np.random.default_rng(step)
    rows = {signal: rng.uniform(-0.2, 0.2, NAMES.width(signal)) for signal in SIGNALS[2:]}
    rows["sensors"] = rng.uniform(-1, 1, len(NAMES.sensors))
    return rows | changed


def bench_robot(bench: Bench, **options: object) -> EnvironmentRobot:
    return EnvironmentRobot(bench, QUADRUPED, stop=bench.stop, clock=bench.clock, **options)


def driven(bench: Bench, steps: int = STEPS, **options: object) -> Behaviour:
    return collect(NAMES, bench_robot(bench, **options).run(CONTROLLER, steps))


def logged(bench: Bench, folder: Path, steps: int = STEPS, **options: object) -> Path:
    physical = bench_robot(bench, **options)
    return write_trial(
        folder / "trial.mcap",
        QUADRUPED,
        Plan("trial", "single", CONTROLLER, steps, 0),
        physical.run(CONTROLLER, steps),
        timed=True,
        settings=Settings(),
    )


@pytest.mark.parametrize("text", ["intact", "break:{0}", "sensor:{1}+friction=0.5"])
def test_our_own_tasks_give_the_simulated_robots_trial_to_the_bit(robot: Robot, text: str):
    anatomy = robot.anatomy
    text = text.format(anatomy.joints[0].name, anatomy.sensors[-1].name)
    env = load(robot.name, "walk", {"hypothesis": text})
    driver = random_controllers(robot, 1)[0]
    physical = EnvironmentRobot(env, robot, observe=motion_capture(env))
    for _ in range(2):  # again on the same environment
        got = collect(anatomy.names, physical.run(driver, 100))
        expected = collect(
            anatomy.names, SimulatedRobot(robot, parse(text, anatomy)).run(driver, 100)
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


def test_only_a_robot_with_a_clock_of_its_own_is_timed():
    assert isinstance(bench_robot(Bench()), Timed)
    assert not isinstance(SimulatedRobot(QUADRUPED), Timed)


def test_times_are_those_aimed_at_and_marks_tell_when_steps_were():
    bench = Bench({5: 2 * TIMESTEP, 9: 1.1 * TIMESTEP, 12: 0.5 * TIMESTEP, 20: None})
    samples = list(bench_robot(bench).run(CONTROLLER, STEPS))
    moments = [sample.moment for sample in samples]

    assert [sample.time for sample in samples] == [k * TIMESTEP for k in range(STEPS)]
    assert [k for k, moment in enumerate(moments) if moment.late] == [5, 12]
    assert [k for k, moment in enumerate(moments) if moment.missing] == [20]
    took = np.diff([moment.elapsed for moment in moments])
    np.testing.assert_allclose(took[[4, 8, 11, 15]] / TIMESTEP, [2, 1.1, 0.5, 1])


@pytest.mark.parametrize("nothing", [None, TimeoutError("too late"), observation(0, sensors=None)])
def test_the_controller_goes_on_with_the_readings_that_it_had(nothing: object):
    got = driven(Bench({7: nothing, 8: nothing}))
    held = got["sensors"].copy()
    assert np.isnan(held[7:9]).all()
    assert not np.isnan(held[[6, 9]]).any()
    held[7:9] = held[6]

    brain, commands = Population([CONTROLLER], np.ones((1, 3))), np.empty((1, len(NAMES.motors)))
    for k in range(STEPS):
        brain.readings[0] = held[k]
        brain.step(commands)
        assert got["commands"][k].tobytes() == commands[0].tobytes()


def test_one_reading_that_is_missing_is_held_while_the_others_go_on():
    sensors = np.array(observation(7)["sensors"])
    sensors[2] = np.nan
    samples = list(bench_robot(Bench({7: observation(7, sensors=sensors)})).run(CONTROLLER, 10))

    assert np.flatnonzero(np.isnan(samples[7].values["sensors"])).tolist() == [2]
    assert not samples[7].moment.missing


def test_every_target_reaches_the_environment_in_order():
    bench = Bench()
    got = driven(bench)

    assert np.array_equal(np.array(bench.commands), got["commands"][:-1])


def test_the_robot_is_made_safe_before_it_starts_and_when_it_is_done():
    bench = Bench()
    driven(bench, 3)
    assert bench.done == ["stop", "reset", "step", "step", "stop"]


def test_a_caller_that_stops_iterating_stops_the_robot():
    bench = Bench()
    with closing(bench_robot(bench).run(CONTROLLER, STEPS)) as samples:
        next(samples)
        next(samples)
    assert bench.done == ["stop", "reset", "step", "stop"]


def leaning(angle: float) -> list[float]:
    return [np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0]


SENSORS = np.zeros(len(NAMES.sensors))
ANGLES = np.zeros(len(NAMES.hinges))
EMERGENCIES: dict[str, tuple[dict[int, object], dict[str, object], type[BaseException], str]] = {
    "exception": ({7: OSError("no route")}, {}, TrialError, "environment failed: OSError: no rou"),
    "ctrl-c": ({7: KeyboardInterrupt()}, {}, KeyboardInterrupt, "^$"),
    "infinite": (
        {7: observation(7, sensors=SENSORS + np.inf)},
        {},
        TrialError,
        "sensors is infinite at step 7",
    ),
    "critical": (
        {7: observation(7, base_orientation=[1.0, 0.0, 0.0, np.nan])},
        {"critical": ["base_orientation"]},
        TrialError,
        "base_orientation is not a number at step 7",
    ),
    "silence": (
        dict.fromkeys(range(4, 30)),
        {"patience": 3},
        TrialError,
        "nothing was read of .* for more than 3 steps, at step 7",
    ),
    "joint": (
        {7: observation(7, joint_positions=ANGLES + 3.0)},
        {"limits": [joint_limits(QUADRUPED, 0.1)]},
        TrialError,
        "at step 7: front_left_shoulder is at 3.000 rad, beyond its range of",
    ),
    "tilt": (
        {7: observation(7, base_orientation=leaning(1.2))},
        {"limits": [tilt_limit(1.1)]},
        TrialError,
        "at step 7: it leans by 1.20 rad, more than 1.1 rad",
    ),
    "another robot": (
        {7: observation(7, sensors=[0.0])},
        {},
        InputError,
        r"expected sensors of shape \(8,\) in an observation, .* got the shape \(1,\)",
    ),
}


@pytest.mark.parametrize("kind", EMERGENCIES)
def test_an_emergency_stops_the_robot_first_and_leaves_a_whole_log(tmp_path: Path, kind: str):
    happens, options, error, match = EMERGENCIES[kind]
    bench = Bench(happens)
    finished: list[bool] = []
    stop = bench.stop
    bench.stop = lambda: (stop(), finished.append((tmp_path / "trial.mcap").exists()))
    with pytest.raises(error, match=match) as caught:
        logged(bench, tmp_path, **options)

    assert bench.done[-1] == "stop"
    assert bench.done.count("stop") == 2
    assert finished == [False, False]
    assert [path.name for path in tmp_path.iterdir()] == ["trial.mcap"]
    log, loaded = verify(tmp_path / "trial.mcap")
    assert loaded
    assert (log.status, log.trial.behaviour.steps, log.trial.plan.steps) == ("stopped", 7, STEPS)
    assert log.reason == f"{error.__name__}: {caught.value}".removesuffix(": ")


def test_limits_let_a_robot_within_them_go_on():
    happens = {k: observation(k, base_orientation=leaning(1.0)) for k in range(STEPS)}
    limits = [joint_limits(QUADRUPED, 0.1), tilt_limit(1.1)]

    assert driven(Bench(happens | {9: None}), limits=limits).steps == STEPS


def test_an_episode_that_ends_too_soon_is_said_so(tmp_path: Path):
    bench = Bench(last=11)
    with pytest.raises(TrialError, match="ended its episode after 12 of 30 steps"):
        logged(bench, tmp_path)
    assert bench.done[-1] == "stop"
    assert read_log(tmp_path / "trial.mcap").trial.behaviour.steps == 12
    assert driven(Bench(last=STEPS - 1)).steps == STEPS


def test_a_writer_that_fails_stops_the_robot_before_it_closes_the_log(tmp_path: Path):
    bench = Bench()

    def samples() -> Iterator[Sample]:
        with closing(bench_robot(bench).run(CONTROLLER, STEPS)) as real:
            for k, sample in enumerate(real):
                yield dataclasses.replace(sample, time=-1.0) if k == 9 else sample

    plan = Plan("trial", "single", CONTROLLER, STEPS, 0)
    with pytest.raises(InputError, match="step 9 of 30 is due"):
        write_trial(
            tmp_path / "trial.mcap", QUADRUPED, plan, samples(), timed=True, settings=Settings()
        )
    assert bench.done[-1] == "stop"
    assert read_log(tmp_path / "trial.mcap").status == "stopped"


def failing(*results: BaseException | None) -> Callable[[], None]:
    rest = iter(results)

    def stop() -> None:
        if (result := next(rest)) is not None:
            raise result

    return stop


def test_a_safe_command_that_fails_is_told_beside_what_ended_the_trial(tmp_path: Path):
    bench = Bench({7: OSError("no route")})
    bench.stop = failing(None, OSError("nor to stop"))
    with pytest.raises(TrialError, match="no route") as caught:
        logged(bench, tmp_path)
    assert caught.value.__notes__ == ["the safe command could not be sent: OSError: nor to stop"]


def test_a_safe_command_that_fails_at_the_end_is_an_error(tmp_path: Path):
    bench = Bench()
    bench.stop = failing(None, OSError("nor to stop"))
    with pytest.raises(TrialError, match="the safe command could not be sent"):
        logged(bench, tmp_path)
    log = read_log(tmp_path / "trial.mcap")
    assert (log.status, log.trial.behaviour.steps) == ("stopped", STEPS)
    assert "the safe command could not be sent" in log.reason


def test_a_second_ctrl_c_does_not_keep_the_safe_command_from_the_robot():
    bench = Bench({7: KeyboardInterrupt()})
    sent = []
    results = iter([None, KeyboardInterrupt(), None])

    def stop() -> None:
        if (result := next(results)) is not None:
            raise result
        sent.append(bench.done[-1] if bench.done else "")

    bench.stop = stop
    with pytest.raises(KeyboardInterrupt):
        driven(bench)
    assert sent == ["", "step"]


def test_a_robot_that_cannot_be_read_at_the_start_is_not_driven():
    bench = Bench({0: None})
    with pytest.raises(TrialError, match=r"nothing was read of front_left_touch, .* at step 0"):
        driven(bench)
    assert bench.done == ["stop", "reset", "stop"]


def test_what_needs_no_readings_is_driven_without():
    blind = {k: observation(k, sensors=None) for k in range(STEPS)}
    driver = Playback(NAMES.motors, np.zeros((5, len(NAMES.motors))))

    assert len(list(bench_robot(Bench(blind)).run(driver, STEPS))) == STEPS


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

    happens = {k: {"feel": SENSORS + 0.01 * k} for k in range(STEPS)}
    got = driven(Bench(happens), observe=observe)

    assert got["sensors"][:, 0].tolist() == [0.01 * k for k in range(STEPS)]


def test_an_observation_that_comes_again_is_missing():
    happens: dict[int, object] = {k: observation(k, time=5 + k * TIMESTEP) for k in range(STEPS)}
    happens |= {11: observation(99, time=5 + 10 * TIMESTEP)}  # still that of step 10
    happens |= {20: observation(20), 25: None}  # it does not say when
    samples = list(bench_robot(Bench(happens)).run(CONTROLLER, STEPS))
    moments = [sample.moment for sample in samples]

    assert [k for k, moment in enumerate(moments) if moment.missing] == [11, 25]
    assert [k for k, moment in enumerate(moments) if moment.late] == [20]
    assert np.isnan(samples[11].values["sensors"]).all()
    assert [k for k, moment in enumerate(moments) if np.isnan(moment.elapsed)] == [11, 20, 25]


@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=30))
def test_a_step_is_late_exactly_where_its_time_is_off_by_more_than_the_tolerance(
    took: list[float],
):
    watch, now = Stopwatch(1.0, 0.25), 7.0
    assert not watch.look(now, {}).late
    for each in took:
        before, now = now, now + each
        moment = watch.look(now, {})
        if abs(abs(now - before - 1) - 0.25) > 1e-9:
            assert moment.late == (abs(now - before - 1) > 0.25)
        assert moment.elapsed == now - 7.0


def test_a_recovery_s_journal_keeps_the_clock_of_a_robot_that_has_one(tmp_path: Path):
    journal = open_journal(tmp_path / "run", QUADRUPED, Settings(), {})
    bench = Bench({5: 2 * TIMESTEP, 8: None})
    trial = journal.record(bench_robot(bench), Plan("00-before", "before", CONTROLLER, STEPS, 0))
    timing = read_log(trial.path).timing

    assert timing is not None
    assert np.flatnonzero(timing.late).tolist() == [5]
    assert np.flatnonzero(timing.missing).tolist() == [8]
    assert np.flatnonzero(trial.behaviour.late).tolist() == [5]
    assert isinstance(trial.plan.controller, Controller)
    assert np.isnan(command_errors(trial)[8:]).all()
    assert not np.any(command_errors(trial)[:8])
