"""Batches of MuJoCo simulations that continue when some of them diverge; results and memory."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.isolation import available_memory
from selfmodel.robot.base import Bind, Reader
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import observed_fields
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal


@dataclass
class SimulationStats:
    """Cumulative statistics of a simulator.

    Attributes:
        runs: Number of simulations.
        steps: Number of control steps, over all simulations.
        diverged: Number of simulations that diverged or had a MuJoCo warning.
        physics_seconds: Wall time of MuJoCo's steps, s.
    """

    runs: int = 0
    steps: int = 0
    diverged: int = 0
    physics_seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """Result of a batch of runs.

    Attributes:
        behaviour: The recorded signals, with a leading axis of ``n``.
        diverged: Mask of the runs that diverged, ``(n,)``; their signals are invalid.
    """

    behaviour: Behaviour
    diverged: BoolArray

    def grouped(self, *shape: int) -> "SimulationResult":
        """Returns the result with its axis of runs, ``(n,)``, reshaped in row-major order."""
        flat = self.behaviour
        signals = {
            signal: values.reshape(*shape, *values.shape[1:])
            for signal, values in flat.signals.items()
        }
        return SimulationResult(
            Behaviour(flat.names, flat.time, signals), np.asarray(self.diverged.reshape(shape))
        )


def new_batch(model: mujoco.MjModel, embodiments: Sequence[Embodiment], threads: int) -> Batch:
    """Returns a batch with one simulation per embodiment.

    Raises:
        InputError: MuJoCo cannot simulate the models, such as for lack of memory.
    """
    with mujoco_errors_as_input_errors("simulate the model"):
        batch = Batch(model, len(embodiments), nthread=threads)
        batch.set_models([embodiment.model for embodiment in embodiments])
    return batch


def live_signals(
    robot: Robot, bind: Bind, embodiments: Sequence[Embodiment], record: Sequence[Signal]
) -> dict[Signal, Reader]:
    """Returns functions that read the current values of recorded signals from fields of a batch.

    The readings and the commands of the controllers are not part of MuJoCo's state, and are
    omitted.
    """
    state = observed_fields(robot, embodiments)
    return {
        signal: state[signal].reader(bind)
        for signal in record
        if signal not in ("sensors", "commands")
    }


class LiveBatch:
    """Batch that steps only the simulations that have no MuJoCo error.

    It records divergence: a simulation with a warning is recorded as diverged, so its users do not
    count MuJoCo's warnings.

    MuJoCo resets a simulation with a warning, which continues to be stepped: its values are
    invalid, but the simulations of a batch are independent.
    """

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self._ids: IndexArray | None = None
        self._failed = np.zeros(batch.nsim, dtype=bool)

    @property
    def running(self) -> int:
        """Number of simulations that are stepped."""
        return self._batch.nsim if self._ids is None else len(self._ids)

    def reset(self, stage: mujoco.mjtStage) -> None:
        """Resets all simulations to the reference pose.

        Args:
            stage: Stage up to which the quantities that depend on the state are computed.
        """
        with self._failures():
            self._batch.reset(stage=stage)

    def forward(self) -> None:
        """Computes all quantities that depend on the state (``mj_forward``)."""
        with self._failures():
            self._batch.forward(self._ids)

    def step(self, substeps: int) -> None:
        """Advances by a number of physics steps."""
        with self._failures():
            self._batch.step(self._ids, nstep=substeps)

    def rollout(self, commands: FloatArray, fields: Sequence[str]) -> dict[str, FloatArray]:
        """Advances by physics steps under known commands.

        Args:
            commands: ``(simulations, physics steps, motors)``.
            fields: Names of the fields of MjData to record.

        Returns:
            Values of each field after each physics step, ``(simulations, physics steps, width)``;
            0 in simulations that are stepped no longer.
        """
        ids = np.arange(self._batch.nsim) if self._ids is None else self._ids
        steps = commands.shape[1]
        widths = {name: self._batch.bind(name).shape[1] for name in fields}
        out = {name: np.zeros((len(ids), steps, width)) for name, width in widths.items()}
        with self._failures():
            self._batch.rollout(steps, commands[ids], record=fields, ids=ids, out=out)
        if len(ids) == self._batch.nsim:
            return out
        every = {name: np.zeros((self._batch.nsim, *own.shape[1:])) for name, own in out.items()}
        for name, own in out.items():
            every[name][ids] = own
        return every

    @contextmanager
    def _failures(self) -> Iterator[None]:
        try:
            yield
        except SimulationError as error:
            self._failed[error.ids] = True
            self._ids = np.flatnonzero(~self._failed)

    def diverged(self) -> BoolArray:
        """Returns a mask of the simulations that diverged or had a warning, ``(n,)``."""
        warned: BoolArray = self._batch.warning[:, :, 1].any(axis=1)
        return np.asarray(self._failed | warned)


MAX_BATCH = 512 * 2**20
"""Largest memory of a batch, bytes; a larger one is not faster."""

_FREE_SHARE = 0.25
"""Share of the available memory that a batch may take: other processes may run studies beside."""

_NUMBER_BYTES = 8
_BODY_NUMBERS = 16
"""Numbers of the pose and the velocity of a body that a batch reads."""

_COPIES = 3
"""Arrays of a recorded signal at one time: during the run, its result, and a comparison."""


def batch_bytes() -> int:
    """Returns the memory that the models, simulations and signals of a batch may take, bytes."""
    return min(MAX_BATCH, int(_FREE_SHARE * available_memory()))


def largest_batch(robot: Robot, request: Request, steps: int) -> int:
    """Returns the largest number of hypotheses to simulate together; at least one.

    Args:
        robot: The robot.
        request: Simulation of each hypothesis.
        steps: Control steps of the trial.
    """
    return max(1, batch_bytes() // hypothesis_bytes(robot, request, steps))


def hypothesis_bytes(robot: Robot, request: Request, steps: int) -> int:
    """Returns the memory of the simulations of one hypothesis, bytes.

    Each embodiment has its own model, with all height fields, meshes and textures.
    """
    match request:
        case ClosedLoop():
            models, simulations, rows = 1, 1, steps
        case Segments():  # a fault may adapt the model to a trial's ground contacts
            count = len(request.commands)
            models, simulations, rows = 2, count, count * (request.horizon + 1)
        case Ensemble():
            models, simulations, rows = request.members, request.members, request.members * steps
    model = robot.model
    state = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
    numbers = state + model.nsensordata + _BODY_NUMBERS * model.nbody
    widths = sum(robot.anatomy.names.width(signal) for signal in request.record)
    return models * int(model.nbuffer) + _NUMBER_BYTES * (
        simulations * int(numbers) + _COPIES * rows * widths
    )
