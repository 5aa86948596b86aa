"""Short predictions from logged states, under the commands that were logged."""

from collections.abc import Sequence
from time import perf_counter

import mujoco
import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.errors import InputError
from selfmodel.robot.custom_numerics import MAX_CONTROL_DELAY
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.robot.state_access import state_writer
from selfmodel.simulation.activations import starting_activations
from selfmodel.simulation.batch import LiveBatch, live_signals, new_batch, silence_mujoco_warnings
from selfmodel.simulation.outcome import SimulationResult, SimulationStats
from selfmodel.simulation.requests import Segments
from selfmodel.trials.behaviour import Behaviour


def predict(
    robot: Robot,
    embodiments: Sequence[Embodiment],
    segments: Segments,
    *,
    moves_as: Sequence[int] | None = None,
    threads: int,
    stats: SimulationStats,
    delay: int | None = None,
) -> SimulationResult:
    """Predicts segments of a trial with each of some models of a robot.

    Where the segments say the whole state, all of them are simulated side by side. Where they do
    not say where the base is and how fast, each begins there where the one before it ended: what
    was logged is put into one long simulation again and again.

    What an embodiment holds still, such as a jammed joint, begins where it is held. Nothing moves
    the hinges of a lost limb: where the segments say angles, they begin at rest, at their median
    angle over all segments.

    Args:
        robot: The robot with nothing wrong.
        embodiments: At least one, of the robot's layout.
        segments: Where to begin and what was commanded.
        moves_as: For each embodiment the number of the first one that moves as it does under the
            same commands, though its sensors may tell another story: only that one is simulated.
            Without it, all are.
        threads: Threads that MuJoCo steps on, the caller's included.
        stats: Is told what was simulated.
        delay: Control steps from a command to its effect; that of the robot if none is given.

    Returns:
        Signals of ``(n, segments, horizon + 1, width)``; a run has diverged if any of its segments
        has.

    Raises:
        InputError: The segments do not say the commands that are still on their way.
    """
    late = robot.control_delay if delay is None else delay
    if segments.lead < late:
        raise InputError(
            f"the robot's commands take effect {late} steps late, and segments have "
            f"{segments.lead} from before they begin: a comparator needs a lead of "
            f"{MAX_CONTROL_DELAY}"
        )
    n, count, horizon = len(embodiments), len(segments.commands), segments.horizon
    simulated, source_of = np.unique(
        np.arange(n) if moves_as is None else np.asarray(moves_as), return_inverse=True
    )
    moving = [embodiments[i] for i in simulated]
    whole = "base_position" in segments.states
    stages: list[IndexArray] = np.split(np.arange(count), 1 if whole else count)
    together = len(stages[0])
    bodies = _repeated(moving, together)
    batch = new_batch(robot.model, bodies, threads)
    qpos, sensordata = batch.bind("qpos"), batch.bind("sensordata")
    # Noise of its own for each segment: of a few numbers nobody sees how much there is.
    senses = SensorReader(robot.model, robot.anatomy, embodiments, together)
    readings = np.empty((n * together, len(robot.anatomy.sensors)))
    # Where in the batch each row of the result is found.
    place = (source_of[:, np.newaxis] * together + np.arange(together)).ravel()
    live = live_signals(robot, batch, bodies, segments.record)
    kept = {
        signal: np.empty(
            (n, count, horizon + 1, robot.anatomy.names.width(signal)), dtype=np.float64
        )
        for signal in segments.record
    }
    start = _Start(robot, batch, moving, segments)
    activations = starting_activations(robot, segments, late)
    batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
    alive = LiveBatch(batch)
    first = segments.lead - late
    with silence_mujoco_warnings():
        for stage in stages:
            start.write(activations, stage)
            clock = perf_counter()
            alive.forward()
            stats.physics_seconds += perf_counter() - clock
            for k in range(horizon + 1):
                if "sensors" in kept:
                    senses.read(sensordata[place], qpos[place], readings)
                    kept["sensors"][:, stage, k] = readings.reshape(n, together, -1)
                for signal, read in live.items():
                    kept[signal][:, stage, k] = read()[place].reshape(n, together, -1)
                if k < horizon:
                    start.command(segments.commands[stage, first + k])
                    clock = perf_counter()
                    alive.step(robot.substeps)
                    stats.physics_seconds += perf_counter() - clock
    diverged: BoolArray = np.any(alive.diverged()[place].reshape(n, together), axis=1)
    stats.runs += n
    stats.steps += len(moving) * count * horizon
    stats.diverged += int(diverged.sum())
    time = np.arange(horizon + 1, dtype=np.float64) * robot.control_timestep
    return SimulationResult(Behaviour(robot.anatomy.names, time, kept), diverged)


def _repeated(embodiments: Sequence[Embodiment], times: int) -> list[Embodiment]:
    return [embodiment for embodiment in embodiments for _ in range(times)]


class _Start:
    """Writes logged states and commands into a batch, the same for each of the embodiments."""

    def __init__(
        self,
        robot: Robot,
        batch: mujoco.batch.Batch,
        embodiments: Sequence[Embodiment],
        segments: Segments,
    ) -> None:
        self._segments = segments
        self._n = len(embodiments)
        models = [one.model for one in embodiments for _ in range(batch.nsim // len(embodiments))]
        self._write = state_writer(robot, batch.bind, *models)
        self._ctrl = batch.bind("ctrl")
        self._act = batch.bind("act")
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        resting = _resting(robot, segments)
        self._still = [
            (number, *still)
            for number, one in enumerate(embodiments)
            for still in (*one.welded, *(resting[name] for name in one.detached & resting.keys()))
        ]

    def write(self, activations: FloatArray, stage: IndexArray) -> None:
        """Begins the segments of these numbers."""
        states = self._segments.states
        self._write({signal: self._for_all(values[stage]) for signal, values in states.items()})
        self._act[:] = self._for_all(activations[stage])
        for number, position, velocity, angle in self._still:
            mine = slice(number * len(stage), (number + 1) * len(stage))
            self._qpos[mine, position] = angle
            self._qvel[mine, velocity] = 0.0

    def command(self, commands: FloatArray) -> None:
        """Gives the commands of one step, ``(segments, motors)``."""
        self._ctrl[:] = self._for_all(commands)

    def _for_all(self, values: FloatArray) -> FloatArray:
        return np.tile(values, (self._n, 1))


def _resting(robot: Robot, segments: Segments) -> dict[str, tuple[int, int, float]]:
    """Of each hinge whose angle is known its places in the state and its median angle."""
    angles = segments.states.get("joint_positions")
    if angles is None:
        return {}
    hinges = [robot.model.joint(name) for name in robot.anatomy.hinges]
    return {
        hinge.name: (int(hinge.qposadr[0]), int(hinge.dofadr[0]), angle)
        for hinge, angle in zip(hinges, np.median(angles, axis=0).tolist(), strict=True)
    }
