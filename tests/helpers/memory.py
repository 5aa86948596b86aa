"""Physical trials in memory, for tests of the algorithm without files."""

from selfmodel.controllers.controller import CommandSource
from selfmodel.faults.notation import parse
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.recover import RunTrial
from selfmodel.robot.robot import Robot
from selfmodel.simulation.reality_gap import RealityGap
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import Stage, Trial, TrialPlan


def in_memory(robot: Robot) -> RunTrial:
    """Returns a function that runs a physical trial of a robot and keeps no log."""

    def run_trial(physical: PhysicalRobot, plan: TrialPlan) -> Trial:
        samples = physical.run(plan.controller, plan.steps)
        return Trial(plan, robot.name, collect(robot.anatomy.names, samples), plan.name)

    return run_trial


def trial_of(
    robot: Robot,
    truth: str,
    driver: CommandSource,
    *,
    steps: int,
    name: str = "",
    stage: Stage = "after",
    gap: RealityGap | None = None,
) -> Trial:
    """Returns a trial of a robot with faults; its name, and path, are its stage and the faults."""
    plan = TrialPlan(name or f"{stage}-{truth}", stage, driver, steps, 0)
    return in_memory(robot)(SimulatedRobot(robot, parse(truth, robot.anatomy), gap), plan)
