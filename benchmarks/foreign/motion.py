"""Gaits, and the motion of a robot under one, simulated in phases with a model each."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from benchmarks.foreign.model import ACTUATOR, JOINT, SENSOR, ids
from benchmarks.foreign.robots import Robot

HIDDEN = 6
"""Hidden neurons of a network."""

TAIL = 0.1
"""Time that the gait goes on after the trial, s."""

Gait = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""The commanded angles, rad, at a time, s, from the hinges' angles, rad, and 1 for each foot on the
ground."""


def draw_gait(robot: Robot, kind: str, rng: np.random.Generator) -> Gait:
    """Returns a random gait, which grows in the first half second.

    Its kind is ``playback``, a sinusoid per motor; ``trot``, one sinusoid for each motor of a leg
    and every second leg in antiphase; ``stride`` or ``walk``, the legs of a Go2 in pairs or one
    after the other; or ``network``, a hidden layer of tanh neurons with a clock
    of two phases as inputs. The joints' ranges are those of the commands.
    """
    if kind in ("stride", "walk"):
        return _strides(rng, (0.0, 0.5, 0.5, 0.0) if kind == "stride" else (0.0, 0.5, 0.75, 0.25))
    model = robot.spec().compile()
    limits = np.array([model.joint(hinge).range for hinge in robot.motors.values()])
    centre, half = limits.mean(axis=1), (limits[:, 1] - limits[:, 0]) / 2
    motors, frequency = len(robot.motors), rng.uniform(*robot.frequencies)
    if kind == "network":
        inputs = len(robot.touches) + len(robot.hinges) + 3
        inward = rng.normal(0, 0.7, (HIDDEN, inputs))
        outward = rng.normal(0, 0.8, (motors, HIDDEN))

        def network(time: float, angles: np.ndarray, touch: np.ndarray) -> np.ndarray:
            clock = 2 * np.pi * frequency * time
            seen = np.concatenate([touch, angles, [2 * np.sin(clock), 2 * np.cos(clock), 1.0]])
            outputs = np.tanh(outward @ np.tanh(inward @ seen))
            return np.asarray(centre + min(time / 0.5, 1.0) * half * outputs)

        return network
    amplitude = rng.uniform(*robot.amplitudes, motors)
    phase, offset = rng.uniform(0, 2 * np.pi, motors), rng.uniform(-0.3, 0.3, motors)
    if kind == "trot":
        place, leg = _places_of_motors(robot, model)
        amplitude, offset = amplitude[place], offset[place]
        phase = phase[place] + np.pi * (leg % 2)

    def sinusoids(time: float, _angles: np.ndarray, _touch: np.ndarray) -> np.ndarray:
        wave = np.sin(2 * np.pi * frequency * time + phase)
        return np.asarray(centre + min(time / 0.5, 1.0) * half * (amplitude * wave + offset))

    return sinusoids


def _strides(rng: np.random.Generator, phases: Sequence[float]) -> Gait:
    """Returns a gait of four legs of hip, thigh and calf, which swing and lift by their phases."""
    frequency, swing, lift = rng.uniform(1.5, 2.2), rng.uniform(0.1, 0.2), rng.uniform(0.2, 0.35)

    def strides(time: float, _angles: np.ndarray, _touch: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * (frequency * time + np.array(phases))
        grown = min(time / 0.5, 1.0)
        thigh = 0.9 + grown * swing * np.cos(angle)
        calf = -1.8 - grown * lift * np.maximum(0.0, np.sin(angle))
        return np.stack([np.zeros(4), thigh, calf], axis=1).ravel()

    return strides


def _places_of_motors(robot: Robot, model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Returns the place of each motor within its leg, and the number of its leg around the body."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    feet = {
        name: data.body(body).xpos - data.body(robot.root).xpos
        for name, body in robot.touches.items()
    }
    around = sorted(feet, key=lambda name: float(np.arctan2(feet[name][1], feet[name][0])))
    legs, places = list[int](), list[int]()
    for hinge in robot.motors.values():
        (foot,) = next(part.touches for part in robot.parts if hinge in part.hinges)
        places.append(legs.count(around.index(foot)))
        legs.append(around.index(foot))
    return np.array(places), np.array(legs)


@dataclass(frozen=True)
class Phase:
    """A part of a trial, with the effects of its faults outside the model."""

    start: float
    model: Callable[[dict[str, float]], mujoco.MjModel]
    """Makes its model from the hinges' angles at its start, rad by hinge."""
    offsets: dict[str, float]
    """Offset of the encoder of each hinge, rad: the servo holds the encoder's angle."""
    fixed: dict[str, float]
    """Angle of each hinge that is welded, rad; NaN for its angle at the start."""
    dead: frozenset[str] = frozenset()
    """Touch sensors that read 0."""
    swapped: tuple[str, ...] = ()
    """Two motors that receive each other's commands."""
    delay: float = 0.0
    """Further delay of commands, s."""


@dataclass(frozen=True)
class Motion:
    """Result of a simulation: rows of states, and of commands."""

    time: np.ndarray
    angles: np.ndarray
    """Of each hinge, rad; NaN for those of detached limbs."""
    speeds: np.ndarray
    pose: np.ndarray
    """Position, m, and orientation, w x y z, of the root body."""
    twist: np.ndarray
    """Linear velocity, world frame, m/s, and angular velocity, body frame, rad/s, of the root."""
    command_time: np.ndarray
    commands: np.ndarray
    touch: np.ndarray
    """Force at each foot as the sensor reports it, N."""

    @classmethod
    def of(
        cls, robot: Robot, rows: list[np.ndarray], commands: list[np.ndarray], touch: np.ndarray
    ) -> "Motion":
        """Returns a motion of rows of time, pose, twist, angles and speeds."""
        time, pose, twist, angles, speeds = np.split(
            np.array(rows), [1, 8, 14, 14 + len(robot.hinges)], axis=1
        )
        clock = robot.control_timestep * np.arange(len(commands))
        return cls(time[:, 0], angles, speeds, pose, twist, clock, np.array(commands), touch)

    def displacement(self, duration: float) -> np.ndarray:
        """Returns the horizontal displacement of the root body from time 0, ``(2,)`` m."""
        last = int(np.searchsorted(self.time, duration - 1e-9))
        return np.asarray(self.pose[min(last, len(self.pose) - 1), :2] - self.pose[0, :2])

    def is_upright(self) -> bool:
        """Returns whether the root's z axis ends within 60 degrees of the world's."""
        w, x, y, z = self.pose[-1, 3:]
        return bool(w * w - x * x - y * y + z * z > 0.5)


class _Plant:
    """One model in motion, and the places of its parts by name."""

    def __init__(self, robot: Robot, phase: Phase, angles: dict[str, float]) -> None:
        model = phase.model(angles)
        self.model, self.data = model, mujoco.MjData(model)
        fixed = {h: angles[h] if np.isnan(angle) else angle for h, angle in phase.fixed.items()}
        self.fixed = np.array([fixed.get(hinge, np.nan) for hinge in robot.hinges])
        hinges = ids(model, JOINT, list(robot.hinges))
        self.there = hinges >= 0
        self.qpos = model.jnt_qposadr[hinges[self.there]]
        self.qvel = model.jnt_dofadr[hinges[self.there]]
        motors = ids(model, ACTUATOR, list(robot.motors))
        touches = ids(model, SENSOR, list(robot.touches))
        self.driven, self.motors = np.flatnonzero(motors >= 0), motors[motors >= 0]
        self.felt, self.touches = touches >= 0, model.sensor_adr[touches[touches >= 0]]
        mujoco.mj_forward(model, self.data)

    @property
    def angles(self) -> np.ndarray:
        """Angle of each hinge, rad; NaN for those of detached limbs."""
        full = self.fixed.copy()
        full[self.there] = self.data.qpos[self.qpos]
        return full

    @property
    def speeds(self) -> np.ndarray:
        """Angular velocity of each hinge, rad/s; 0 for welded ones and those of detached limbs."""
        full = np.zeros(len(self.there))
        full[self.there] = self.data.qvel[self.qvel]
        return full

    def take_over(self, other: "_Plant") -> None:
        """Continues the motion of another plant."""
        self.data.qpos[:7], self.data.qvel[:6] = other.data.qpos[:7], other.data.qvel[:6]
        self.data.qpos[self.qpos] = other.angles[self.there]
        self.data.qvel[self.qvel] = other.speeds[self.there]
        self.data.time = other.data.time
        mujoco.mj_forward(self.model, self.data)

    def row(self) -> np.ndarray:
        """Returns time, pose and twist of the root, angles and speeds."""
        data = self.data
        return np.concatenate([[data.time], data.qpos[:7], data.qvel[:6], self.angles, self.speeds])


def simulate(
    robot: Robot,
    phases: Sequence[Phase],
    gait: Gait,
    duration: float,
    latency: Callable[[], float] = lambda: 0.0,
) -> Motion:
    """Simulates a trial of a duration, and of ``TAIL`` after it, s, in phases from time 0 on.

    ``latency`` draws the delay of a command, s.
    """
    left, waiting = deque(phases), deque[tuple[float, np.ndarray]]()
    phase = left.popleft()
    plant = _Plant(robot, phase, {})
    motors = list(robot.motors)
    rows: list[np.ndarray] = []
    commands: list[np.ndarray] = []
    touches: list[np.ndarray] = []
    count = round((duration + TAIL) / robot.control_timestep)
    for step in range(count):
        now = step * robot.control_timestep
        if left and now >= left[0].start - 1e-9:
            phase, before = left.popleft(), plant
            plant = _Plant(robot, phase, dict(zip(robot.hinges, before.angles, strict=True)))
            plant.take_over(before)
            waiting = deque([(now, commands[-1])])
        force = np.zeros(len(robot.touches))
        force[plant.felt] = plant.data.sensordata[plant.touches]
        force[[k for k, name in enumerate(robot.touches) if name in phase.dead]] = 0.0
        measured = plant.angles + [phase.offsets.get(hinge, 0.0) for hinge in robot.hinges]
        commands.append(gait(now, np.nan_to_num(measured), (force > 0).astype(float)))
        touches.append(force)
        due = now + latency() + phase.delay
        waiting.append((max(due, waiting[-1][0] if waiting else 0.0), commands[-1]))
        shift = np.array([phase.offsets.get(hinge, 0.0) for hinge in robot.motors.values()])
        order = np.arange(len(motors))
        if phase.swapped:
            swapped = [motors.index(name) for name in phase.swapped]
            order[swapped] = swapped[::-1]
        for _ in range(round(robot.control_timestep / plant.model.opt.timestep)):
            while waiting and waiting[0][0] <= plant.data.time + 1e-9:
                sent = waiting.popleft()[1][order] - shift
                plant.data.ctrl[plant.motors] = sent[plant.driven]
            rows.append(plant.row())
            mujoco.mj_step(plant.model, plant.data)
    return Motion.of(robot, rows, commands, np.array(touches))
