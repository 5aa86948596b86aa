"""Expected time of work on trial logs, estimated before the work begins."""

from collections.abc import Sequence

from selfmodel.experiments.fitting import optional_calibration
from selfmodel.experiments.log_diagnosis import LogDiagnosis
from selfmodel.recovery import sequential_diagnosis
from selfmodel.robot.mjcf.rehearsal import rehearse
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import Budget
from selfmodel.simulation import calibration
from selfmodel.simulation.threads import thread_count
from selfmodel.trials.trial import Trial

TIME_PER_STEP = 5.0
"""Processor time of an estimated physics step, in that of a rehearsed step, which is at rest.

On hexapod and quadruped at a gap of 0.05, calibrations took 5.1 and 9.5 times, and diagnoses 3.1
and 3.0 times as long as their estimated steps would at rest: contacts, retries, comparisons."""


def diagnosis_seconds(
    robot: Robot, planned: LogDiagnosis, *, calibrate: bool, threads: int, budget: Budget
) -> float:
    """Returns the expected time of a diagnosis, s.

    Args:
        robot: The robot.
        planned: Inputs of the diagnosis, not calibrated.
        calibrate: Whether the self-model will be fitted to the healthy trials.
        threads: Threads of the physics; 0 for all processors.
        budget: Limits of the model.

    Raises:
        InputError: A trial lacks signals that the comparator or the calibration needs.
        BudgetError: The model exceeds the budget.
    """
    steps = 0
    if calibrate and planned.healthy:
        with optional_calibration():
            steps += calibration.simulated_steps(robot, planned.healthy)
    steps += sequential_diagnosis.simulated_steps(planned.damaged, planned.search)
    # A broken joint is compiled into a model of its own.
    models = 1 + len(robot.anatomy.joints)
    return _seconds(robot, steps, models, threads, budget)


def calibration_seconds(
    robot: Robot, trials: Sequence[Trial], *, threads: int, budget: Budget
) -> float:
    """Returns the expected time of a calibration, s.

    Args:
        robot: The robot.
        trials: Healthy trials.
        threads: Threads of the physics; 0 for all processors.
        budget: Limits of the model.

    Raises:
        InputError: Too little of a trial was observed.
        BudgetError: The model exceeds the budget.
    """
    steps = calibration.simulated_steps(robot, trials)
    return _seconds(robot, steps, 1, threads, budget)


def replay_seconds(robot: Robot, trial: Trial, budget: Budget) -> float:
    """Returns the expected time of a replay, s.

    Args:
        robot: The robot.
        trial: The trial.
        budget: Limits of the model.

    Raises:
        BudgetError: The model exceeds the budget.
    """
    return _seconds(robot, trial.behaviour.steps, 1, 1, budget)


def _seconds(robot: Robot, steps: int, models: int, threads: int, budget: Budget) -> float:
    cost = rehearse(robot.mjcf, robot.assets, robot.control_timestep, budget)
    steps_at_rest = steps * robot.substeps * cost.step_seconds
    return TIME_PER_STEP * steps_at_rest / thread_count(threads) + models * cost.compile_seconds
