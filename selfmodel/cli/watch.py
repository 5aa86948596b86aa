"""``selfmodel watch``: findings about a robot while its trial log is written, or from one."""

import sys
import time
from collections.abc import Iterator
from itertools import chain

from selfmodel import arguments, plugins
from selfmodel.cli.commands import WatchLog
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.errors import counted
from selfmodel.logs.growing import GrowingLog
from selfmodel.logs.writer import FLUSH_STEPS
from selfmodel.trials.trajectory import Sample
from selfmodel.watching.finding import ENDS
from selfmodel.watching.watch import Watch

POLL = 0.05
"""Time between two looks at a log that grows, s."""

MOST_NEW = 2 * FLUSH_STEPS
"""New steps that a look may find: a trial is written in parts of ``FLUSH_STEPS``."""


def watch(options: WatchLog) -> None:
    """Prints the findings about a robot, each as soon as the log contains what shows it.

    It ends with the log, or with the finding that ends the watch.
    """
    logs = arguments.read_logs(options.healthy)
    robot = arguments.robot_of_logs(logs, options.self_model)
    as_lines = sys.stdout.isatty() and not options.as_json
    with GrowingLog(options.file, robot.anatomy.names) as log:
        first = log.new_steps()  # a file that is no log of the robot is refused before the fit
        watched = Watch(
            robot,
            [one.trial for one in logs],
            kinds=plugins.kinds(options.kinds),
            false_alarm_every=options.false_alarm_every,
            calibrate=options.calibrate,
            threads=options.threads,
        )
        for step in chain(first, _steps(log, follow=options.follow)):
            for finding in watched.update(step):
                if as_lines:
                    print_lines(str(finding))
                else:
                    print_json(finding.to_dict(), indent=None)
                if finding.status in ENDS:
                    return


def _steps(log: GrowingLog, *, follow: bool) -> Iterator[Sample]:
    """Yields the further steps of a log in order, as they are written if it is followed."""
    has_caught_up, is_behind = False, False
    while not log.has_ended:
        new = log.new_steps()
        was_behind, is_behind = is_behind, has_caught_up and len(new) > MOST_NEW
        if is_behind and not was_behind:
            print_notes(f"note: behind by {counted(len(new), 'step')}")
        yield from new
        if new or log.has_ended:
            continue
        if not follow:
            print_notes(f"note: {log.path} has no end: it is cut, or --follow waits for what comes")
            return
        has_caught_up = True
        time.sleep(POLL)
    print_notes(f"{log.path}: {counted(log.steps, 'step')}")
