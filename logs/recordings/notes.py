"""Warnings about an imported recording."""

from collections.abc import Iterator, Mapping

import numpy as np

from selfmodel.logs.recordings.mapping.mapping import NONE, RecordingMapping
from selfmodel.logs.recordings.quality import Quality
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour

MAX_INITIAL_DIFFERENCE = 0.1
"""Difference from the model's initial pose above which a joint is listed, rad."""

MAX_LISTED_GAPS = 5
"""Maximum listed gaps of a topic."""


def notes(
    mapping: RecordingMapping, behaviour: Behaviour, qualities: Mapping[str, Quality], robot: Robot
) -> tuple[str, ...]:
    """Returns the warnings, one sentence each, most important first."""
    return (
        *_pose(behaviour, robot),
        *_travel(behaviour),
        *_clock(mapping, qualities),
        *_gaps(behaviour, qualities),
        *_left_out(qualities),
        *_lost_encoders(mapping, behaviour),
        *_unobserved(behaviour),
    )


def _pose(behaviour: Behaviour, robot: Robot) -> Iterator[str]:
    start = [robot.model.joint(name).qpos0[0] for name in behaviour.names.hinges]
    apart = np.abs(behaviour["joint_positions"][0] - start)
    far = [
        f"{name} {difference:.2f}"
        for name, difference in zip(behaviour.names.hinges, apart, strict=True)
        if difference > MAX_INITIAL_DIFFERENCE
    ]
    if far:
        yield (
            f"at the start these joints are far from the model's start pose, from which every "
            f"simulation begins (rad): {', '.join(far)}"
        )


def _travel(behaviour: Behaviour) -> Iterator[str]:
    x = behaviour["base_position"][:, 0]
    if np.isnan(x).all():
        yield "where the base was is not known, so this trial says nothing of displacement"
    elif np.isnan(x[[0, -1]]).any():
        yield (
            "where the base was at the start or at the end is not known, so the trial has no "
            "displacement: set another start or duration"
        )


def _clock(mapping: RecordingMapping, qualities: Mapping[str, Quality]) -> Iterator[str]:
    if mapping.clock == "log":
        yield 'all times are log times, as clock = "log" says: latency is part of them'
        return
    for topic, found in qualities.items():
        if found.fallbacks:
            yield (
                f"{topic}: {found.fallbacks} of {found.messages} messages have no time stamp and "
                f"go by log time, latency included"
            )


def _gaps(behaviour: Behaviour, qualities: Mapping[str, Quality]) -> Iterator[str]:
    end = float(behaviour.time[-1])
    for topic, found in qualities.items():
        within = [gap for gap in found.gaps if gap.start < end and gap.start + gap.length > 0]
        if not within or found.roles == ("commands",):  # a command is held until the next
            continue
        listed = [
            f"{gap.length * 1e3:.0f} ms at {gap.start:.3f} s" for gap in within[:MAX_LISTED_GAPS]
        ]
        if len(within) > MAX_LISTED_GAPS:
            listed.append(f"{len(within) - MAX_LISTED_GAPS} more")
        starts = np.array([gap.start for gap in within])
        ends = np.array([gap.start + gap.length for gap in within])
        first = np.searchsorted(behaviour.time, starts, side="right")
        last = np.searchsorted(behaviour.time, ends, side="left")
        rows = int(np.sum(np.maximum(last - first, 0)))
        yield f"{topic}: silent for {', '.join(listed)}; rows marked as not observed: {rows}"


def _left_out(qualities: Mapping[str, Quality]) -> Iterator[str]:
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


def _lost_encoders(mapping: RecordingMapping, behaviour: Behaviour) -> Iterator[str]:
    joints = {
        "angle": behaviour["joint_positions"],
        "velocity": behaviour["joint_velocities"],
    }
    for quantity, values in joints.items():
        seen = np.isfinite(values)
        if not seen.any():
            continue
        end = np.flatnonzero(seen.any(axis=1))[-1]
        for name, column in zip(behaviour.names.hinges, seen.T, strict=True):
            steps = np.flatnonzero(column)
            if not len(steps):
                reason = f", as {NONE!r} says" if name in mapping.joints.absent else ""
                yield f"no {quantity} of {name} was observed{reason}"
            elif steps[-1] < end:
                since = behaviour.time[steps[-1] + 1]
                yield f"no {quantity} of {name} was observed from {since:.3f} s on"


def _unobserved(behaviour: Behaviour) -> Iterator[str]:
    nothing = [name for name, rows in behaviour.signals.items() if np.isnan(rows).all()]
    if nothing:
        yield f"not observed at all: {', '.join(nothing)}"
    for column, name in enumerate(behaviour.names.sensors):
        if np.isnan(behaviour["sensors"][:, column]).all() and "sensors" not in nothing:
            yield f"the sensor {name} was not observed"
