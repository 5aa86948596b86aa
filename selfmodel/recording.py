"""Physical trials: a robot that runs and is logged, a trial as a log, a robot in simulation."""

from pathlib import Path

from selfmodel import arguments
from selfmodel.arguments import RobotSource, TrialSource
from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import Playback
from selfmodel.errors import real_number, whole_number
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.files import path_of
from selfmodel.logs import physical_trial
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.settings import Settings
from selfmodel.studies.experiment import draw_reality
from selfmodel.trials.trajectory import samples_of
from selfmodel.trials.trial import Stage, Trial, TrialPlan


def run_trial(
    physical: PhysicalRobot,
    controller: CommandSource | str | Path,
    path: str | Path,
    *,
    robot: RobotSource,
    steps: int = 1000,
    stage: Stage = "single",
    seed: int = 0,
) -> Trial:
    """Runs a physical trial, logs it while it runs, and returns the trial read from the log.

    Example:
        >>> import selfmodel
        >>> settings = selfmodel.Settings(steps=20, generations=2).scaled(4)
        >>> walk = selfmodel.evolve_controller("quadruped", settings=settings)
        >>> physical = selfmodel.simulated_robot("quadruped")
        >>> selfmodel.run_trial(physical, walk, "walk.mcap", robot="quadruped", steps=20)
        <Trial walk of quadruped: stage single, 20 of 20 steps
          its controller, a network of 3 hidden neurons
          walk.mcap>

    Args:
        physical: The physical robot.
        controller: Controller or playback that drives the robot, or the path of a controller.
        path: Name of the log, ``NAME.mcap``; the trial is called NAME.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        steps: Control steps of the trial.
        stage: Stage of the trial within a recovery.
        seed: Seed of the trial, for the record.

    Raises:
        InputError: The log exists, NAME is no name of a trial, the controller does not fit the
            robot, or an argument is invalid.
        LogError: The robot stopped early, or the log failed its verification.
        TrialError: The physical robot could not finish the trial.
    """
    arguments.check_physical(physical)
    path, header = path_of(path, "the new log"), TrialHeader(Settings())
    robot, seed = arguments.load_robot(robot), whole_number("seed", seed, 0, least=0)
    if not isinstance(controller, Playback):
        controller = arguments.controller_of(controller, robot)
    plan = TrialPlan(path.stem, stage, controller, whole_number("steps", steps, 1000), seed)
    return physical_trial.run_trial(physical, plan, path, robot, header)


def write_log(trial: TrialSource, path: str | Path, robot: RobotSource) -> Path:
    """Writes a trial, such as one of ``Trial.from_arrays``, as a new log.

    Example:
        >>> import selfmodel
        >>> trial = selfmodel.read_log("after.mcap").trial
        >>> log = selfmodel.write_log(trial, "copy.mcap", "quadruped")
        >>> selfmodel.read_log(log).trial.trajectory.steps
        60

    Args:
        trial: The trial, or the path of its log; its step timing is not written.
        path: Name of the log, ``NAME.mcap``; it must not exist.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.

    Raises:
        InputError: The log exists, or the trial does not fit the robot.
        LogWriteError: The disk is full, or failed.
    """
    trial = arguments.trial_of(trial)
    return write_trial(
        path_of(path, "the new log"),
        arguments.load_robot(robot),
        trial.plan,
        samples_of(trial.trajectory),
        TrialHeader(Settings()),
    )


def simulated_robot(
    robot: RobotSource,
    hypothesis: Hypothesis | str = INTACT,
    *,
    gap: float = 0.0,
    seed: int = 0,
) -> SimulatedRobot:
    """Returns a physical robot in simulation, with hidden faults and a reality gap.

    Robots of the same seed and gap are one robot before and after its failure; the healthy and the
    damaged robot have different streams of measurement noise.

    Example:
        >>> import selfmodel
        >>> physical = selfmodel.simulated_robot("quadruped", "break:front_left_knee", gap=0.05)

    Args:
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        hypothesis: The faults of the physical robot, or their notation.
        gap: Level of the reality gap, the relative standard deviation of its factors; 0 is none.
        seed: Seed of the gap and of the noise.

    Raises:
        InputError: The level is out of range, the seed is negative, the robot is unknown, or the
            notation is invalid.
    """
    seed, gap = whole_number("seed", seed, 0, least=0), real_number("gap", gap, 0.05)
    robot = arguments.load_robot(robot)
    hidden = arguments.parse_hypothesis(hypothesis, robot)
    stream = 1 if hidden.faults else 0
    return SimulatedRobot(robot, hidden, draw_reality(robot, seed, gap), stream)
