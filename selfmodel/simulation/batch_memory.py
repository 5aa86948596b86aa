"""Memory of a batch of simulations, and the size of a batch that the free memory allows."""

import mujoco

from selfmodel.isolation import available_memory
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments

MAX_BATCH = 512 * 2**20
"""Largest memory of a batch, bytes; a larger one is not faster."""

_FREE_SHARE = 0.25
"""Share of the available memory that a batch may take: other processes may run studies beside."""

_NUMBER_BYTES = 8
_BODY_NUMBERS = 16
"""Numbers of the pose and the velocity of a body that a batch reads."""

_COPIES = 3
"""Arrays of a recorded signal at one time: during the run, its result, and a comparison."""


def batch_bytes() -> int:
    """Returns the memory that the models, simulations and signals of a batch may take, bytes."""
    return min(MAX_BATCH, int(_FREE_SHARE * available_memory()))


def largest_batch(robot: Robot, request: Request, steps: int) -> int:
    """Returns the largest number of hypotheses to simulate together; at least one.

    Args:
        robot: The robot.
        request: Simulation of each hypothesis.
        steps: Control steps of the trial.
    """
    return max(1, batch_bytes() // hypothesis_bytes(robot, request, steps))


def hypothesis_bytes(robot: Robot, request: Request, steps: int) -> int:
    """Returns the memory of the simulations of one hypothesis, bytes.

    Each embodiment has its own model, with all height fields, meshes and textures.
    """
    match request:
        case ClosedLoop():
            models, simulations, rows = 1, 1, steps
        case Segments():  # a fault may adapt the model to a trial's ground contacts
            count = len(request.commands)
            models, simulations, rows = 2, count, count * (request.horizon + 1)
        case Ensemble():
            models, simulations, rows = request.members, request.members, request.members * steps
    model = robot.model
    state = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
    numbers = state + model.nsensordata + _BODY_NUMBERS * model.nbody
    widths = sum(robot.anatomy.names.width(signal) for signal in request.record)
    return models * int(model.nbuffer) + _NUMBER_BYTES * (
        simulations * int(numbers) + _COPIES * rows * widths
    )
