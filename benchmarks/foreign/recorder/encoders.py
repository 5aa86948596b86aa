"""Encoders: their directions and offsets, and their angles after their limb is detached."""

from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.faults import Fault
from benchmarks.foreign.robots import Robot
from benchmarks.foreign.world.motion import Motion


@dataclass(frozen=True)
class Encoders:
    """How the encoders are recorded.

    Attributes:
        signs: Direction of each hinge's encoder, 1 or -1.
        offsets: Offset of the encoder of each hinge, rad.
        broken: Behaviour of the encoders of hinges that are lost or not recorded; one of
            ``faults.ENCODERS`` by hinge.
        onset: Time from which ``offsets`` and ``broken`` hold, s.
    """

    signs: dict[str, int]
    offsets: dict[str, float]
    broken: dict[str, str]
    onset: float


def encoders_of(
    robot: Robot, faults: tuple[Fault, ...], onset: float, signs: dict[str, int]
) -> Encoders:
    """Returns how the encoders of a robot with faults are recorded."""
    broken: dict[str, str] = {}
    for fault in faults:
        if fault.kind == "lost":
            broken.update(dict.fromkeys(robot.part(fault.part).beyond, fault.encoders))
        if fault.kind == "encoder":
            broken[fault.part] = fault.encoders
    offsets = {
        robot.part(fault.part).hinges[0]: fault.value
        for fault in faults
        if fault.kind in ("encoder-offset", "encoder-slip")
    }
    return Encoders(signs, offsets, broken, onset)


def encoder_angles(robot: Robot, motion: Motion, encoders: Encoders) -> np.ndarray:
    """Returns the angle of each encoder; those of detached limbs are frozen, or follow commands."""
    angles = motion.angles.copy()
    after = motion.time >= encoders.onset
    commanded = {hinge: k for k, hinge in enumerate(robot.motors.values())}
    for k, hinge in enumerate(robot.hinges):
        angles[after, k] += encoders.offsets.get(hinge, 0.0)
        mode = encoders.broken.get(hinge)
        if mode == "follows":
            targets = interpolated(
                motion.command_time, motion.commands[:, [commanded[hinge]]], motion.time
            )
            angles[after, k] = _lagged(targets[:, 0], motion.time)[after]
        elif np.isnan(angles[:, k]).any():
            known = angles[~np.isnan(angles[:, k]), k]
            angles[np.isnan(angles[:, k]), k] = known[-1] if len(known) else 0.0
    return angles


def _lagged(targets: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Returns the angle of a motor without a load: its command with a lag of 30 ms."""
    found, angle, share = np.empty(len(targets)), 0.0, (time[1] - time[0]) / 0.03
    for k, target in enumerate(targets):
        found[k] = angle
        angle += min(share, 1.0) * (target - angle)
    return found


def interpolated(times: np.ndarray, rows: np.ndarray, when: float | np.ndarray) -> np.ndarray:
    """Returns rows of a table, interpolated linearly; the first row before its start."""
    place = np.clip((np.asarray(when) - times[0]) / (times[1] - times[0]), 0, len(times) - 1)
    low = np.minimum(np.floor(place + 1e-9).astype(int), len(times) - 2)
    part = np.clip(place - low, 0, 1)[..., np.newaxis]
    return np.asarray(rows[low] + part * (rows[low + 1] - rows[low]))
