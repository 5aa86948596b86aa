"""Motion of a robot under a gait, simulated in phases: each phase has a model of its own."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from benchmarks.foreign.robots import Robot
from benchmarks.foreign.world.gaits import Gait

TAIL = 0.1
"""Time that the gait goes on after the trial, s."""


@dataclass(frozen=True)
class Phase:
    """A part of a trial.

    Attributes:
        start: Its start, s.
        model: Makes its model from the hinges' angles at its start, rad by hinge.
        offsets: Offset of the encoder of each hinge, rad: the servo holds the encoder's angle.
        fixed: Angle of each hinge that is welded, rad; NaN for its angle at the start.
        dead: Touch sensors that read 0.
        swapped: Two motors that receive each other's commands; empty without.
        delay: Further delay of commands, s.
    """

    start: float
    model: Callable[[dict[str, float]], mujoco.MjModel]
    offsets: dict[str, float]
    fixed: dict[str, float]
    dead: frozenset[str] = frozenset()
    swapped: tuple[str, ...] = ()
    delay: float = 0.0


@dataclass(frozen=True)
class Motion:
    """Result of a simulation.

    Attributes:
        time: Times of the rows of states, s.
        angles: Angle of each hinge, ``(rows, hinges)`` rad; NaN for those of detached limbs.
        speeds: Angular velocity of each hinge, rad/s.
        pose: Position, m, and orientation, w x y z, of the root body, ``(rows, 7)``.
        twist: Linear velocity in the world frame, m/s, and angular velocity in the body frame,
            rad/s, of the root body, ``(rows, 6)``.
        command_time: Times of the commands, s.
        commands: ``(commands, motors)`` rad.
        touch: Force at each foot as the sensor reports it, ``(commands, feet)`` N.
    """

    time: np.ndarray
    angles: np.ndarray
    speeds: np.ndarray
    pose: np.ndarray
    twist: np.ndarray
    command_time: np.ndarray
    commands: np.ndarray
    touch: np.ndarray

    def displacement(self, duration: float) -> np.ndarray:
        """Returns the horizontal displacement of the root body from time 0, ``(2,)`` m."""
        last = int(np.searchsorted(self.time, duration - 1e-9))
        return np.asarray(self.pose[min(last, len(self.pose) - 1), :2] - self.pose[0, :2])


class _Plant:
    """One model in motion, and the places of its parts by name."""

    def __init__(self, robot: Robot, phase: Phase, angles: dict[str, float]) -> None:
        model = phase.model(angles)
        self.model, self.data = model, mujoco.MjData(model)
        fixed = {h: angles[h] if np.isnan(angle) else angle for h, angle in phase.fixed.items()}
        self.fixed = np.array([fixed.get(hinge, np.nan) for hinge in robot.hinges])
        names = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, h) for h in robot.hinges]
        self.hinges = np.array(names)
        self.there = self.hinges >= 0
        self.qpos = model.jnt_qposadr[self.hinges[self.there]]
        self.qvel = model.jnt_dofadr[self.hinges[self.there]]
        motors = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, m) for m in robot.motors]
        self.driven = np.array([k for k, number in enumerate(motors) if number >= 0])
        self.motors = np.array([number for number in motors if number >= 0])
        touches = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, t) for t in robot.touches]
        self.felt = np.array([k for k, number in enumerate(touches) if number >= 0], dtype=int)
        self.touches = np.array([model.sensor_adr[n] for n in touches if n >= 0], dtype=int)
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
        full = np.zeros(len(self.hinges))
        full[self.there] = self.data.qvel[self.qvel]
        return full

    def take_over(self, other: "_Plant") -> None:
        """Continues the motion of another plant."""
        self.data.qpos[:7], self.data.qvel[:6] = other.data.qpos[:7], other.data.qvel[:6]
        self.data.qpos[self.qpos] = other.angles[self.there]
        self.data.qvel[self.qvel] = other.speeds[self.there]
        self.data.time = other.data.time
        mujoco.mj_forward(self.model, self.data)


def simulate(
    robot: Robot,
    phases: Sequence[Phase],
    gait: Gait,
    duration: float,
    latency: Callable[[], float] = lambda: 0.0,
) -> Motion:
    """Simulates a trial.

    Args:
        robot: The robot.
        phases: Phases in the order of their starts; the first starts at 0.
        gait: The gait.
        duration: Duration, s; the gait goes on for ``TAIL`` after it.
        latency: Draws the delay of a command, s.
    """
    plants, waiting = deque(phases), deque[tuple[float, np.ndarray]]()
    phase = plants.popleft()
    plant = _Plant(robot, phase, {})
    motors = list(robot.motors)
    rows: list[np.ndarray] = []
    commands: list[np.ndarray] = []
    touches: list[np.ndarray] = []
    count = round((duration + TAIL) / robot.control_timestep)
    for step in range(count):
        now = step * robot.control_timestep
        if plants and now >= plants[0].start - 1e-9:
            phase, before = plants.popleft(), plant
            plant = _Plant(robot, phase, dict(zip(robot.hinges, before.angles, strict=True)))
            plant.take_over(before)
            waiting = deque([(now, commands[-1])])
        offsets = np.array([phase.offsets.get(hinge, 0.0) for hinge in robot.hinges])
        force = np.zeros(len(robot.touches))
        force[plant.felt] = plant.data.sensordata[plant.touches]
        force[[k for k, name in enumerate(robot.touches) if name in phase.dead]] = 0.0
        measured = plant.angles + offsets
        commands.append(gait.commands(now, np.nan_to_num(measured), (force > 0).astype(float)))
        touches.append(force)
        due = now + latency() + phase.delay
        waiting.append((max(due, waiting[-1][0] if waiting else 0.0), commands[-1]))
        shift = np.array([phase.offsets.get(hinge, 0.0) for hinge in robot.motors.values()])
        order = np.arange(len(motors))
        if phase.swapped:
            first, second = (motors.index(name) for name in phase.swapped)
            order[[first, second]] = second, first
        for _ in range(round(robot.control_timestep / plant.model.opt.timestep)):
            while waiting and waiting[0][0] <= plant.data.time + 1e-9:
                sent = waiting.popleft()[1][order] - shift
                plant.data.ctrl[plant.motors] = sent[plant.driven]
            rows.append(_row(plant))
            mujoco.mj_step(plant.model, plant.data)
    table = np.array(rows)
    hinges = len(robot.hinges)
    return Motion(
        time=table[:, 0],
        angles=table[:, 14 : 14 + hinges],
        speeds=table[:, 14 + hinges :],
        pose=table[:, 1:8],
        twist=table[:, 8:14],
        command_time=robot.control_timestep * np.arange(count),
        commands=np.array(commands),
        touch=np.array(touches),
    )


def _row(plant: _Plant) -> np.ndarray:
    data = plant.data
    return np.concatenate(
        [
            [data.time],
            data.qpos[:7],
            data.qvel[:6],
            plant.angles,
            plant.speeds,
        ]
    )
