"""Watches of real recordings: a servo on a pendulum, and a Go2 on a stand.

The recordings are those of ``benchmarks.servo`` and ``benchmarks.go2``.
"""

import time
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import benchmarks.go2.__main__ as go2
import benchmarks.servo.__main__ as servo
from selfmodel import Robot, Trial, Watch
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.studies.study import Row
from selfmodel.trials.trajectory import samples_of


class Recording(NamedTuple):
    """What names a row, the robot, its healthy trials, and the trial that is watched."""

    key: Row
    robot: Robot
    healthy: list[Trial]
    trial: Trial


def recordings() -> Mapping[str, Recording]:
    """Returns the recordings by what names their rows."""
    return {str(one.key): one for one in (*_of_servo(), *_of_go2())}


def _of_servo() -> Iterator[Recording]:
    pendulum = load_mjcf(servo.PENDULUM, checked_settings({"control_timestep": 0.006}))
    healthy = {
        name: servo.trial_of(pendulum, f"kp800_{name}", servo.TORQUE_OFF.get(name))
        for name in servo.HEALTHY
    }
    for name, own in healthy.items():
        others = [trial for other, trial in healthy.items() if other != name]
        watched = {"healthy": own}
        if name in servo.HALF_GAIN:
            watched["gain 400 in place of 800"] = servo.trial_of(pendulum, f"kp400_{name}")
        if name in servo.TORQUE_OFF:
            truth = f"torque off at {servo.TORQUE_OFF[name]:.1f} s"
            watched[truth] = servo.trial_of(pendulum, f"kp800_{name}")
        for truth, trial in watched.items():
            yield Recording(
                _key(f"servo, {name}", truth, "other movements"), pendulum, others, trial
            )


def _of_go2() -> Iterator[Recording]:
    robot, half = go2.robot_on_stand(), go2.ALL // 2
    parts = {
        "first half": go2.trial_of(robot, 0, half),
        "second half": go2.trial_of(robot, half, go2.ALL),
    }
    for name, other in (tuple(parts), tuple(parts)[::-1]):
        yield Recording(_key(f"Go2, {name}", "healthy", other), robot, [parts[other]], parts[name])


def _key(name: str, truth: str, healthy: str) -> Row:
    return {"command": "recordings", "recording": name, "truth": truth, "healthy": healthy}


def watched(recording: Recording) -> Row:
    """Returns what a watch says of a recording, in plain words."""
    start = time.process_time()
    watch, rows = Watch(recording.robot, recording.healthy), recording.trial.trajectory
    fitted = time.process_time()
    findings = [one for step in samples_of(rows) for one in watch.update(step)]
    findings += watch.finish()
    return {
        "findings": [str(one).strip() for one in findings],
        "length": round(float(rows.time[-1]), 2),
        "seconds of the fit": round(fitted - start, 1),
        "seconds": round(time.process_time() - fitted, 2),
    }
