"""Memory of a batch of simulations, and the size of a batch that fits into a budget."""

import mujoco

from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import Budget, memory_error
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments

_NUMBER_BYTES = 8
_BODY_NUMBERS = 16
"""Numbers of the pose and the velocity of a body that a batch reads."""

_COPIES = 3
"""Arrays of a recorded signal at one time: during the run, its result, and a comparison."""


def largest_batch(robot: Robot, request: Request, steps: int, budget: Budget) -> int:
    """Returns the largest number of hypotheses whose simulations fit into a budget together.

    Args:
        robot: The robot.
        request: Simulation of each hypothesis.
        steps: Control steps of the trial.
        budget: Memory of the models, the simulations and their signals.

    Raises:
        BudgetError: The simulation of one hypothesis does not fit.
    """
    needed = hypothesis_bytes(robot, request, steps)
    if needed > budget.models_bytes:
        raise memory_error(
            f"the simulation of one hypothesis takes {needed / 1e9:.2g} GB of memory, more than "
            f"{budget.models_bytes / 1e9:.2g} GB",
            budget,
        )
    return budget.models_bytes // needed


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
