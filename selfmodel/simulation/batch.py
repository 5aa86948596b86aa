"""Batches of MuJoCo simulations that continue when some of them diverge."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from selfmodel.arrays import BoolArray, IndexArray
from selfmodel.robot.base import Reader
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import observed_fields
from selfmodel.trials.signals import Signal


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
    robot: Robot, batch: Batch, embodiments: Sequence[Embodiment], record: Sequence[Signal]
) -> dict[Signal, Reader]:
    """Returns functions that read the current values of recorded signals from a batch.

    The readings and the commands of the controllers are not part of MuJoCo's state, and are
    omitted.
    """
    state = observed_fields(robot, embodiments)
    return {
        signal: state[signal].reader(batch.bind)
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
