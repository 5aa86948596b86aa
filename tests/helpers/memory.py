"""Physical trials in memory, for tests of the algorithm without files."""

from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.recover import RunTrial
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import Trial, TrialPlan


def in_memory(robot: Robot) -> RunTrial:
    """Returns a function that runs a physical trial of a robot and keeps no log."""

    def run_trial(physical: PhysicalRobot, plan: TrialPlan) -> Trial:
        samples = physical.run(plan.controller, plan.steps)
        return Trial(plan, robot.name, collect(robot.anatomy.names, samples), plan.name)

    return run_trial
