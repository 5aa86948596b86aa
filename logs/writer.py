"""Writer of a trial's log, while the trial runs: a kill loses at most the last steps."""

import itertools
import json
import platform
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import astuple
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Self

import mcap
import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError, TrialError, describe
from selfmodel.logs import messages, records, viewers
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.errors import IncompleteError, salvage_it
from selfmodel.logs.files import partial_path
from selfmodel.logs.log_file import LogFile, Row
from selfmodel.logs.messages import Part
from selfmodel.logs.records import TrialHeader
from selfmodel.physical import safety
from selfmodel.robot.actuators import driven_names
from selfmodel.robot.robot import Robot
from selfmodel.rotation import in_body_frame
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Sample
from selfmodel.trials.trial import TrialPlan
from selfmodel.version import __version__

FLUSH_STEPS = 50
"""Steps between two flushes, the most that a kill can lose. The file is 1 % larger than without."""


def write_trial(
    path: Path, robot: Robot, plan: TrialPlan, samples: Iterable[Sample], header: TrialHeader
) -> Path:
    """Writes the log of a trial while the trial runs; see ``TrialWriter``.

    Args:
        path: Name of the log, which is returned; the unfinished file is ``path.part``.
        robot: Robot as its model describes it.
        plan: Plan of the trial.
        samples: Samples, one per control step as they happen; at most ``plan.steps`` are read.
            An iterable with a method ``close``, as a generator has, is closed before the log is,
            which stops the robot. A ``map`` over a generator has no ``close``: to process samples
            before they are logged, use ``TrialWriter``.
        header: Other content of the log's preamble.

    Raises:
        InputError: The file exists, or the plan or a sample does not fit the robot.
        IncompleteError: There were fewer samples than planned; the ``.part`` contains them.
        LogWriteError: The disk is full, or failed.
    """
    iterator = itertools.islice(samples, plan.steps)
    # The robot is stopped in any case, and a signal interrupts nothing but the robot.
    with (
        safety.handle_stop_signals(),
        safety.hold_stop_signals(),
        TrialWriter(path, robot, plan, header) as writer,
        safety.cleanup(getattr(samples, "close", lambda: None)),
    ):
        while True:
            with safety.release_stop_signals():
                sample = next(iterator, None)
            if sample is None:
                return path
            writer.add(sample)


class TrialWriter:
    """Writer of one trial's log, sample by sample; a context manager that finishes the file.

    A trial that ends early, by an exception or a kill, leaves a ``.part`` with all steps but at
    most the last ``FLUSH_STEPS``. A trial that its robot could not finish (``TrialError``) leaves a
    complete log with the status ``stopped``, and so does any exception in the trial of a robot with
    its own clock, which cannot be repeated. If there is no step yet, such a trial leaves no file,
    so that it can be repeated under its name.
    """

    def __init__(self, path: Path, robot: Robot, plan: TrialPlan, header: TrialHeader) -> None:
        records.checked_name(plan.name)
        names, driver = robot.anatomy.names, plan.controller
        ends = (
            (names.sensors, driver.motors)
            if isinstance(driver, Playback)
            else (driver.design.sensors, driver.design.motors)
        )
        if ends != (names.sensors, names.motors):
            raise InputError(
                f"expected a controller for {robot.name}, with the sensors {names.sensors} and "
                f"motors {names.motors}, got one for {ends[0]} and {ends[1]}"
            )
        if plan.steps < 1:
            raise InputError(f"a trial has at least 1 step, got {plan.steps}")
        self.path = path
        self.steps = 0
        self._robot, self._plan, self._header = robot, plan, header
        driven = driven_names(robot.model)
        self._kinematics = viewers.Kinematics(robot)
        self._acceleration = header.imported.acceleration if header.imported else None
        self._topics = (
            *messages.topics(names, robot.root, timed=header.timed, driven=driven),
            *([] if self._acceleration is None else [messages.imu(robot.root)]),
            *self._kinematics.topics,
        )
        self._first_stamp = header.imported.start if header.imported else 0
        widths: dict[Part, int] = {signal: names.width(signal) for signal in SIGNALS}
        if header.timed:
            widths["timing"] = 3
        self._rows = {part: np.empty((FLUSH_STEPS, width)) for part, width in widths.items()}
        self._written = 0
        self._start = self._end = 0.0
        self._sound = False

    def __enter__(self) -> Self:
        self._log = LogFile(self.path)
        with ExitStack() as undo:
            undo.callback(self._log.close)  # an interrupted `__enter__` has no `__exit__`
            _write_preamble(self._log, self._robot, self._plan, self._header)
            types = {topic.name: topic.type for topic in self._topics}
            numbers = {name: self._log.channel(name, kind) for name, kind in types.items()}
            self._channels = [numbers[topic.name] for topic in self._topics]
            self._log.sync()  # the disk has the preamble before the robot moves
            undo.pop_all()
        self._sound = True
        return self

    def add(self, sample: Sample) -> None:
        """Adds the sample of the next step."""
        time = self.steps * self._robot.control_timestep
        if self.steps >= self._plan.steps or sample.time != time:
            raise InputError(
                f"step {self.steps} of {self._plan.steps} is due at {time!r} s, "
                f"got a sample of {sample.time!r} s"
            )
        if (sample.moment is not None) != self._header.timed:
            has, given = ("no", "True") if self._header.timed else ("a", "False")
            raise InputError(
                f"the sample of step {self.steps} has {has} moment, but timed is {given} in the "
                f"header: a trial is timed if its robot has a clock of its own"
            )
        sampled = dict[Part, FloatArray](sample.values.items())
        if sample.moment is not None:
            sampled["timing"] = np.array(astuple(sample.moment), dtype=np.float64)
        for part, rows in self._rows.items():
            row = sampled.get(part)
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
        # The first step is flushed at once: salvage needs one complete step.
        if self.steps == 1 or self.steps - self._written == FLUSH_STEPS:
            self._flush()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            # Not after an interrupted write, which may have left an incomplete record.
            if self._sound:
                self._flush()
            if error is None and self.steps == self._plan.steps:
                self._finish(records.FINISHED)
            elif self._sound and (
                isinstance(error, TrialError) or (error is not None and self._header.timed)
            ):
                if self.steps:
                    text = " ".join(f"{type(error).__name__}: {describe(error)}".split())
                    # A file name that is not UTF-8 contains surrogates, which a log cannot contain.
                    reason = text.removesuffix(":").encode("utf-8", "backslashreplace").decode()
                    self._finish(records.STOPPED, reason)
                else:
                    self._log.abandon()
        except (OSError, InputError) as failure:
            if error is None:
                raise
            error.add_note(str(failure))  # the first error is the cause
        finally:
            self._log.close()
        if error is None and self.steps < self._plan.steps:
            raise IncompleteError(
                partial_path(self.path),
                f"the robot stopped after {self.steps} of {self._plan.steps} steps",
                good=f"{self.steps} steps are in that file",
                advice=salvage_it(partial_path(self.path)),
            )

    def _flush(self) -> None:
        count = self.steps - self._written
        if not count:
            return
        self._sound = False
        self._log.messages(
            self._channels, self._encoded({part: rows[:count] for part, rows in self._rows.items()})
        )
        self._log.flush()
        self._written = self.steps
        self._sound = True

    def _encoded(self, rows: Mapping[Part, FloatArray]) -> list[Row]:
        """Messages of the steps in some rows, in order; the transforms are not in every step."""
        steps = np.arange(self._written, self.steps)
        period = self._robot.control_timestep
        stamps = np.rint(steps * period * 1e9).astype(np.int64) + self._first_stamp
        with np.errstate(over="ignore", invalid="ignore"):  # unobserved or extreme values
            child = in_body_frame(rows["base_linear_velocity"], rows["base_orientation"])
        parts: dict[Part, FloatArray] = {
            **rows,
            "child_linear_velocity": viewers.to_micrometres(child),
            "pose_unknown": _unknown(rows["base_position"], rows["base_orientation"]),
            "twist_unknown": _unknown(child, rows["base_angular_velocity"]),
        }
        if self._acceleration is not None:
            measured = self._acceleration[self._written : self.steps]
            parts |= {
                "acceleration": measured,
                "acceleration_unknown": _unknown(measured),
                "orientation_unknown": _unknown(rows["base_orientation"]),
                "turning_unknown": _unknown(rows["base_angular_velocity"]),
            }
        drawn = np.flatnonzero(steps % max(1, round(messages.FRAMES_PERIOD / period)) == 0)
        poses = self._kinematics.transforms({part: values[drawn] for part, values in rows.items()})
        content: list[tuple[IndexArray, Mapping[Part, FloatArray]]] = []
        content += [(np.arange(len(steps)), parts)] * (len(self._topics) - len(poses))
        for chosen, values in poses:
            content.append((drawn[chosen], {"transforms": values}))
        encoded: list[Row] = []
        for index, (topic, (chosen, own)) in enumerate(zip(self._topics, content, strict=True)):
            times = stamps[chosen]
            payloads = topic.template.encode(times, topic.pack(own))
            encoded += zip(
                steps[chosen].tolist(), itertools.repeat(index), times.tolist(), payloads
            )
        encoded.sort(key=itemgetter(0, 1))
        return encoded

    def _finish(self, status: str, reason: str = "") -> None:
        self._log.finish(
            records.ResultRecord(
                status, self.steps, self._end - self._start, reason[: records.MAX_TEXT]
            )
        )


def _unknown(*values: FloatArray) -> FloatArray:
    """Returns -1 for each step with a number that is not known, and else 0, ``(steps, 1)``."""
    known = np.isfinite(np.concatenate(values, axis=1)).all(axis=1, keepdims=True)
    return np.where(known, 0.0, -1.0)


def _write_preamble(log: LogFile, robot: Robot, plan: TrialPlan, header: TrialHeader) -> None:
    """Writes the records, attachments and robot description that precede the first step."""
    driver = plan.controller
    of = driver.function if isinstance(driver, Playback) else driver.design.function
    controller = b"" if isinstance(driver, Playback) or of else controller_bytes(driver)
    model = robot.mjcf.encode()
    motors, driven = robot.anatomy.motors, driven_names(robot.model)
    record = records.TrialRecord(
        format=records.TIMED_FORMAT if header.timed else records.FORMAT,
        name=plan.name,
        stage=plan.stage,
        robot=robot.name,
        root=robot.root,
        control_timestep=robot.control_timestep,
        steps=plan.steps,
        seed=plan.seed,
        controller_sha256=records.sha256(controller) if controller else "",
        model_sha256=records.sha256(model),
        motors="" if driven == motors else json.dumps(motors),
        function=of,
    )
    software = {
        "selfmodel": __version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "mcap": mcap.__version__,
    }
    log.metadata(records.TRIAL, records.texts_of(record))
    log.metadata(records.SOFTWARE, software)
    truths = {records.TRUTH: header.hidden, records.GAP: header.gap}
    if known := {name: text for name, text in truths.items() if text is not None}:
        log.metadata(records.HIDDEN, known)
    log.attach(records.MODEL_FILE, model)
    for name, data in robot.assets.items():
        log.attach(name, data)
    if controller:
        log.attach(records.CONTROLLER_FILE, controller)
    log.attach(records.SETTINGS_FILE, json.dumps(header.settings.as_json(), indent=1).encode())
    if header.imported is not None:
        log.metadata(records.IMPORT, header.imported.facts)
        log.attach(records.MAPPING_FILE, header.imported.mapping.encode())
    channel = log.channel(messages.DESCRIPTION, messages.DESCRIPTION_TYPE)
    start = header.imported.start if header.imported else 0
    log.messages([channel], [(0, 0, start, messages.description(viewers.urdf(robot)))])
