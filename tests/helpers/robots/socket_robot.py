"""A simulated robot in a process of its own, behind a TCP socket: what a driver is tested with.

It moves in real time, one control time step a message, and answers each with what it observes then.
Usage: ``python -m tests.helpers.robots.socket_robot HEARD [FAILURES]``. The process prints its
port, and writes the number of each message that it receives into a file, one a line, before it does
anything else.
"""

import dataclasses
import json
import os
import socketserver
import struct
import sys
import threading
import time
from pathlib import Path

import numpy as np

from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS
from selfmodel.tasks.walking import environment, motion_capture

TIMESTEP = 0.02
OBSERVED = (
    *("sensors", "joint_positions", "joint_velocities", "base_position", "base_orientation"),
    *("base_linear_velocity", "base_angular_velocity"),
)
START, STOP = 0, -1


def slow_quadruped() -> Robot:
    """The quadruped, commanded 50 times a second."""
    return dataclasses.replace(ROBOTS["quadruped"].robot(), control_timestep=TIMESTEP)


class Body:
    """The simulated robot, and what is to go wrong with the link to it.

    Args:
        heard: The file of what it hears.
        failures: By the number of a message, as text: seconds by which the answer is late;
            "silent" for none; "hang up" for the connection to be closed; "die" for the process to
            end.
    """

    def __init__(self, heard: Path, failures: dict[str, float | str]) -> None:
        self._heard, self._failures = heard, failures
        self._env = environment(slow_quadruped(), time_limit=1e3)
        self._observe = motion_capture(self._env)
        self._lock = threading.Lock()  # a stop comes by another connection

    def hear(self, number: int) -> None:
        """Notes a message."""
        with self._heard.open("a") as file:
            file.write(f"{number}\n")

    def answer(self, number: int, targets: np.ndarray) -> bytes | None:
        """Follows targets for a control time step; None for no answer."""
        began = time.monotonic()
        with self._lock:
            step = self._env.reset() if number == START else self._env.step(targets)
            seen = self._observe(step.observation)
        values = np.concatenate([seen[name] for name in OBSERVED])
        failure = self._failures.get(str(number), 0.0)
        if failure == "hang up":
            raise ConnectionAbortedError
        if failure == "die":
            os._exit(1)
        if failure == "silent":
            return None
        time.sleep(max(0.0, began + TIMESTEP + float(failure) - time.monotonic()))
        return struct.pack(f"<q{len(values)}d", number, *values)


def serve(body: Body) -> None:
    """Serves one connection after or beside another until the process ends."""
    motors = len(slow_quadruped().anatomy.motors)
    targets = struct.Struct(f"<q{motors}d")

    class Connection(socketserver.StreamRequestHandler):
        disable_nagle_algorithm = True

        def handle(self) -> None:
            while len(message := self.rfile.read(targets.size)) == targets.size:
                number, *values = targets.unpack(message)
                body.hear(number)
                try:
                    told = b"!" if number == STOP else body.answer(number, np.array(values))
                except ConnectionAbortedError:
                    return
                self.wfile.write(told or b"")

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Connection) as server:
        server.daemon_threads = True
        sys.stdout.write(f"{server.server_address[1]}\n")
        sys.stdout.flush()
        server.serve_forever()


if __name__ == "__main__":
    serve(Body(Path(sys.argv[1]), json.loads(sys.argv[2]) if len(sys.argv) > 2 else {}))
