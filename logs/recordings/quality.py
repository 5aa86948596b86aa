"""Recording quality of a topic, and warnings about an imported trial."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from selfmodel.logs.recordings.mapping import NONE, Place, Trial
from selfmodel.logs.recordings.recording import Recording, Series
from selfmodel.logs.recordings.resample import MAX_MEASUREMENT, Clocked, reach
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Trajectory

MAX_INITIAL_DIFFERENCE = 0.1
"""Difference from the model's initial pose above which a joint is listed, rad."""

MAX_GAPS_IN_FACTS, MAX_GAPS_IN_NOTES = 100, 5
"""Maximum listed gaps of a topic."""


class Gap(NamedTuple):
    """Time between two messages that is longer than ``resample.reach``, s, from the start."""

    start: float
    length: float


@dataclass(frozen=True)
class Quality:
    """Recording quality of a topic.

    Attributes:
        roles: Roles of the topic.
        rate: Message rate from the median period, 1/s; None for fewer than two messages.
        jitter: Standard deviation of the period without gaps, s; None for fewer than two messages.
        longest: Longest period, s; None for fewer than two messages.
        latency: Median of log time minus stamp, s; None without stamps.
        latency_max: Maximum of log time minus stamp, s; None without stamps.
        fallbacks: Number of messages without a stamp, which have their log time.
        strays: Number of messages left out because their stamp is far from all others.
        repeated: Number of messages left out because of a repeated stamp.
        reordered: Number of messages recorded after a later stamp, and sorted.
        refused: Numbers of messages left out because they contradict themselves, by reason.
    """

    roles: tuple[str, ...]
    type: str
    messages: int
    rate: float | None
    jitter: float | None
    longest: float | None
    gaps: tuple[Gap, ...]
    latency: float | None
    latency_max: float | None
    fallbacks: int
    strays: int
    repeated: int
    reordered: int
    refused: Mapping[str, int]

    def facts(self) -> dict[str, Any]:
        """Returns the quality as JSON values, with the first gaps."""
        longest = max((gap.length for gap in self.gaps), default=0.0)
        where = [list(gap) for gap in self.gaps[:MAX_GAPS_IN_FACTS]]
        return asdict(self) | {
            "gaps": {"count": len(self.gaps), "longest": longest, "where": where}
        }


def quality(
    series: Series, clock: Clocked, origin: int, timestep: float, roles: tuple[str, ...]
) -> Quality:
    """Returns the quality of a topic in a trial that starts at ``origin``, ns, with steps in s."""
    usable = clock.times[clock.usable]
    times = np.unique(usable)
    periods = np.diff(times) / 1e9
    usual = float(np.median(periods)) if len(periods) else None
    silent = periods > reach(times, timestep * 1e9)[:-1] / 1e9
    return Quality(
        roles=roles,
        type=series.type,
        messages=series.count,
        rate=None if usual is None else 1 / usual,
        jitter=float(np.std(periods[~silent])) if len(periods) else None,
        longest=float(periods.max()) if len(periods) else None,
        gaps=tuple(
            Gap(float(times[k] - origin) / 1e9, float(periods[k])) for k in np.flatnonzero(silent)
        ),
        latency=float(np.median(clock.latency)) if len(clock.latency) else None,
        latency_max=float(clock.latency.max()) if len(clock.latency) else None,
        fallbacks=clock.fallbacks,
        strays=int(np.sum(~clock.usable)),
        repeated=len(usable) - len(times),
        reordered=int(np.sum(usable < np.maximum.accumulate(usable))) if len(usable) else 0,
        refused=dict(series.refused),
    )


def no_measurements(recording: Recording, places: Iterable[Place]) -> Iterator[str]:
    """Yields warnings about numbers that cannot be measurements, and are as missing as NaN."""
    used = dict.fromkeys(
        (place.topic, name, place.numbers) for place in places for name in place.columns
    )
    counts: dict[str, Counter[str]] = {}
    for topic, name, numbers in used:
        if column := recording.series[topic].columns.get(name):
            large = np.abs(column.values[:, slice(*numbers)]) > MAX_MEASUREMENT
            counts.setdefault(topic, Counter())[name or topic] += int(large.sum())
    for topic, found in counts.items():
        if parts := [f"{count} of {name}" for name, count in found.items() if count]:
            limit = f"infinite or above {MAX_MEASUREMENT:g}"
            yield f"{topic}: numbers left out, as they are {limit}: {', '.join(parts)}"


def notes(
    trial: Trial, trajectory: Trajectory, qualities: Mapping[str, Quality], robot: Robot
) -> tuple[str, ...]:
    """Returns the warnings, one sentence each, most important first."""
    return (
        *_pose(trajectory, robot),
        *_of_topics(trial, trajectory, qualities),
        *_unobserved(trial, trajectory),
    )


def _pose(trajectory: Trajectory, robot: Robot) -> Iterator[str]:
    start = [robot.model.joint(name).qpos0[0] for name in trajectory.names.hinges]
    apart = np.abs(trajectory["joint_positions"][0] - start)
    far = [
        f"{name} {difference:.2f}"
        for name, difference in zip(trajectory.names.hinges, apart, strict=True)
        if difference > MAX_INITIAL_DIFFERENCE
    ]
    if far:
        yield (
            f"at the start these joints are far from the model's start pose, from which every "
            f"simulation begins (rad): {', '.join(far)}"
        )
    x = trajectory["base_position"][:, 0]
    if np.isnan(x).all():
        yield "where the base was is not known, so this trial says nothing of displacement"
    elif np.isnan(x[[0, -1]]).any():
        yield (
            "where the base was at the start or at the end is not known, so the trial has no "
            "displacement: set another start or duration"
        )


def _of_topics(
    trial: Trial, trajectory: Trajectory, qualities: Mapping[str, Quality]
) -> Iterator[str]:
    if trial.time is None and trial.clock == "log":
        yield 'all times are log times, as clock = "log" says: latency is part of them'
    else:
        for topic, found in qualities.items():
            if found.fallbacks:
                yield (
                    f"{topic}: {found.fallbacks} of {found.messages} messages have no time stamp "
                    f"and go by log time, latency included"
                )
    for topic, found in qualities.items():
        yield from _gaps(topic, trajectory, found)
    for topic, found in qualities.items():
        reasons = [f"{count} {reason}" for reason, count in found.refused.items()]
        if found.repeated:
            reasons.append(f"{found.repeated} with a stamp that another has")
        if found.strays:
            reasons.append(f"{found.strays} with a stamp far from its log time")
        if reasons:
            yield f"{topic}: messages left out: {', '.join(reasons)}"
        if found.reordered:
            yield f"{topic}: {found.reordered} messages came out of order and were sorted"


def _gaps(topic: str, trajectory: Trajectory, found: Quality) -> Iterator[str]:
    end = float(trajectory.time[-1])
    within = [gap for gap in found.gaps if gap.start < end and gap.start + gap.length > 0]
    if not within or found.roles == ("commands",):  # a command is held until the next
        return
    listed = [
        f"{gap.length * 1e3:.0f} ms at {gap.start:.3f} s" for gap in within[:MAX_GAPS_IN_NOTES]
    ]
    if len(within) > MAX_GAPS_IN_NOTES:
        listed.append(f"{len(within) - MAX_GAPS_IN_NOTES} more")
    starts, lengths = np.array(within).T
    first = np.searchsorted(trajectory.time, starts, side="right")
    last = np.searchsorted(trajectory.time, starts + lengths, side="left")
    rows = int(np.sum(np.maximum(last - first, 0)))
    yield f"{topic}: silent for {', '.join(listed)}; rows marked as not observed: {rows}"


def _unobserved(trial: Trial, trajectory: Trajectory) -> Iterator[str]:
    joints = {"angle": trajectory["joint_positions"], "velocity": trajectory["joint_velocities"]}
    for quantity, values in joints.items():
        seen = np.isfinite(values)
        if not seen.any():
            continue
        end = np.flatnonzero(seen.any(axis=1))[-1]
        for name, column in zip(trajectory.names.hinges, seen.T, strict=True):
            steps = np.flatnonzero(column)
            if not len(steps):
                reason = f", as {NONE!r} says" if name not in trial.joints.links else ""
                yield f"no {quantity} of {name} was observed{reason}"
            elif steps[-1] < end:
                since = trajectory.time[steps[-1] + 1]
                yield f"no {quantity} of {name} was observed from {since:.3f} s on"
    nothing = [name for name, rows in trajectory.signals.items() if np.isnan(rows).all()]
    if nothing:
        yield f"not observed at all: {', '.join(nothing)}"
    for column, name in enumerate(trajectory.names.sensors):
        if np.isnan(trajectory["sensors"][:, column]).all() and "sensors" not in nothing:
            yield f"the sensor {name} was not observed"
