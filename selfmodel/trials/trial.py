"""A trial: one logged run of the physical robot with one command source."""

from dataclasses import dataclass
from typing import Literal, get_args

from selfmodel.controllers.command_source import CommandSource
from selfmodel.errors import InputError
from selfmodel.trials.behaviour import Behaviour, forward_displacement

Stage = Literal["before", "after", "recovery", "single"]
"""Stage of a recovery: ``before`` (healthy robot), ``after`` (failed robot, old controller),
``recovery`` (failed robot, compensating controller), or ``single`` (outside of a recovery). A
diagnosis explains all trials but those of the stage ``before``, which calibrate the self-model."""

STAGES: tuple[Stage, ...] = get_args(Stage)

MAX_SEED = 2**63 - 1
"""Largest seed of a trial: the largest integer of most other programs that read logs."""


def stage_of(name: str) -> Stage | None:
    """Returns the stage with a name; None if there is no such stage."""
    return next((stage for stage in STAGES if stage == name), None)


def checked_seed(seed: int) -> int:
    """Returns a valid seed of a trial.

    Raises:
        InputError: The seed is negative, or above ``MAX_SEED``.
    """
    if not 0 <= seed <= MAX_SEED:
        raise InputError(f"seed must be a whole number from 0 to {MAX_SEED}, got {seed}")
    return seed


@dataclass(frozen=True)
class TrialPlan:
    """The plan of a trial, known before it starts.

    Attributes:
        name: Name of the trial within its run and of its file: letters, digits, ``-``.
        stage: Stage of the recovery.
        controller: Command source of the robot.
        steps: Planned control steps.
        seed: Seed of all random numbers of the trial, from 0 to ``MAX_SEED``.

    Raises:
        InputError: The seed is out of range.
    """

    name: str
    stage: Stage
    controller: CommandSource
    steps: int
    seed: int

    def __post_init__(self) -> None:
        checked_seed(self.seed)


@dataclass(frozen=True, eq=False)
class Trial:
    """A trial that ran to its end, or until it was interrupted.

    Attributes:
        plan: The plan of the trial.
        robot: Name of the robot.
        behaviour: Observed signals: ``plan.steps`` steps, or fewer if the trial was interrupted;
            NaN for values that were not observed.
        path: Path of the log.
    """

    plan: TrialPlan
    robot: str
    behaviour: Behaviour
    path: str

    def __repr__(self) -> str:
        plan = self.plan
        return (
            f"<Trial {plan.name} of {self.robot}: stage {plan.stage}, "
            f"{self.behaviour.steps} of {plan.steps} steps"
            f"\n  {plan.controller.summary}"
            f"\n  {self.path}>"
        )

    @property
    def displacement(self) -> float:
        """Forward displacement, m."""
        return float(forward_displacement(self.behaviour))
