"""Example driver: a trial of a robot behind a TCP socket, at 50 control steps a second.

Usage: python examples/drive_a_robot.py HOST PORT TRIAL.mcap [--watchdog SECONDS]
"""

import argparse
import dataclasses
import socket
import struct
import sys
import time
from pathlib import Path

import dm_env
import numpy as np

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import InputError, TrialError, describe
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.physical.interface import joint_limits, tilt_limit
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import TrialPlan

OBSERVED: tuple[Signal, ...] = (
    *("sensors", "joint_positions", "joint_velocities", "base_position", "base_orientation"),
    *("base_linear_velocity", "base_angular_velocity"),
)
"""Signals of an observation, as float64 numbers in this order."""

START, STOP = 0, -1
"""Reserved message numbers; the targets of step k have the number k."""

SILENCE = 0.1
"""Seconds without an answer after which an observation is missing."""


# The driver begins here: the docs show it.
class SocketRobot(dm_env.Environment):
    """Sends numbered targets and waits for the observation with the same number."""

    def __init__(self, address: tuple[str, int], robot: Robot) -> None:
        self._address, self._motors = address, len(robot.anatomy.motors)
        self._widths = {signal: robot.anatomy.names.width(signal) for signal in OBSERVED}
        self._targets = struct.Struct(f"<q{self._motors}d")
        self._observed = struct.Struct(f"<q{sum(self._widths.values())}d")

    def reset(self) -> dm_env.TimeStep:
        """Moves the robot to its initial pose, at rest."""
        self._link = socket.create_connection(self._address, timeout=1.0)
        self._number, self._heard = START, b""
        return dm_env.restart(self._exchange(np.zeros(self._motors), silence=10.0))

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Sends the targets of a control step; the robot's own clock times its end."""
        self._number += 1
        return dm_env.transition(0.0, self._exchange(action, silence=SILENCE))

    def _exchange(self, targets: np.ndarray, silence: float) -> dict[str, np.ndarray]:
        self._link.settimeout(silence)
        self._link.sendall(self._targets.pack(self._number, *targets))
        until = time.monotonic() + silence
        number = None
        while number != self._number:  # an answer to an earlier step is skipped
            while len(self._heard) < self._observed.size:
                self._link.settimeout(max(until - time.monotonic(), 1e-3))
                if not (heard := self._link.recv(4096)):
                    raise ConnectionError("the robot closed the connection")
                self._heard += heard
            number, *values = self._observed.unpack(self._heard[: self._observed.size])
            self._heard = self._heard[self._observed.size :]
        ends = np.cumsum(list(self._widths.values()))
        return dict(zip(OBSERVED, np.split(np.array(values), ends[:-1]), strict=True))

    def stop(self) -> None:
        """Stops the robot, on a new connection: the old one may have failed."""
        with socket.create_connection(self._address, timeout=1.0) as link:
            link.sendall(self._targets.pack(STOP, *np.zeros(self._motors)))
            if not link.recv(1):  # acknowledgement
                raise ConnectionError("the robot closed the connection")

    def action_spec(self) -> dm_env.specs.Array:
        """Returns the spec of an action: motor targets, rad."""
        return dm_env.specs.Array((self._motors,), np.float64)

    def observation_spec(self) -> dict[str, dm_env.specs.Array]:
        """Returns the specs of an observation."""
        widths = self._widths.items()
        return {name: dm_env.specs.Array((width,), np.float64) for name, width in widths}


# The driver ends here.


def main(host: str, port: int, path: Path, watchdog: float | None) -> None:
    """Logs a trial of five seconds with a random controller."""
    robot = dataclasses.replace(ROBOTS["quadruped"].robot(), control_timestep=0.02)
    network = network_for(robot)
    genome = draw_genomes(np.random.default_rng(0), (network.weights,))
    plan = TrialPlan(path.stem, "single", Controller(network, genome), steps=250, seed=0)
    driver = SocketRobot((host, port), robot)
    try:
        physical = EnvironmentRobot(
            driver,
            robot,
            stop=driver.stop,
            limits=[joint_limits(robot, 0.2), tilt_limit(1.0)],
            watchdog=watchdog,
        )
        samples = physical.run(plan.controller, plan.steps)
        write_trial(path, robot, plan, samples, TrialHeader(Settings(), timed=True))
    except InputError as error:
        sys.exit(describe(error))
    except TrialError as error:
        kept = f"what was observed until then is in {path}" if path.exists() else "there is no log"
        sys.exit(f"{describe(error)}; {kept}")
    print(f"{plan.steps} steps: {path}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Logs a trial of a robot behind a socket.")
    parser.add_argument("host")
    parser.add_argument("port", type=int)
    parser.add_argument("path", type=Path, metavar="TRIAL.mcap")
    parser.add_argument(
        "--watchdog", type=float, metavar="SECONDS", help="time limit of each reset and step"
    )
    given = parser.parse_args()
    main(given.host, given.port, given.path, given.watchdog)
