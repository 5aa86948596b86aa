"""Writes a trial into its log while it runs, so that whatever happens, what happened is kept."""

import itertools
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from selfmodel.behaviour import SIGNALS, Sample
from selfmodel.controller import Controller
from selfmodel.errors import InputError
from selfmodel.logs.errors import IncompleteError
from selfmodel.logs.files import explained, part_of
from selfmodel.logs.frames import Kinematics, body_names, into_child_frame
from selfmodel.logs.logfile import LogFile
from selfmodel.logs.preamble import write_preamble
from selfmodel.logs.records import FINISHED, RESULT, Imported, Result, checked_name
from selfmodel.logs.topics import topics, transforms
from selfmodel.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trial import Plan

if TYPE_CHECKING:
    from selfmodel.arrays import FloatArray
    from selfmodel.logs.topics import Part

FLUSH_STEPS = 50
"""How many steps a kill can cost at most. It makes the file 1 % larger than never flushing."""


def write_trial(
    path: Path,
    robot: Robot,
    plan: Plan,
    samples: Iterable[Sample],
    *,
    settings: Settings,
    hidden: str | None = None,
    imported: Imported | None = None,
) -> Path:
    """Logs a trial while it runs; see ``TrialWriter``.

    Args:
        path: The log's name; until the trial is finished, the file is called ``path.part``.
        robot: The robot as its model describes it.
        plan: What is to be done.
        samples: What happens, as it happens; not more than the plan's steps are asked for.
        settings: The paper's numbers, for the record.
        hidden: What is wrong with a simulated robot, in notation; for ``read_truth`` only.
        imported: Where an imported trial comes from.

    Returns:
        ``path``.

    Raises:
        InputError: The file exists, or the plan or a sample does not fit the robot.
        IncompleteError: There were fewer samples than planned; they are in the ``.part``.
        LogWriteError: The disk is full, or failed.
    """
    writer = TrialWriter(path, robot, plan, settings=settings, hidden=hidden, imported=imported)
    with writer:
        for sample in itertools.islice(samples, plan.steps):
            writer.add(sample)
    return path


class TrialWriter:
    """Writes one trial, sample by sample; a context manager that finishes the file by itself.

    Whatever ends the trial early, from an exception to a kill, leaves a ``.part`` with all steps
    but at most the last ``FLUSH_STEPS``. A file without ``.part`` is a finished trial.

    Args:
        path: The log's name.
        robot: The robot as its model describes it.
        plan: What is to be done.
        settings: The paper's numbers.
        hidden: What is wrong with a simulated robot, in notation.
        imported: Where an imported trial comes from.

    Raises:
        InputError: The plan does not fit the robot.
    """

    def __init__(
        self,
        path: Path,
        robot: Robot,
        plan: Plan,
        *,
        settings: Settings,
        hidden: str | None = None,
        imported: Imported | None = None,
    ) -> None:
        checked_name(plan.name)
        names, driver = robot.anatomy.names, plan.controller
        network = driver.network if isinstance(driver, Controller) else robot.network
        if (network.sensors, network.motors) != (names.sensors, names.motors):
            raise InputError(
                f"expected a controller for {robot.name}, with the sensors {names.sensors} and "
                f"motors {names.motors}, got one for {network.sensors} and {network.motors}"
            )
        if plan.steps < 1:
            raise InputError(f"a trial has at least 1 step, got {plan.steps}")
        self.path = path
        self.steps = 0
        self._robot, self._plan, self._settings, self._hidden = robot, plan, settings, hidden
        self._imported = imported
        self._topics = (*topics(names, robot.root), transforms(body_names(robot.model)))
        self._kinematics = Kinematics(robot)
        self._rows = {signal: np.empty((FLUSH_STEPS, names.width(signal))) for signal in SIGNALS}
        self._written = 0
        self._start = self._end = 0.0
        self._sound = False

    def __enter__(self) -> Self:
        self._log = LogFile(self.path)
        try:
            write_preamble(
                self._log, self._robot, self._plan, self._settings, self._hidden, self._imported
            )
            self._channels = [self._log.channel(topic.name, topic.type) for topic in self._topics]
        except BaseException:  # whatever ends it, Ctrl-C too: `__exit__` is not called then
            self._log.close()
            raise
        self._sound = True
        return self

    def add(self, sample: Sample) -> None:
        """Takes the next step's sample.

        Raises:
            InputError: It is one too many, not of its time, or its rows do not fit the robot.
            LogWriteError: The disk is full, or failed.
        """
        time = self.steps * self._robot.control_timestep
        if self.steps >= self._plan.steps or sample.time != time:
            raise InputError(
                f"step {self.steps} of {self._plan.steps} is due at {time!r} s, "
                f"got a sample of {sample.time!r} s"
            )
        for signal, rows in self._rows.items():
            row = sample.values.get(signal)
            if row is None or row.shape != rows.shape[1:]:
                raise InputError(
                    f"the sample of step {self.steps} must have {signal} of shape "
                    f"{rows.shape[1:]}, got {'nothing' if row is None else row.shape}"
                )
            rows[self.steps - self._written] = row
        self._end = float(sample.values["base_position"][0])
        if self.steps == 0:
            self._start = self._end
        self.steps += 1
        if self.steps - self._written == FLUSH_STEPS:
            self._flush()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            # Not where writing itself was interrupted: half a record would be written on.
            if self._sound:
                self._flush()
            if error is None and self.steps == self._plan.steps:
                self._finish()
        except OSError as failure:
            if error is None:
                raise
            error.add_note(str(failure))  # what ended the trial comes first
        finally:
            self._log.close()
        if error is None and self.steps < self._plan.steps:
            raise IncompleteError(
                part_of(self.path),
                f"the robot stopped after {self.steps} of {self._plan.steps} steps",
                good=f"{self.steps} steps are in that file",
            )

    def _flush(self) -> None:
        """Writes the steps that wait, and hands them to the operating system."""
        steps = np.arange(self._written, self.steps)
        if not len(steps):
            return
        self._sound = False
        rows: dict[Part, FloatArray] = {
            signal: rows[: len(steps)] for signal, rows in self._rows.items()
        }
        rows["transforms"] = self._kinematics.transforms(
            rows["joint_positions"], rows["base_position"], rows["base_orientation"]
        )
        rows["child_linear_velocity"] = into_child_frame(
            rows["base_linear_velocity"], rows["base_orientation"]
        )
        stamps = np.rint(steps * self._robot.control_timestep * 1e9).astype(np.int64)
        series = [topic.template.encode(stamps, topic.pack(rows)) for topic in self._topics]
        with explained(part_of(self.path)):
            for step, stamp, *payloads in zip(
                steps.tolist(), stamps.tolist(), *series, strict=True
            ):
                for channel, payload in zip(self._channels, payloads, strict=True):
                    self._log.message(channel, stamp, payload, step)
        self._log.flush()
        self._written = self.steps
        self._sound = True

    def _finish(self) -> None:
        result = Result(FINISHED, self.steps, self._end - self._start)
        self._log.metadata(RESULT, result.texts())
        self._log.finish()
