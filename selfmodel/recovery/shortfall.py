"""Trials with less than half of the score that the self-model predicted, and the likely cause."""

from collections.abc import Callable

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.candidates import FINER, LOSS
from selfmodel.recovery.falls import fall_text
from selfmodel.recovery.result import TrialScore
from selfmodel.recovery.scores import value_text
from selfmodel.robot.robot import Robot

SHORTFALL = 0.5
"""Share of the predicted score below which a trial is a warning."""


def shortfall(
    found: TrialScore,
    predicted: float,
    tried: Hypothesis,
    robot: Robot,
    simulated: Callable[[Robot], float],
) -> str | None:
    """Returns a sentence on a trial that falls short of its prediction; None for any other.

    The cause is the fall of the robot, an early end, a diagnosis that the trial refuted, or else
    the self-model: its time step, if it loses the score at a quarter of it, or its parameters.

    Args:
        found: Score of the trial.
        predicted: Score that was predicted; NaN if none was.
        tried: Hypothesis at the time.
        robot: The self-model of today.
        simulated: Returns the score of the controller in one simulation of a robot without noise;
            NaN if it diverges.
    """
    if not (predicted > 0 and found.value < SHORTFALL * predicted):
        return None
    score, trial = found.score, found.trial
    walked, before = (value_text(one, score.unit) for one in (found.value, predicted))
    said = f"trial {trial.plan.name}: {score.name} {walked}, where {before} was predicted: "
    if ended := fall_text(found.fall) + trial.early_end:
        return f"{said}the robot{ended.removeprefix(',')}"
    if tried != found.hypothesis:
        return f"{said}the diagnosis was {tried}, and is {found.hypothesis} with this trial"
    coarse, fine = simulated(robot), simulated(robot.finer(FINER))
    share = value_text(fine, score.unit)
    if not coarse - fine < LOSS * abs(coarse):
        return (
            f"{said}the self-model flatters, and predicts {share} at a quarter of its physics time "
            f"step; {advice(robot)}"
        )
    return (
        f"{said}the self-model predicts {share} at a quarter of its physics time step too, so its "
        f"motors, contacts or mass differ from the robot's: calibrate it with more healthy trials, "
        f"or give it the robot's armature, damping, friction and solref"
    )


def advice(robot: Robot) -> str:
    """Returns what to change about a robot whose motion depends on the time step, as text."""
    timestep = float(robot.model.opt.timestep) / FINER
    return (
        f"give its model timestep={timestep:.6g}, or armature, the inertia of the rotors at the "
        f"joints (`selfmodel robots FILE` has numbers)"
    )
