"""Promises of an emergency: the safe command comes first, and the log is whole."""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError, TrialError
from selfmodel.logs import read_log
from selfmodel.logs.inspection import verify
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import TrialWriter, write_trial
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.interface import Limit, joint_limits, tilt_limit
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Sample
from selfmodel.trials.trial import TrialPlan
from tests.helpers.bench import (
    CONTROLLER,
    NAMES,
    QUADRUPED,
    STEPS,
    Bench,
    bench_robot,
    driven,
    logged,
    observation,
)


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
        "no reading of .* for more than 3 steps, at step 7",
    ),
    "joint": (
        {7: observation(7, joint_positions=ANGLES + 3.0)},
        {"limits": [joint_limits(QUADRUPED, 0.1)]},
        TrialError,
        "at step 7: front_left_shoulder is at 3.000, beyond its range of",
    ),
    "tilt": (
        {7: observation(7, base_orientation=leaning(1.2))},
        {"limits": [tilt_limit(1.1)]},
        TrialError,
        "at step 7: the base is tilted by 1.20 rad, more than 1.1 rad",
    ),
    "no rotation": (
        {7: observation(7, base_orientation=np.zeros(4))},
        {"limits": [tilt_limit(1.1)]},
        TrialError,
        "at step 7: base_orientation must be a unit quaternion, got the norm 0.00",
    ),
    "blind limit": (
        {k: observation(k, base_orientation=None) for k in range(4, 30)},
        {"limits": [tilt_limit(1.1)], "patience": 3},
        TrialError,
        r"base_orientation \(w, x, y, z\), which a limit requires, for more than 3 .* at step 7",
    ),
    "another robot": (
        {7: observation(7, sensors=[0.0])},
        {},
        InputError,
        r"expected sensors of shape \(8,\) in an observation, .* got the shape \(1,\)",
    ),
    "text": (
        {7: observation(7, sensors=["off"] * 8)},
        {},
        InputError,
        r"expected numbers of sensors in an observation: could not convert string to float",
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
    verified = verify(tmp_path / "trial.mcap")
    log = verified.log
    assert verified.model_loaded
    assert (log.status, log.trial.trajectory.steps, log.trial.plan.steps) == ("stopped", 7, STEPS)
    assert log.reason == f"{error.__name__}: {caught.value}".removesuffix(": ")


def test_limits_let_a_robot_within_them_go_on():
    happens = {k: observation(k, base_orientation=leaning(1.0)) for k in range(STEPS)}
    limits = [joint_limits(QUADRUPED, 0.1), tilt_limit(1.1)]

    critical = ["sensors", "base_orientation"]  # may be missing with all the rest
    assert driven(Bench(happens | {9: None}), limits=limits, critical=critical).steps == STEPS


@pytest.mark.parametrize(
    ("limit", "signal"),
    [
        (joint_limits(QUADRUPED, 0.1), "joint_positions"),
        (tilt_limit(1e-4), "base_orientation"),
        (Limit(("sensors",), lambda _: ""), "sensors"),
    ],
)
def test_a_robot_that_does_not_observe_what_a_limit_needs_is_not_driven(
    limit: Limit, signal: Signal
):
    bench = Bench({k: observation(k, **{signal: None}) for k in range(STEPS)})
    driver = Playback(NAMES.motors, np.zeros((5, len(NAMES.motors))))
    with pytest.raises(TrialError, match=r"no reading of .* at step 0"):
        list(bench_robot(bench, limits=[limit]).run(driver, STEPS))
    assert bench.done == ["stop", "reset", "stop"]


def test_an_episode_that_ends_too_soon_is_said_so(tmp_path: Path):
    bench = Bench(last=11)
    with pytest.raises(TrialError, match="ended its episode after 12 of 30 steps"):
        logged(bench, tmp_path)
    assert bench.done[-1] == "stop"
    assert read_log(tmp_path / "trial.mcap").trial.trajectory.steps == 12
    assert driven(Bench(last=STEPS - 1)).steps == STEPS


def test_a_writer_that_fails_stops_the_robot_before_it_closes_the_log(tmp_path: Path):
    bench = Bench()

    def samples() -> Iterator[Sample]:
        with closing(bench_robot(bench).run(CONTROLLER, STEPS)) as real:
            for k, sample in enumerate(real):
                yield dataclasses.replace(sample, time=-1.0) if k == 9 else sample

    plan = TrialPlan("trial", "single", CONTROLLER, STEPS, 0)
    with pytest.raises(InputError, match="step 9 of 30 is due"):
        write_trial(
            tmp_path / "trial.mcap", QUADRUPED, plan, samples(), TrialHeader(Settings(), timed=True)
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
    assert read_log(tmp_path / "trial.mcap").reason == (
        "TrialError: the environment failed: OSError: no route; "
        "the safe command could not be sent: OSError: nor to stop"
    )


def test_a_second_ctrl_c_does_not_keep_the_safe_command_from_the_robot():
    bench = Bench({7: KeyboardInterrupt()})
    sent, stop = [], failing(None, KeyboardInterrupt(), None)
    bench.stop = lambda: (stop(), sent.append(bench.done[-1:]))
    with pytest.raises(KeyboardInterrupt):
        driven(bench)
    assert sent == [[], ["step"]]


@pytest.mark.parametrize("ends", ["while the log is written", "while the robot is stopped"])
def test_ctrl_c_stays_ctrl_c_where_the_robot_cannot_be_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ends: str
):
    bench = Bench()
    if ends == "while the log is written":
        bench.stop = failing(None, OSError("nor to stop"))
        add = TrialWriter.add

        def interrupted(writer: TrialWriter, sample: Sample) -> None:
            add(writer, sample)
            if writer.steps == 9:
                raise KeyboardInterrupt

        monkeypatch.setattr(TrialWriter, "add", interrupted)
    else:
        bench.stop = failing(None, KeyboardInterrupt(), OSError("nor to stop"))
    with pytest.raises(KeyboardInterrupt) as caught:
        logged(bench, tmp_path)

    told = "the safe command could not be sent: OSError: nor to stop"
    assert caught.value.__notes__ == [told]
    assert read_log(tmp_path / "trial.mcap").reason == f"KeyboardInterrupt: {told}"


def test_without_safe_targets_they_are_those_nearest_to_zero():
    mjcf = QUADRUPED.mjcf.replace(
        '<position name="front_left_shoulder"',
        '<position ctrllimited="true" ctrlrange="0.25 0.75" name="front_left_shoulder"',
    )
    assert mjcf != QUADRUPED.mjcf
    bench = Bench()
    bench.happens = {1: TimeoutError("too late")}  # safe targets count as sent all the same
    physical = EnvironmentRobot(
        bench, Robot("raised", mjcf, QUADRUPED.control_timestep), clock=bench.clock
    )
    list(physical.run(CONTROLLER, 2))

    assert bench.commands[-1].tolist() == [0.25, *[0.0] * (len(NAMES.motors) - 1)]
