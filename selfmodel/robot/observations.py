"""Observations of the tasks of dm_control's suite, from the fields of MuJoCo's states of robots.

An observation is that of ``task.get_observation`` as one row, in the task's order, for many robots
together. It needs no dm_control: a log is replayed by the names of the parts in its model.
"""

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError, check_name
from selfmodel.robot.state import Bind, SignalSource, bind_data

UP, FORWARD = [8], [0, 2]
"""Columns of a rotation matrix: the height of the z axis; the x and the z axis, seen along x."""


class Fields:
    """Fields of MuJoCo's states, ``(n, ...)`` each, by the names of a robot's parts.

    The model is the healthy robot's; the states may have further parts behind its own.
    """

    def __init__(self, model: mujoco.MjModel, bind: Bind) -> None:
        self.model, self._bind = model, bind

    def field(self, name: str) -> FloatArray:
        """Returns a field of the states, such as ``xpos``."""
        return self._bind(name)

    @property
    def positions(self) -> FloatArray:
        """Generalised positions, ``(n, nq)``."""
        return self.field("qpos")[:, : self.model.nq]

    @property
    def velocities(self) -> FloatArray:
        """Generalised velocities, ``(n, nv)``."""
        return self.field("qvel")[:, : self.model.nv]

    def body(self, name: str, body: str) -> FloatArray:
        """Returns the part of a field of bodies, such as ``xpos``, that is of one."""
        return self.field(name)[:, self.model.body(body).id]

    def geom(self, name: str, geom: str) -> FloatArray:
        """Returns the part of a field of geoms, such as ``geom_xpos``, that is of one."""
        return self.field(name)[:, self.model.geom(geom).id]

    def sensor(self, name: str) -> FloatArray:
        """Returns the numbers of a sensor."""
        own = self.model.sensor(name)
        return self.field("sensordata")[:, own.adr[0] : own.adr[0] + own.dim[0]]

    def sensors(self, *kinds: mujoco.mjtSensor) -> FloatArray:
        """Returns the numbers of all sensors of some kinds, in the order of the model."""
        chosen = np.flatnonzero(np.isin(self.model.sensor_type, kinds))
        return np.concatenate([self.sensor(self.model.sensor(k).name) for k in chosen], axis=1)

    def joints(self, name: str, joints: Sequence[str]) -> FloatArray:
        """Returns the columns of joints in ``qpos`` or ``qvel``."""
        address = self.model.jnt_qposadr if name == "qpos" else self.model.jnt_dofadr
        return self.field(name)[:, [int(address[self.model.joint(joint).id]) for joint in joints]]

    @staticmethod
    def seen_from(points: FloatArray, origin: FloatArray, frame: FloatArray) -> FloatArray:
        """Returns points in a frame, ``(n, 3)``; the frame is a matrix, ``(n, 9)``."""
        matrix = frame.reshape(len(frame), 3, 3)
        return np.asarray(np.einsum("ni,nij->nj", points - origin, matrix))


def _walker(own: Fields) -> Sequence[FloatArray]:
    frames = own.field("xmat")[:, 1 : own.model.nbody, FORWARD]
    return [frames.reshape(len(frames), -1), own.body("xpos", "torso")[:, 2:], own.velocities]


def _planar(own: Fields) -> Sequence[FloatArray]:
    return [own.positions[:, 1:], own.velocities]


def _hopper(own: Fields) -> Sequence[FloatArray]:
    touch = [np.log1p(own.sensor(name)) for name in ("touch_toe", "touch_heel")]
    return [*_planar(own), *touch]


def _quadruped(own: Fields) -> Sequence[FloatArray]:
    model, kinds = own.model, mujoco.mjtSensor
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    names = [model.joint(number).name for number in hinges]
    return [
        own.joints("qpos", names),
        own.joints("qvel", names),
        own.field("act"),
        own.sensor("velocimeter"),
        own.body("xmat", "torso")[:, UP],
        own.sensors(kinds.mjSENS_GYRO, kinds.mjSENS_ACCELEROMETER),
        np.arcsinh(own.sensors(kinds.mjSENS_FORCE, kinds.mjSENS_TORQUE)),
    ]


def _humanoid(own: Fields) -> Sequence[FloatArray]:
    frame, origin = own.body("xmat", "torso"), own.body("xpos", "torso")
    limbs = [f"{side}_{limb}" for side in ("left", "right") for limb in ("hand", "foot")]
    return [
        own.positions[:, 7:],
        own.body("xpos", "head")[:, 2:],
        *(own.seen_from(own.body("xpos", limb), origin, frame) for limb in limbs),
        frame[:, 6:],
        own.sensor("torso_subtreelinvel"),
        own.velocities,
    ]


_FINS = (
    *("tail1", "tail_twist", "tail2", "finright_roll", "finright_pitch"),
    *("finleft_roll", "finleft_pitch"),
)


def _fish(own: Fields, *, swims: bool) -> Sequence[FloatArray]:
    upright = own.body("xmat", "torso")[:, UP]
    return [own.joints("qpos", _FINS), upright, *([to_target(own)] * swims), own.velocities]


def to_target(own: Fields) -> FloatArray:
    """Returns the position of a fish's target in the frame of its mouth, ``(n, 3)``, m."""
    mouth = own.geom("geom_xpos", "mouth"), own.geom("geom_xmat", "mouth")
    return own.seen_from(own.geom("geom_xpos", "target"), *mouth)


OBSERVATIONS: Mapping[str, Callable[[Fields], Sequence[FloatArray]]] = {
    "walker": _walker,
    "cheetah": _planar,
    "hopper": _hopper,
    "quadruped": _quadruped,
    "humanoid": _humanoid,
    "fish-swim": lambda own: _fish(own, swims=True),
    "fish-upright": lambda own: _fish(own, swims=False),
}
"""Parts of an observation by the domain of the suite, or by domain and task where its tasks have
different ones."""


def observation_of(robot: str) -> str:
    """Returns the key in ``OBSERVATIONS`` of a robot such as ``suite-walker-walk``; "" if none."""
    suite, _, task = robot.partition("-")
    if suite != "suite" or task == "humanoid-run_pure_state":
        return ""
    keys = (key for key in (task, task.partition("-")[0]) if key in OBSERVATIONS)
    return next(keys, "")


def observation_source(key: str, model: mujoco.MjModel) -> SignalSource:
    """Returns the source of an observation, ``(n, width)``, as a signal of the state.

    Raises:
        InputError: The key is unknown, or the robot lacks a part that the task observes.
    """
    check_name("observation of a task", key, OBSERVATIONS)

    def bound(bind: Bind) -> Callable[[], FloatArray]:
        fields, parts = Fields(model, bind), OBSERVATIONS[key]
        try:
            parts(fields)  # binds its fields now
        except KeyError as error:
            raise InputError(
                f"the robot has no observation of {key}: {error.args[0]}; give the term task to a "
                f"body of that domain alone"
            ) from error
        return lambda: np.concatenate(parts(fields), axis=1)

    return bound


def observation_width(key: str, model: mujoco.MjModel) -> int:
    """Returns the numbers of an observation; see ``observation_source``."""
    return int(observation_source(key, model)(bind_data(mujoco.MjData(model)))().shape[1])
