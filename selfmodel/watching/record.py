"""The folder of a watch: its findings as diagnostics of ROS 2, and the steps around a change."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.playback import played_back
from selfmodel.errors import counted
from selfmodel.logs.errors import LogWriteError
from selfmodel.logs.files import make_folder, refuse_existing
from selfmodel.logs.log_file import LogFile
from selfmodel.logs.messages import Template
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import TrialWriter
from selfmodel.physical import safety
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trajectory import Sample
from selfmodel.trials.trial import TrialPlan
from selfmodel.watching.diagnostics import PartStatus, part_statuses
from selfmodel.watching.finding import ENDS, Finding

FINDINGS, BLACK_BOX = "findings.mcap", "black-box.mcap"

DIAGNOSTICS, DIAGNOSTICS_TYPE = "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"

PERIOD = 1_000_000_000
"""Time after which an unchanged state is said again, ns: that of ROS's diagnostic updater."""

KEPT, AFTER = 60.0, 5.0
"""Times of which the black box has the steps at most, and of these after the end of a watch, s: a
diagnosis finds a change that is 2 s or more before the end of a trial."""

_NO_NUMBERS: FloatArray = np.empty((1, 0))


class WatchRecord:
    """Writer of the folder of a watch; a context manager that finishes its files.

    ``findings.mcap`` is ``findings.mcap.part`` until the end; a kill leaves that.
    ``black-box.mcap`` is written at the end, if the robot has changed.

    Attributes:
        note: What the black box has, once it is written; "" without one.

    Raises:
        InputError: The folder has another record, or is a file.
        LogWriteError: This, and ``add``: the disk is full, or failed.
    """

    def __init__(self, folder: Path, robot: Robot) -> None:
        make_folder(folder)
        self._black_box = folder / BLACK_BOX
        refuse_existing(self._black_box)
        self._robot = robot
        self._steps: deque[Sample] = deque(maxlen=round(KEPT / robot.control_timestep))
        self._said: Template | None = None
        self._has_changed = self._has_ended = False
        self.note = ""
        self._messages = self._due = 0
        self._log = LogFile(folder / FINDINGS)
        self._channel = self._log.channel(DIAGNOSTICS, DIAGNOSTICS_TYPE)

    def __enter__(self) -> Self:
        self._log.flush()
        return self

    def add(self, step: Sample | None, findings: Sequence[Finding], start: int = 0) -> None:
        """Adds a step, if one came, and the findings since the one before, in order.

        The start is the time stamp of the first step, ns.
        """
        with safety.hold_stop_signals():
            if step is not None:
                self._steps.append(step)
            now = start + round(self._steps[-1].time * 1e9 if self._steps else 0)
            for finding in findings:
                self._said = _array(part_statuses(self._robot, finding))
                self._publish(self._said, now)
                self._log.flush()
                self._has_ended |= finding.status in ENDS
                if finding.status != "stale":  # a false alarm leaves no black box
                    self._has_changed = finding.onset is not None or self._has_ended
            if step is not None and self._said is not None and now >= self._due:
                self._publish(self._said, now)

    def _publish(self, said: Template, now: int) -> None:
        (payload,) = said.encode(np.array([now]), _NO_NUMBERS)
        self._log.messages([self._channel], [(self._messages, 0, now, payload)])
        self._messages, self._due = self._messages + 1, now + PERIOD

    def _write_black_box(self) -> None:
        """Writes the steps that are kept, from the first with all commands on, as a trial."""
        commands = np.stack([one.values["commands"] for one in self._steps])
        known = np.isfinite(commands).all(axis=1)
        if not known.any():
            self.note = f"{self._black_box} is not written: the last steps have no commands"
            return
        first = int(known.argmax())
        steps, timestep = list(self._steps)[first:], self._robot.control_timestep
        driver = played_back(self._robot.anatomy.motors, commands[first:])
        plan = TrialPlan("black-box", "single", driver, len(steps), seed=0)
        header = TrialHeader(Settings(), timed=steps[0].moment is not None)
        since = f"{counted(len(steps), 'step')} from t = {steps[0].time:.2f} s on"
        with TrialWriter(self._black_box, self._robot, plan, header) as writer:
            for k, one in enumerate(steps):
                writer.add(replace(one, time=k * timestep))
        self.note = f"{self._black_box}: {since}"

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        with safety.hold_stop_signals():
            if self._messages == 0:
                self._log.abandon()
            elif isinstance(error, LogWriteError):
                self._log.close()
            else:
                self._log.finish()
                if self._has_changed:
                    self._write_black_box()


def _array(statuses: Sequence[PartStatus]) -> Template:
    """Returns the message about some parts, without its time."""
    content = [
        {**vars(one), "values": [{"key": key, "value": text} for key, text in one.values.items()]}
        for one in statuses
    ]
    return Template(DIAGNOSTICS_TYPE, {"status": content})
