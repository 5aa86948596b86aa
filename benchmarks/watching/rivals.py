"""Other methods on the streams of the watches: false alarms, delays, and the part that is named.

The largest healthy scores are those of the second halves of the healthy trials. An alarm is a score
of at least a threshold times these, and names the part where it is the most. No method is told that
an alarm was false: it may come again after ``HOLD``.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from benchmarks.foreign.robots import robot
from benchmarks.watching.monitors import METHODS, Scores
from benchmarks.watching.streams import FAULTS, Failing, Machine
from selfmodel import Trial
from selfmodel.studies.study import Row

MINUTES = 10.0
"""Length of the healthy stream, min."""

MARGIN = 1.25
"""Threshold of a user who knows the healthy trials alone, over their largest score."""

HOLD = 5.0
"""Time after an alarm until the next one, s: as long as a watch seeks a cause, at most."""


def compared(machine: Machine, key: Row) -> Row:
    """Returns alarms of a method on the streams of a machine, by two thresholds.

    ``healthy`` is the threshold of a user. ``oracle`` is the smallest one without an alarm in the
    healthy stream on which false alarms are counted: an advantage that nobody has.
    """
    streams, method = streams_of(machine), METHODS[key["method"]]
    scorer = method.fitted(machine, streams.healthy)
    held_out = []
    for trial in streams.healthy:
        steps, values, _ = scorer(trial)
        held_out.append(values[steps >= trial.trajectory.steps // 2])
    largest = np.concatenate(held_out).max(axis=None if method.in_common else 0)

    def ratios(trial: Trial) -> Scores:
        found = scorer(trial)
        return found._replace(values=found.values / largest)

    healthy = ratios(streams.watched)
    failing = [(ratios(one.trial), one) for one in streams.failing]
    thresholds = {"healthy": MARGIN, "oracle": float(np.nextafter(healthy.values.max(), np.inf))}
    return {
        "minutes": MINUTES,
        "thresholds": {
            name: _judged(machine, healthy, failing, threshold)
            for name, threshold in thresholds.items()
        },
    }


def _judged(
    machine: Machine,
    healthy: Scores,
    failing: Sequence[tuple[Scores, Failing]],
    threshold: float,
) -> Row:
    """Returns the threshold, false alarms, and of each case the delay and if the part is right."""
    step = machine.model.control_timestep
    row: Row = {"ratio": round(threshold, 4), "alarms": len(alarms(healthy, threshold, step))}
    for case, (scores, (notation, onset, _)) in zip(FAULTS, failing, strict=True):
        found = alarms(scores, threshold, step)
        late = [(time, part) for time, part in found if time >= onset]
        right = bool(late) and late[0][1] in parts_of(machine.robot, notation)
        row[case] = {
            "onset": onset,
            "early": len(found) - len(late),
            "delay": round(late[0][0] - onset, 3) if late else None,
            "right": right,
        }
    return row


def alarms(scores: Scores, threshold: float, step: float) -> list[tuple[float, str]]:
    """Returns time, s, and part of each alarm."""
    found = list[tuple[float, str]]()
    for k in np.flatnonzero((scores.values >= threshold).any(axis=1)):
        time = round(float(scores.steps[k]) * step, 6)
        if not found or time >= found[-1][0] + HOLD:
            found.append((time, scores.parts[int(scores.values[k].argmax())]))
    return found


def parts_of(name: str, notation: str) -> tuple[str, ...]:
    """Returns the parts that are right for a fault: of a lost limb, all that are lost."""
    kind, _, part = notation.partition("=")[0].partition(":")
    return (part, *robot(name).part(part).beyond) if kind == "break" else (part,)


class Streams(NamedTuple):
    """The streams of a machine: those of its watch, with a fault of each case."""

    healthy: list[Trial]
    watched: Trial
    failing: list[Failing]


@lru_cache(maxsize=1)
def streams_of(machine: Machine) -> Streams:
    """Returns the streams of a machine."""
    failing = [machine.failing(case, 0) for case in FAULTS]
    return Streams(machine.healthy(), machine.watched("known", MINUTES), failing)
