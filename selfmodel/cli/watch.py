"""``selfmodel watch``: findings about a robot while its trial log is written, or from one."""

import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
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
from selfmodel.watching.finding import ENDS
from selfmodel.watching.watch import Watch

POLL = 0.05
"""Time between two looks at a log that grows, s."""


def watch(options: WatchLog) -> None:
    """Prints the findings about a robot, each as soon as the log contains what shows it.

    It ends with the log, or with the finding that ends the watch.
    """
    logs = arguments.read_logs(options.healthy)
    robot = arguments.robot_of_logs(logs, options.self_model)
    as_lines = sys.stdout.isatty() and not options.as_json
    with _opened(options, robot) as steps:
        watched = Watch(
            robot,
            [one.trial for one in logs],
            kinds=plugins.kinds(options.kinds),
            false_alarm_every=options.false_alarm_every,
            calibrate=options.calibrate,
            threads=options.threads,
        )
        for step in steps:
            for finding in watched.update(step):
                if as_lines:
                    print_lines(str(finding))
                else:
                    print_json(finding.to_dict(), indent=None)
                if finding.status in ENDS:
                    return


@contextmanager
def _opened(options: WatchLog, robot: Robot) -> Iterator[Iterator[Sample]]:
    """Opens a log or a recording, of which a first look refuses what is none, and has its steps."""
    follow, mapping = options.follow, options.mapping
    if options.run is not None and (follow or mapping is None):
        raise InputError("--run is for a finished recording: it needs --mapping, without --follow")
    if mapping is not None and not follow:
        found = import_recording(options.file, read_mapping(mapping), robot, options.run)
        for note in found.notes:
            _note(note)
        yield samples_of(found.trajectory)
        return
    log: GrowingLog | GrowingBag
    if mapping is None:
        log = GrowingLog(options.file, robot.anatomy.names)
    else:
        log = GrowingBag(options.file, read_mapping(mapping), robot, _note)
    with closing(log):
        yield chain(log.new_steps(), _steps(log, follow=follow))


def _note(sentence: str) -> None:
    print_notes(f"note: {sentence}")


def _steps(log: GrowingLog | GrowingBag, *, follow: bool) -> Iterator[Sample]:
    """Yields the further steps of a log in order, as they are written if it is followed."""
    has_caught_up, is_behind = False, False
    while not log.has_ended:
        new = log.new_steps()
        was_behind, is_behind = is_behind, has_caught_up and len(new) > log.most_new
        if is_behind and not was_behind:
            _note(f"behind by {counted(len(new), 'step')}")
        yield from new
        if new or log.has_ended:
            continue
        if not follow:
            _note(f"{log.path} has no end: it is cut, or --follow waits for what comes")
            return
        has_caught_up = True
        time.sleep(POLL)
    print_notes(f"{log.path}: {counted(log.steps, 'step')}")
