"""Compiles a foreign model in a child process, before this process does: MuJoCo may crash."""

from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache

import mujoco

from selfmodel.errors import InputError
from selfmodel.isolation import Message, run_isolated
from selfmodel.robot.model_checks import MAX_NUMBER
from selfmodel.robot.mujoco_errors import compile_model, mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot

_MODULE = "selfmodel.robot.mjcf.isolated_model"


def check_compiles(mjcf: str, assets: Mapping[str, bytes], control_timestep: float) -> None:
    """Checks that a robot's model can be compiled and stepped; once for each of the last models.

    Args:
        mjcf: The MJCF as one text without includes.
        assets: Contents of the files that the MJCF names, by name.
        control_timestep: Time between two commands, s.

    Raises:
        InputError: The model cannot be compiled, or is no valid robot.
    """
    _check(mjcf, tuple(assets.items()), control_timestep)


@lru_cache(8)
def _check(mjcf: str, assets: tuple[tuple[str, bytes], ...], control_timestep: float) -> None:
    header = {"mjcf": mjcf, "control_timestep": control_timestep}
    run_isolated(f"{_MODULE}:build_and_step", Message(header, dict(assets)), what="the model")


def build_and_step(request: Message) -> Message:
    """Task of a child process: builds a robot and takes a step of its physics."""
    with mujoco_errors_as_input_errors("use the model"):
        robot = Robot(
            "robot", request.header["mjcf"], request.header["control_timestep"], request.buffers
        )
        data = mujoco.MjData(robot.model)
    with suppress(mujoco.FatalError):  # such as too many contacts: a simulation that diverges
        mujoco.mj_step(robot.model, data)
    return Message({})


def physics_timestep(mjcf: str) -> float:
    """Returns the physics time step of a model that names no files, s.

    Args:
        mjcf: The MJCF as one text.

    Raises:
        InputError: The model cannot be compiled, or the time step is not positive and finite.
    """
    answer = run_isolated(f"{_MODULE}:read_timestep", Message({"mjcf": mjcf}), what="the model")
    timestep = float(answer.header["timestep"])
    if not 0 < timestep <= MAX_NUMBER:
        raise InputError(f"the physics time step must be above 0 s, got {timestep}")
    return timestep


def read_timestep(request: Message) -> Message:
    """Task of a child process: compiles a model, as for ``physics_timestep``."""
    return Message({"timestep": float(compile_model(request.header["mjcf"], {}).opt.timestep)})
