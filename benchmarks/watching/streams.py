"""Streams of the independent generator: robots with a gap, in gaits that change, with a fault.

A stream is what the log of such a robot has: angles, speeds, base and feet at each control step,
with the noise of the generator's recorder, and the commands. No recording is written.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import NamedTuple

import numpy as np

import selfmodel
from benchmarks.foreign.cases import Fault, Faults, stream
from benchmarks.foreign.generate import CANDIDATES, Plan, by_displacement, phase_of
from benchmarks.foreign.model import LEVELS, compiled, draw_gap
from benchmarks.foreign.motion import Gait, Motion, draw_gait, simulate
from benchmarks.foreign.recorder import Noise
from benchmarks.foreign.robots import Robot, robot
from selfmodel import Trial, Watch

GAITS = 4
"""Gaits of a robot."""

PASSAGE = 0.5
"""Time in which one gait passes into the next, s."""

NEW = 1000
"""Added to the seed of a robot for gaits that its healthy trials do not have."""

HEALTHY, HEALTHY_PERIOD = 80.0, 10.0
"""Length of each of the two healthy trials, and time of a gait in them, s."""

PERIOD = 30.0
"""Time of a gait in a stream that is watched, s."""

ONSETS, AFTER = (8.0, 14.0), 8.0
"""Range of the onset of a fault, and time of the stream after it, s."""

FAULTS = ("break", "jam", "sensor", "motor")


class Failing(NamedTuple):
    """A stream of a robot that fails: the notation of the fault, its onset, s, and the trial."""

    notation: str
    onset: float
    trial: Trial


@dataclass(frozen=True)
class Machine:
    """A physical robot: its name, the level of its gap, and its seed."""

    robot: str
    gap: str
    seed: int

    @property
    def model(self) -> selfmodel.Robot:
        """Its nominal model."""
        return selfmodel.load_robot(self.robot)

    def healthy(self) -> list[Trial]:
        """Returns two healthy trials in all its gaits."""
        return [self.trial(f"healthy-{k}", HEALTHY, HEALTHY_PERIOD) for k in range(2)]

    def watched(self, gaits: str, minutes: float) -> Trial:
        """Returns a healthy stream, in ``known`` or ``new`` gaits."""
        seed = self.seed + NEW if gaits == "new" else self.seed
        return self.trial(f"watched-{gaits}", 60 * minutes, PERIOD, gaits_of=seed)

    def failing(self, case: str, draw: int) -> Failing:
        """Returns a stream with a fault of a case."""
        rng = stream(self.seed, self.robot, case, str(draw))
        fault, notation = drawn(self.robot, case, rng)
        onset = round(float(rng.uniform(*ONSETS)), 2)
        duration, name = onset + AFTER, f"{case}-{draw}"
        trial = self.trial(name, duration, HEALTHY_PERIOD, faults=(fault,), onset=onset)
        return Failing(notation, onset, trial)

    def trial(
        self,
        name: str,
        duration: float,
        period: float,
        *,
        faults: Faults = (),
        onset: float = 0.0,
        gaits_of: int | None = None,
    ) -> Trial:
        """Returns a stream, in which a random gait follows another after a period, s.

        Faults begin at the onset, s. ``gaits_of`` is another seed to draw the gaits from.
        """
        machine, level = robot(self.robot), LEVELS[self.gap]
        rng = stream(self.seed, self.robot, self.gap, name)
        gap = draw_gap(machine, level, stream(self.seed, self.robot, "watched gap"))
        delay, spread = gap.latency
        phases = [phase_of(0.0, machine, (), partial(compiled, machine, gap, ()))]
        if faults:
            phases.append(phase_of(onset, machine, faults, partial(compiled, machine, gap, faults)))
        gaits = gaits_for(self.robot, self.seed if gaits_of is None else gaits_of)
        motion = simulate(
            machine,
            phases,
            _in_turn(gaits, period, rng),
            duration,
            lambda: delay + spread * rng.uniform(-1, 1),
        )
        return _measured(machine, motion, Noise().scaled(level), rng, name)


@cache
def watch_of(machine: Machine) -> Watch:
    """Returns the watch of a physical robot, by its healthy trials."""
    return Watch(machine.robot, machine.healthy())


def drawn(name: str, case: str, rng: np.random.Generator) -> tuple[Fault, str]:
    """Returns the fault of a case at a random part, and its notation; a jam is where it is."""
    machine = robot(name)
    if case == "sensor":
        part = str(rng.choice(list(machine.touches)))
        return Fault("dead-sensor", part), f"sensor:{part}"
    part = str(rng.choice([part.name for part in machine.parts if len(part.hinges) == 1]))
    if case == "break":
        return Fault("lost", part), f"break:{part}"
    if case == "jam":
        return Fault("jam", part, float("nan")), f"jam:{part}"
    return Fault("motor", part, 0.5), f"motor:{part}=0.5"


@cache
def gaits_for(name: str, seed: int) -> list[Gait]:
    """Returns gaits of a seed: of those that are drawn, the ones that go the farthest."""
    machine, rng = robot(name), stream(seed, name, "watched gaits")
    drawn = [draw_gait(machine, "playback", rng) for _ in range(CANDIDATES)]
    return by_displacement(machine, Plan(name, "healthy", seed, "none"), drawn)[:GAITS]


def _in_turn(gaits: Sequence[Gait], period: float, rng: np.random.Generator) -> Gait:
    """Returns a gait that is one of some in each period, all of them before any comes again."""
    order: list[int] = []

    def gait(time: float, angles: np.ndarray, touch: np.ndarray) -> np.ndarray:
        number = int(time / period)
        while len(order) <= number:
            order.extend(rng.permutation(len(gaits)).tolist())
        now = gaits[order[number]](time, angles, touch)
        share = min((time - number * period) / PASSAGE, 1.0)
        if not number or share >= 1.0:
            return now
        return np.asarray(share * now + (1 - share) * gaits[order[number - 1]](time, angles, touch))

    return gait


def _measured(
    machine: Robot, motion: Motion, noise: Noise, rng: np.random.Generator, name: str
) -> Trial:
    """Returns what is measured at the control steps; the encoders of a lost limb freeze."""
    steps = np.searchsorted(motion.time, motion.command_time - 1e-9)

    def noisy(values: np.ndarray, deviation: float) -> np.ndarray:
        return np.asarray(values + rng.normal(0, deviation, values.shape))

    model = selfmodel.load_robot(machine.name)
    anatomy = model.anatomy
    hinges = [machine.hinges.index(hinge) for hinge in anatomy.hinges]
    angles, speeds = (rows[steps][:, hinges] for rows in (motion.angles, motion.speeds))
    lost = np.isnan(angles)
    angles, speeds = noisy(angles, noise.angle), noisy(speeds, noise.speed)
    for k in np.flatnonzero(lost.any(axis=0)):
        first = int(np.argmax(lost[:, k]))
        angles[first:, k], speeds[first:, k] = angles[first - 1, k], 0.0
    pose, twist = motion.pose[steps], motion.twist[steps]
    turn = noisy(pose[:, 3:], noise.orientation / 2)
    touch, feet = (motion.touch > 0).astype(float), list(machine.touches)
    readings = [
        touch[:, feet.index(sensor.name)]
        if sensor.kind == "touch"
        else (angles[:, anatomy.hinges.index(sensor.hinge)] - sensor.centre) / sensor.half_range
        for sensor in anatomy.sensors
    ]
    return Trial.from_arrays(
        model,
        angles,
        motion.commands,
        motor_names=list(machine.motors),
        joint_velocities=speeds,
        sensors=np.stack(readings, axis=1),
        base_position=noisy(pose[:, :3], noise.position),
        base_orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
        base_linear_velocity=noisy(twist[:, :3], noise.linear),
        base_angular_velocity=noisy(twist[:, 3:], noise.angular),
        name=name,
    )
