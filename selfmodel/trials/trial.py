"""A trial: one run of the physical robot with one controller, as its log tells it."""

from dataclasses import dataclass
from typing import Literal, get_args

from selfmodel.controllers.driver import Driver
from selfmodel.trials.behaviour import Behaviour, forward_displacement

Stage = Literal["before", "after", "recovery", "single"]
"""Where in a story a trial stands: the robot walks (``before``), no longer does as its model says
(``after``), tries a compensating controller (``recovery``), or runs outside a recovery
(``single``). What was ``before`` is not explained by a diagnosis: it shows how the robot moves with
nothing wrong."""

STAGES: tuple[Stage, ...] = get_args(Stage)


def stage_of(name: str) -> Stage | None:
    """Returns the stage of that name; None if there is none."""
    return next((stage for stage in STAGES if stage == name), None)


@dataclass(frozen=True)
class TrialPlan:
    """What is known of a trial before it starts.

    Attributes:
        name: Identifies the trial within its run, and names its file: letters, digits, ``-``.
        stage: Where in the story it stands.
        controller: What drives the robot.
        steps: Control steps that it is to last.
        seed: From which everything random about it is drawn.
    """

    name: str
    stage: Stage
    controller: Driver
    steps: int
    seed: int


@dataclass(frozen=True, eq=False)
class Trial:
    """A trial that ran, to its end or until it was interrupted.

    Attributes:
        plan: What was to be done.
        robot: The name of the robot.
        behaviour: What was observed, every signal of it: ``plan.steps`` steps, or fewer where the
            trial was interrupted. What is NaN was not observed.
        path: The log it was read from.
    """

    plan: TrialPlan
    robot: str
    behaviour: Behaviour
    path: str

    @property
    def displacement(self) -> float:
        """How far the robot travelled forward, m."""
        return float(forward_displacement(self.behaviour))
