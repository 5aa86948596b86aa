"""Batches of MuJoCo simulations: made, stepped, and known for which of them broke down."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from selfmodel.arrays import BoolArray, IndexArray
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.robot.state_access import signal_fields
from selfmodel.robot.state_fields import Reader
from selfmodel.trials.behaviour import Signal


def new_batch(model: mujoco.MjModel, embodiments: Sequence[Embodiment], threads: int) -> Batch:
    """A batch with each simulation on its embodiment's model."""
    batch = Batch(model, len(embodiments), nthread=threads)
    batch.set_models([embodiment.model for embodiment in embodiments])
    return batch


def live_signals(
    robot: Robot, batch: Batch, embodiments: Sequence[Embodiment], record: Sequence[Signal]
) -> dict[Signal, Reader]:
    """Returns for each signal of the state what reads its present value.

    What the controllers receive and give is not part of MuJoCo's state, and is left out.
    """
    state = signal_fields(robot, *(embodiment.model for embodiment in embodiments))
    return {
        signal: state[signal].reader(batch.bind)
        for signal in record
        if signal not in ("sensors", "commands")
    }


class LiveBatch:
    """Steps the simulations of a batch that MuJoCo has not raised in, and knows which broke down.

    One that MuJoCo warns about is reset by it and goes on, worthless but harmless: rows of a batch
    do not touch each other.
    """

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self._ids: IndexArray | None = None
        self._failed = np.zeros(batch.nsim, dtype=bool)

    def forward(self) -> None:
        """Computes what follows from the present state."""
        with self._failures():
            self._batch.forward(self._ids)

    def step(self, substeps: int) -> None:
        """Makes that many physics steps."""
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
        """Returns which simulations mean nothing, ``(n,)``."""
        warned: BoolArray = self._batch.warning[:, :, 1].any(axis=1)
        return np.asarray(self._failed | warned)


@contextmanager
def silence_mujoco_warnings() -> Iterator[None]:
    """Keeps MuJoCo's warnings off the terminal and out of a file: each is counted by its run."""
    before, quiet = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    quiet.logto_console = quiet.logto_file = False
    mujoco.MjLogConfig.set(quiet)
    try:
        yield
    finally:
        mujoco.MjLogConfig.set(before)
