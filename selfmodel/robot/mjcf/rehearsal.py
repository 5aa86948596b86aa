"""Rehearsal: compiles and steps an untrusted model in a child process, before this process does."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import ceil
from pathlib import Path
from time import perf_counter

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.model_checks import MAX_NUMBER
from selfmodel.robot.mujoco_errors import compile_model, mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import DEFAULT_BUDGET, Budget, BudgetError, memory_error
from selfmodel.sandbox.isolation import Isolated, run_isolated
from selfmodel.sandbox.message import Message

MAX_STEPS = 20
"""Largest number of physics steps of a rehearsal."""

MAX_STEPPING_SECONDS = 0.1
"""Time after which a rehearsal takes no further step, s."""

_MAX_REMEMBERED = 8

_DIVERGED = tuple(
    int(kind)
    for kind in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
)


@dataclass(frozen=True)
class ModelCost:
    """Memory and time of a model, measured in a child process.

    Attributes:
        model_bytes: Size of the compiled model, bytes. Each embodiment has a copy.
        data_bytes: Size of MuJoCo's data for one thread, bytes.
        compile_seconds: Time of a compilation with the search for the robot's parts, s.
        step_seconds: Time of a physics step, the shortest of the first: other work on the machine
            delays some of them, s.
        failure: Reason why the first steps without commands failed; "" for a sound model.
    """

    model_bytes: int
    data_bytes: int
    compile_seconds: float
    step_seconds: float
    failure: str


def rehearse(
    mjcf: str,
    assets: Mapping[str, bytes],
    control_timestep: float,
    budget: Budget = DEFAULT_BUDGET,
) -> ModelCost:
    """Returns the cost of a robot's model, measured once in a child process.

    Args:
        mjcf: The MJCF as one text without includes.
        assets: Contents of the files that the MJCF names, by name.
        control_timestep: Time between two commands, s.
        budget: Limits of memory and time.

    Raises:
        InputError: The model cannot be compiled, or is no valid robot.
        BudgetError: The model exceeds the budget.
    """
    return _rehearsed(mjcf, tuple(assets.items()), control_timestep, budget)


@lru_cache(_MAX_REMEMBERED)
def _rehearsed(
    mjcf: str, assets: tuple[tuple[str, bytes], ...], control_timestep: float, budget: Budget
) -> ModelCost:
    message = Message({"mjcf": mjcf, "control_timestep": control_timestep}, dict(assets))
    found = run_on_model("selfmodel.robot.mjcf.rehearsal:build_and_step", message, budget)
    # This process compiles the model a second time.
    if 2 * found.seconds > ceil(budget.file_seconds):
        raise BudgetError(
            f"the model takes {2 * found.seconds:.3g} s of processor time, more than "
            f"{ceil(budget.file_seconds)} s: to go on, raise the time with --budget time=..., from "
            f"{budget.time:g} s"
        )
    return ModelCost(**found.facts)


def physics_timestep(mjcf: str, budget: Budget = DEFAULT_BUDGET) -> float:
    """Returns the physics time step of a model that names no files, s.

    Args:
        mjcf: The MJCF as one text.
        budget: Limits of memory and time.

    Raises:
        InputError: The model cannot be compiled, or the time step is not positive and finite.
        BudgetError: The model exceeds the budget.
    """
    task = "selfmodel.robot.mjcf.rehearsal:read_timestep"
    timestep = float(run_on_model(task, Message({"mjcf": mjcf}), budget).facts["timestep"])
    if not 0 < timestep <= MAX_NUMBER:
        raise InputError(f"the physics time step must be above 0 s, got {timestep}")
    return timestep


def read_timestep(message: Message, _budget: Budget, _scratch: Path) -> Message:
    """Task of a child process: compiles a model, as for ``physics_timestep``."""
    return Message({"timestep": float(compile_model(message.facts["mjcf"], {}).opt.timestep)})


def run_on_model(task: str, message: Message, budget: Budget) -> Isolated:
    """Runs a function that compiles a model in a child process; see ``run_isolated``.

    Raises:
        InputError: The task raised it, or the process crashed.
        BudgetError: The model exceeds the budget.
    """
    found = run_isolated(task, message, what="the model", budget=budget)
    if found.peak > budget.models_bytes:
        raise memory_error(
            f"the model takes {found.peak / 1e9:.2g} GB of memory, more than "
            f"{budget.models_bytes / 1e9:.2g} GB",
            budget,
        )
    return found


def build_and_step(message: Message, _budget: Budget, _scratch: Path) -> Message:
    """Task of a child process: measures a robot, as ``ModelCost``."""
    facts = message.facts
    start = perf_counter()
    with mujoco_errors_as_input_errors("use the model"):
        robot = Robot("robot", facts["mjcf"], facts["control_timestep"], message.blobs)
        build_seconds = perf_counter() - start
        data = mujoco.MjData(robot.model)
    seconds, failure = _first_steps(robot.model, data)
    return Message(
        {
            "model_bytes": int(robot.model.nbuffer),
            "data_bytes": int(data.nbuffer + robot.model.narena),
            "compile_seconds": build_seconds,
            "step_seconds": min(seconds),
            "failure": failure,
        }
    )


def _first_steps(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[list[float], str]:
    """Returns the time of each physics step, s, and the reason of a failure."""
    seconds: list[float] = []
    failure = ""
    while not failure and len(seconds) < MAX_STEPS and sum(seconds) < MAX_STEPPING_SECONDS:
        start = perf_counter()
        try:
            mujoco.mj_step(model, data)
        except mujoco.FatalError as error:
            failure = " ".join(str(error).split())
        seconds.append(perf_counter() - start)
    for kind in _DIVERGED:
        if data.warning[kind].number:
            failure = failure or mujoco.mju_warningText(kind, data.warning[kind].lastinfo)
    return seconds, failure
