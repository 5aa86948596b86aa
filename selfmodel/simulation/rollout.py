"""Closed-loop rollouts of a robot, one control step at a time.

The simulator and the simulated physical robot step the same rollout, so that the robot equals the
simulator's to the bit.
"""

from collections.abc import Callable, Iterator, Sequence
from time import perf_counter

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.controllers.controller import CommandSource, make_batch
from selfmodel.robot.control_delay import added_steps, split_delay
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.simulation.batch import LiveBatch, SimulationStats, live_signals, new_batch
from selfmodel.trials.signals import Signal


class Rollout:
    """Closed-loop rollouts of a batch of robots of one layout.

    Args:
        robot: The robot as its model describes it.
        embodiments: The robot of each rollout, with its faults.
        drivers: Source of the commands of each rollout.
        record: Signals that ``live`` reads.
        threads: Threads of the physics.
        stats: Statistics that are updated.
        start: Initial generalised positions, ``(n, nq)``; None for the reference pose.
        disturb: Changes the readings of each step before the controllers receive them,
            ``(n, sensors)``.
        added_delay: Control delay in addition to that of the robot and its faults, control steps.

    Attributes:
        live: Function that reads each recorded signal, ``(n, width)``. The arrays change with the
            next step.

    Raises:
        InputError: MuJoCo cannot simulate the models, such as for lack of memory.
    """

    def __init__(
        self,
        robot: Robot,
        embodiments: Sequence[Embodiment],
        drivers: Sequence[CommandSource],
        record: Sequence[Signal],
        *,
        threads: int = 1,
        stats: SimulationStats | None = None,
        start: FloatArray | None = None,
        disturb: Callable[[FloatArray], None] = lambda _: None,
        added_delay: int = 0,
    ) -> None:
        self._stats = SimulationStats() if stats is None else stats
        self._substeps, self._disturb = robot.substeps, disturb
        model = embodiments[0].model
        batch = new_batch(model, embodiments, threads)
        self._reader = SensorReader(model, robot.anatomy, embodiments)
        self._controllers = make_batch(
            drivers,
            [embodiment.silent_neurons for embodiment in embodiments],
            len(robot.anatomy.sensors),
        )
        self._sensordata, self._qpos = batch.bind("sensordata"), batch.bind("qpos")
        whole, self._part = split_delay(robot.control_delay, robot.substeps)
        added = [
            added_delay + added_steps(robot.control_delay, float(embodiment.added_delay[0]))
            for embodiment in embodiments
        ]
        delays = whole + bool(self._part) + np.array(added, dtype=np.intp)
        self._motors = _DelayLine(batch.bind("ctrl"), delays)
        self.live: dict[Signal, Callable[[], FloatArray]] = {
            **live_signals(robot, batch.bind, embodiments, record),
            "sensors": lambda: self._controllers.readings,
            # Those of the controllers, before the control delay.
            "commands": lambda: self._motors.inlet,
        }
        # After all bindings: a field that is bound later remains zero until the next step.
        self._batch = LiveBatch(batch)
        if start is None:
            self._batch.reset(mujoco.mjtStage.mjSTAGE_ACC)
        else:
            self._batch.reset(mujoco.mjtStage.mjSTAGE_NONE)
            self._qpos[:] = start
            self._batch.forward()

    def steps(self, count: int) -> Iterator[int]:
        """Yields the number of each control step, whose signals can be read until the next one."""
        for k in range(count):
            if k:
                clock = perf_counter()
                if self._part:
                    self._batch.step(self._part)
                    self._motors.release()
                self._batch.step(self._substeps - self._part)
                self._stats.physics_seconds += perf_counter() - clock
            self._reader.read(self._sensordata, self._qpos, self._controllers.readings)
            self._disturb(self._controllers.readings)
            self._controllers.step(self._motors.inlet)
            self._motors.advance()
            self._stats.steps += self._batch.running
            yield k

    def diverged(self) -> BoolArray:
        """Returns a mask of the rollouts that have diverged or had a MuJoCo warning, ``(n,)``."""
        return self._batch.diverged()


class _DelayLine:
    """Delay line of the commands; the motors' commands are 0 until the first arrives.

    Args:
        outlet: Commands at the motors, ``(n, motors)``; written.
        delays: Control delay of each run, control steps, rounded up, ``(n,)``.
    """

    def __init__(self, outlet: FloatArray, delays: IndexArray) -> None:
        self._outlet, self._delays = outlet, delays
        longest = int(delays.max())
        self._line = np.zeros((longest + 1, *outlet.shape))
        self._rows = np.arange(len(outlet))
        self._step = 0
        self._delayed = longest > 0
        self.inlet = np.zeros(outlet.shape) if self._delayed else outlet
        """Next commands, ``(n, motors)``; the outlet itself without a delay."""

    def advance(self) -> None:
        """Moves the commands of the inlet into the line, and the delayed ones to the outlet."""
        if self._delayed:
            self._step += 1
            self._line[self._step % len(self._line)] = self.inlet
            self._send(self._delays)

    def release(self) -> None:
        """Moves those commands to the outlet that would be there a step later."""
        self._send(self._delays - 1)

    def _send(self, delays: IndexArray) -> None:
        self._outlet[:] = self._line[(self._step - delays) % len(self._line), self._rows]
