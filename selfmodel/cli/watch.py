"""``selfmodel watch``: findings about a robot while its log is written, or from a finished one."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import chain

from selfmodel import arguments, plugins
from selfmodel.cli.commands import WatchLog
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.errors import InputError, counted
from selfmodel.logs.growing import GrowingLog
from selfmodel.logs.recordings.growing import GrowingBag
from selfmodel.logs.recordings.importer import import_recording
from selfmodel.logs.recordings.mapping_file import read_mapping
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Sample, samples_of
from selfmodel.watching.finding import ENDS, Finding
from selfmodel.watching.record import AFTER, WatchRecord
from selfmodel.watching.watch import Watch

POLL = 0.05
"""Time between two looks at a log that grows, s."""

SILENCE = 2.0
"""Time without a step after which the input is stale, s, or that of the steps that a look may find
if it is longer: a trial at 50 Hz is written in parts of 1 s, and ROS's aggregator waits 5 s."""

Steps = Iterator[Sample | float]
"""Steps in order, and the time for which none came, s, once it is that of a silence."""


def watch(options: WatchLog) -> None:
    """Prints the findings about a robot, each as soon as the log contains what shows it.

    It ends with the log, or with the finding that ends the watch.
    """
    logs = arguments.read_logs(options.healthy)
    robot = arguments.robot_of_logs(logs, options.self_model)
    as_lines = sys.stdout.isatty() and not options.as_json
    with ExitStack() as files:
        steps, start = _opened(options, robot, files)
        record = None
        if options.out is not None:  # a diagnosis of the black box takes the healthy logs, too
            own = arguments.robot_of_logs(logs, None)
            record = files.enter_context(WatchRecord(options.out, own))
        watched = Watch(
            robot,
            [one.trial for one in logs],
            kinds=plugins.kinds(options.kinds),
            false_alarm_every=options.false_alarm_every,
            calibrate=options.calibrate,
            threads=options.threads,
        )
        until = None
        for step, findings in _watched(watched, steps):
            for finding in findings:
                if as_lines:
                    print_lines(str(finding))
                else:
                    print_json(finding.to_dict(), indent=None)
            if record is not None:
                record.add(step, findings, start())
            if findings and findings[-1].status in ENDS:
                until = findings[-1].time + (0.0 if record is None else AFTER)
            if until is not None and (step is None or step.time >= until):
                break
    if record is not None and record.note:
        print_notes(record.note)


def _opened(options: WatchLog, robot: Robot, files: ExitStack) -> tuple[Steps, Callable[[], int]]:
    """Opens a log or a recording, of which a first look refuses what is none.

    Returned are its steps, and what returns the time stamp of the first one, ns.
    """
    follow, mapping = options.follow, options.mapping
    if options.run is not None and (follow or mapping is None):
        raise InputError("--run is for a finished recording: it needs --mapping, without --follow")
    if mapping is not None and not follow:
        found = import_recording(options.file, read_mapping(mapping), robot, options.run)
        for note in found.notes:
            _note(note)
        return samples_of(found.trajectory), lambda: found.origin
    log: GrowingLog | GrowingBag
    if mapping is None:
        log = GrowingLog(options.file, robot.anatomy.names)
    else:
        log = GrowingBag(options.file, read_mapping(mapping), robot, _note)
    files.enter_context(closing(log))
    steps = _steps(log, robot.control_timestep, follow=follow)
    return chain(log.new_steps(), steps), lambda: log.start


def _note(sentence: str) -> None:
    print_notes(f"note: {sentence}")


def _watched(watched: Watch, steps: Steps) -> Iterator[tuple[Sample | None, Sequence[Finding]]]:
    """Yields the steps with their findings; None is a silence, after which the last one is said."""
    last, is_stale, now = None, False, 0.0
    for step in steps:
        found: Sequence[Finding]
        if isinstance(step, float):
            is_stale = last is None or last.status not in ENDS
            found = [Finding(now, "stale", f"no step for {step:g} s")] if is_stale else []
            yield None, found
            continue
        found, now = watched.update(step), round(step.time, 6)
        if is_stale and last is not None:
            found = [replace(last, time=now), *found]
        last, is_stale = found[-1] if found else last, False
        yield step, found
    if found := watched.finish():
        yield None, found


def _steps(log: GrowingLog | GrowingBag, timestep: float, *, follow: bool) -> Steps:
    """Yields the further steps of a log; if it is followed, as they are written."""
    has_caught_up, is_behind = False, False
    heard: float | None = time.monotonic()
    while not log.has_ended:
        new = log.new_steps()
        was_behind, is_behind = is_behind, has_caught_up and len(new) > log.most_new
        if is_behind and not was_behind:
            _note(f"behind by {counted(len(new), 'step')}")
        yield from new
        if new:
            heard = time.monotonic()
        if new or log.has_ended:
            continue
        if not follow:
            _note(f"{log.path} has no end: it is cut, or --follow waits for what comes")
            return
        has_caught_up = True
        silence = max(SILENCE, log.most_new * timestep)
        if heard is not None and time.monotonic() - heard >= silence:
            heard = None
            yield silence
        time.sleep(POLL)
    print_notes(f"{log.path}: {counted(log.steps, 'step')}")
