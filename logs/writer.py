"""Writes a trial into its log while it runs, so that whatever happens, what happened is kept."""

import itertools
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from selfmodel.controllers.command_source import CommandSource
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError, describe
from selfmodel.logs.atomic import part_of
from selfmodel.logs.encoder import Encoder, empty_rows, parts_of
from selfmodel.logs.errors import IncompleteError, salvage_it
from selfmodel.logs.files import explained
from selfmodel.logs.logfile import LogFile
from selfmodel.logs.preamble import write_preamble
from selfmodel.logs.records import FINISHED, RESULT, STOPPED, Imported, Result, checked_name
from selfmodel.physical.cleanup import Ending
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Names, Sample
from selfmodel.trials.trial import TrialPlan

FLUSH_STEPS = 50
"""How many steps a kill can cost at most. It makes the file 1 % larger than never flushing."""


def write_trial(
    path: Path,
    robot: Robot,
    plan: TrialPlan,
    samples: Iterable[Sample],
    *,
    timed: bool = False,
    settings: Settings,
    hidden: str | None = None,
    gap: str | None = None,
    imported: Imported | None = None,
) -> Path:
    """Logs a trial while it runs; see ``TrialWriter``.

    Args:
        path: The log's name; until the trial is finished, the file is called ``path.part``.
        robot: The robot as its model describes it.
        plan: What is to be done.
        samples: What happens, as it happens; not more than the plan's steps are asked for, and what
            has ``close``, as a generator has, is closed before the log is, which stops the robot.
            To look at them on their way, use ``TrialWriter``: a ``map`` over a generator has none.
        timed: Whether the robot is ``physical.interface.TimedRobot``: its samples have moments.
        settings: The paper's numbers, for the record.
        hidden: What is wrong with a simulated robot, in notation; for ``read_truth`` only.
        gap: How else it differs from its model, as JSON; for ``read_gap`` only.
        imported: Where an imported trial comes from.

    Returns:
        ``path``.

    Raises:
        InputError: The file exists, or the plan or a sample does not fit the robot.
        IncompleteError: There were fewer samples than planned; they are in the ``.part``.
        LogWriteError: The disk is full, or failed.
    """
    writer = TrialWriter(
        path,
        robot,
        plan,
        timed=timed,
        settings=settings,
        hidden=hidden,
        gap=gap,
        imported=imported,
    )
    # Whatever ends a trial, the robot is stopped.
    with writer, Ending(getattr(samples, "close", lambda: None)):
        for sample in itertools.islice(samples, plan.steps):
            writer.add(sample)
    return path


class TrialWriter:
    """Writes one trial, sample by sample; a context manager that finishes the file by itself.

    Whatever ends the trial early, from an exception to a kill, leaves a ``.part`` with all steps
    but at most the last ``FLUSH_STEPS``. Only of a robot with a clock of its own, whose trial
    cannot be made again, an exception leaves a whole log, whose status is ``stopped``; and none
    where there is no step yet, so that the trial can be tried again under its name.

    Args:
        path: The log's name.
        robot: The robot as its model describes it.
        plan: What is to be done.
        timed: Whether the robot has a clock of its own.
        settings: The paper's numbers.
        hidden: What is wrong with a simulated robot, in notation.
        gap: How else it differs from its model, as JSON.
        imported: Where an imported trial comes from.

    Raises:
        InputError: The plan does not fit the robot.
    """

    def __init__(
        self,
        path: Path,
        robot: Robot,
        plan: TrialPlan,
        *,
        timed: bool = False,
        settings: Settings,
        hidden: str | None = None,
        gap: str | None = None,
        imported: Imported | None = None,
    ) -> None:
        checked_name(plan.name)
        names = robot.anatomy.names
        _check_ends(robot.name, names, plan.controller)
        if plan.steps < 1:
            raise InputError(f"a trial has at least 1 step, got {plan.steps}")
        self.path = path
        self.steps = 0
        self._robot, self._plan, self._settings = robot, plan, settings
        self._hidden, self._gap, self._imported = hidden, gap, imported
        self._timed = timed
        self._encoder = Encoder(robot, timed=timed)
        self._rows = empty_rows(names, FLUSH_STEPS, timed=timed)
        self._written = 0
        self._start = self._end = 0.0
        self._sound = False

    def __enter__(self) -> Self:
        self._log = LogFile(self.path)
        with ExitStack() as undo:
            undo.callback(self._log.close)  # `__exit__` is not called where this is interrupted
            write_preamble(
                self._log,
                self._robot,
                self._plan,
                timed=self._timed,
                settings=self._settings,
                hidden=self._hidden,
                gap=self._gap,
                imported=self._imported,
            )
            self._channels = [
                self._log.channel(topic.name, topic.type) for topic in self._encoder.topics
            ]
            self._log.sync()  # before the robot moves, the disk has all that steps are read by
            undo.pop_all()
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
        if (sample.moment is not None) != self._timed:
            has, given = ("no", "True") if self._timed else ("a", "False")
            raise InputError(
                f"the sample of step {self.steps} has {has} moment, and timed is {given}: a trial "
                f"is timed if its robot has a clock of its own"
            )
        told = parts_of(sample)
        for part, rows in self._rows.items():
            row = told.get(part)
            if row is None or row.shape != rows.shape[1:]:
                raise InputError(
                    f"the sample of step {self.steps} must have {part} of shape "
                    f"{rows.shape[1:]}, got {'nothing' if row is None else row.shape}"
                )
            rows[self.steps - self._written] = row
        self._end = float(sample.values["base_position"][0])
        if self.steps == 0:
            self._start = self._end
        self.steps += 1
        # The first step goes out at once: with it, what follows can always be salvaged.
        if self.steps == 1 or self.steps - self._written == FLUSH_STEPS:
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
                self._finish(FINISHED)
            elif error is not None and self._timed and self._sound:
                if self.steps:
                    self._finish(STOPPED, _in_words(error))
                else:
                    self._log.abandon()
        except (OSError, InputError) as failure:
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
                advice=salvage_it(part_of(self.path)),
            )

    def _flush(self) -> None:
        """Writes the steps that wait, and hands them to the operating system."""
        count = self.steps - self._written
        if not count:
            return
        self._sound = False
        rows = {part: rows[:count] for part, rows in self._rows.items()}
        with explained(part_of(self.path)):
            for step, topic, stamp, payload in self._encoder.encode(self._written, rows):
                self._log.message(self._channels[topic], stamp, payload, step)
        self._log.flush()
        self._written = self.steps
        self._sound = True

    def _finish(self, status: str, reason: str = "") -> None:
        result = Result(status, self.steps, self._end - self._start, reason)
        self._log.metadata(RESULT, result.texts())
        self._log.finish()


def _in_words(error: BaseException) -> str:
    text = " ".join(f"{type(error).__name__}: {describe(error)}".split()).removesuffix(":")
    # A file's name that is no text comes with surrogates, which a log cannot hold.
    return text.encode("utf-8", "backslashreplace").decode()


def _check_ends(robot: str, names: Names, driver: CommandSource) -> None:
    if isinstance(driver, Playback):
        sensors, motors = names.sensors, driver.motors
    else:
        sensors, motors = driver.design.sensors, driver.design.motors
    if (sensors, motors) != (names.sensors, names.motors):
        raise InputError(
            f"expected a controller for {robot}, with the sensors {names.sensors} and motors "
            f"{names.motors}, got one for {sensors} and {motors}"
        )
