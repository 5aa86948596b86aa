"""``selfmodel watch``: findings about a robot while its trial log is written, or from one."""

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import chain

from selfmodel import arguments, plugins
from selfmodel.cli.commands import WatchLog
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.errors import counted
from selfmodel.logs.growing import GrowingLog
from selfmodel.logs.writer import FLUSH_STEPS
from selfmodel.trials.trajectory import Sample
from selfmodel.watching.finding import ENDS, Finding
from selfmodel.watching.record import AFTER, WatchRecord
from selfmodel.watching.watch import Watch

POLL = 0.05
"""Time between two looks at a log that grows, s."""

MOST_NEW = 2 * FLUSH_STEPS
"""New steps that a look may find: a trial is written in parts of ``FLUSH_STEPS``."""

SILENCE = 2.0
"""Time without a step after which the input is stale, s, or that of ``MOST_NEW`` steps if it is
longer: a trial at 50 Hz is written in parts of 1 s, and ROS's aggregator waits 5 s for a status."""


def watch(options: WatchLog) -> None:
    """Prints the findings about a robot, each as soon as the log contains what shows it.

    It ends with the log, or with the finding that ends the watch.
    """
    logs = arguments.read_logs(options.healthy)
    robot = arguments.robot_of_logs(logs, options.self_model)
    as_lines = sys.stdout.isatty() and not options.as_json
    with ExitStack() as files:
        log = files.enter_context(GrowingLog(options.file, robot.anatomy.names))
        record = None
        if options.out is not None:  # a diagnosis of the black box takes the healthy logs, too
            own = arguments.robot_of_logs(logs, None)
            record = files.enter_context(WatchRecord(options.out, own))
        first = log.new_steps()  # a file that is no log of the robot is refused before the fit
        watched = Watch(
            robot,
            [one.trial for one in logs],
            kinds=plugins.kinds(options.kinds),
            false_alarm_every=options.false_alarm_every,
            calibrate=options.calibrate,
            threads=options.threads,
        )
        silence = max(SILENCE, MOST_NEW * robot.control_timestep) if options.follow else None
        until = None
        for step, findings in _watched(watched, chain(first, _steps(log, silence)), silence):
            for finding in findings:
                if as_lines:
                    print_lines(str(finding))
                else:
                    print_json(finding.to_dict(), indent=None)
            if record is not None:
                record.add(step, findings, log.start)
            if findings and findings[-1].status in ENDS:
                until = findings[-1].time + (0.0 if record is None else AFTER)
            if until is not None and (step is None or step.time >= until):
                break
    if record is not None and record.note:
        print_notes(record.note)


def _watched(
    watched: Watch, steps: Iterator[Sample | None], silence: float | None
) -> Iterator[tuple[Sample | None, Sequence[Finding]]]:
    """Yields the steps with their findings; None is a silence, after which the last one is said."""
    last, is_stale, now = None, False, 0.0
    for step in steps:
        found: Sequence[Finding]
        if step is None:
            is_stale = last is None or last.status not in ENDS
            found = [Finding(now, "stale", f"no step for {silence:g} s")] if is_stale else []
        else:
            found, now = watched.update(step), round(step.time, 6)
            if is_stale and last is not None:
                found = [replace(last, time=now), *found]
            last, is_stale = found[-1] if found else last, False
        yield step, found


def _steps(log: GrowingLog, silence: float | None) -> Iterator[Sample | None]:
    """Yields the further steps of a log in order.

    With a silence, s, they are awaited, and None is yielded once if none came for that time.
    """
    has_caught_up, is_behind = False, False
    heard: float | None = time.monotonic()
    while not log.has_ended:
        new = log.new_steps()
        was_behind, is_behind = is_behind, has_caught_up and len(new) > MOST_NEW
        if is_behind and not was_behind:
            print_notes(f"note: behind by {counted(len(new), 'step')}")
        yield from new
        if new:
            heard = time.monotonic()
        if new or log.has_ended:
            continue
        if silence is None:
            print_notes(f"note: {log.path} has no end: it is cut, or --follow waits for what comes")
            return
        has_caught_up = True
        if heard is not None and time.monotonic() - heard >= silence:
            heard = None
            yield None
        time.sleep(POLL)
    print_notes(f"{log.path}: {counted(log.steps, 'step')}")
