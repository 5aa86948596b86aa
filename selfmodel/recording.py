"""Physical trials: a robot that runs and is logged, a trial as a log, a robot in simulation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.arguments import RobotSource, TrialSource
from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import CommandSource, Controller
from selfmodel.controllers.function import name_of
from selfmodel.controllers.playback import Playback
from selfmodel.errors import TrialError, check_type, real_number, whole_number
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.files import path_of
from selfmodel.logs import physical_trial
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.environment import Observe, Policy
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.physical.stepped import Stepped
from selfmodel.recovery.falls import fall_of
from selfmodel.recovery.scores import UPRIGHT, Score
from selfmodel.robot.robot import Robot
from selfmodel.settings import MAX_SETTINGS, Settings
from selfmodel.studies.experiment import draw_reality
from selfmodel.trials.trajectory import Sample, collect, samples_of
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
        >>> walk = selfmodel.evolve("quadruped", settings=settings)
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
    path, header = path_of(path, "the new log"), TrialHeader(Settings())
    robot, seed = arguments.load_robot(robot), whole_number("seed", seed, 0, least=0)
    arguments.check_physical(robot, physical)
    if not isinstance(controller, Playback):
        controller = arguments.controller_of(controller, robot)
    plan = TrialPlan(path.stem, stage, controller, whole_number("steps", steps, 1000), seed)
    return physical_trial.run_trial(physical, plan, path, robot, header)


def record(
    env: Any,  # noqa: ANN401  # of either interface
    policy: CommandSource | Policy | str | Path,
    path: str | Path,
    *,
    robot: RobotSource,
    observe: Observe | None = None,
    steps: int = 1000,
    stage: Stage = "single",
    seed: int = 0,
) -> Trial:
    """Runs a policy in a simulated environment, logs it, and returns the trial.

    Example:
        >>> import selfmodel
        >>> from selfmodel import tasks
        >>> env = tasks.load("quadruped", "walk", {"hypothesis": "break:front_left_knee"})
        >>> given = {"robot": "quadruped", "steps": 60}
        >>> trial = selfmodel.record(env, lambda _: [0.1] * 8, "new.mcap", **given)
        >>> trial.plan.controller.summary
        'the function <lambda>; its commands are played back'

    Args:
        env: A ``dm_env`` or Gymnasium environment, whose actions are the motor targets in the order
            of the model's motors. For hardware, use ``EnvironmentRobot`` and ``run_trial``.
        policy: A controller, or the path of its file; or a function of an observation of ``env`` to
            an action, such as ``lambda seen: model.predict(seen)[0]``, of which the log has the
            commands.
        path: Name of the log, ``NAME.mcap``; the trial is called NAME.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        observe: Function of an observation to signals, as for ``EnvironmentRobot``; None for those
            in it by name, and the others of MuJoCo's state if ``env`` has it, those of the sensors
            if it has the body of ``robot``, as one of ``dm_control.suite`` has.
        steps: Control steps of the trial.
        stage: Stage of the trial within a recovery.
        seed: Seed of the trial, for the record.

    Raises:
        InputError: The log exists, or an argument is invalid or does not fit the robot.
        TrialError: The environment failed, or ended its episode early; the log is then complete.
    """
    robot = arguments.load_robot(robot)
    source, function = _policy_of(policy, robot)
    physical = Stepped(env, robot).driven(observe, function, source)
    return run_trial(physical, source, path, robot=robot, steps=steps, stage=stage, seed=seed)


@dataclass(frozen=True)
class Episode:
    """An episode of ``evaluate``.

    Attributes:
        steps: Observations, the first included.
        score: Its score.
        episode_return: Sum of the rewards.
        displacement: Forward displacement, m; NaN if the base was not observed.
        fell_at_step: Step at which the robot fell; None if it did not.
    """

    steps: int
    score: float
    episode_return: float
    displacement: float
    fell_at_step: int | None


def evaluate(
    env: Any,  # noqa: ANN401  # of either interface
    policy: CommandSource | Policy | str | Path,
    *,
    robot: RobotSource,
    observe: Observe | None = None,
    episodes: int = 1,
    steps: int | None = None,
    score: Score | str = UPRIGHT,
) -> tuple[Episode, ...]:
    """Returns how a policy does in episodes of a simulated environment, without a log.

    Example:
        >>> import selfmodel
        >>> from selfmodel import tasks
        >>> env = tasks.load("quadruped", "walk", {"time_limit": 1.0})
        >>> (episode,) = selfmodel.evaluate(env, lambda _: [0.1] * 8, robot="quadruped")
        >>> episode.steps, episode.fell_at_step
        (101, None)

    Args:
        env: The environment, as for ``record``.
        policy: A controller, or the path of its file; or a function, as for ``record``.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        observe: Function of an observation to signals, as for ``record``.
        episodes: Number of episodes.
        steps: Largest number of control steps of an episode; None for whole ones.
        score: Score of an episode, its name, or ``package.module:object``.

    Raises:
        InputError: An argument is invalid, or does not fit the robot.
        TrialError: The environment failed.
    """
    robot = (entry := arguments.entry_of(robot)).robot()
    check_type(score, Score | str, 'a Score or its name, such as "energy"')
    chosen = score if isinstance(score, Score) else plugins.score(str(score), robot.name, entry)
    most = MAX_SETTINGS["steps"] if steps is None else whole_number("steps", steps, 1000, 2)
    stepped, (source, function) = Stepped(env, robot), _policy_of(policy, robot)
    physical, found = stepped.driven(observe, function, source), []
    for _ in range(whole_number("episodes", episodes, 10, 1)):
        samples: list[Sample] = []
        try:
            for sample in physical.run(source, most):
                samples.append(sample)  # noqa: PERF402  # those before an error remain
        except TrialError:
            if not stepped.is_over:
                raise
        plan = TrialPlan("episode", "single", source, len(samples), 0)
        trial = Trial(plan, robot.name, collect(robot.anatomy.names, samples), plan.name)
        value, fall = chosen.of_trial(robot, INTACT, trial), fall_of(robot, INTACT, trial)
        rewards = sum(stepped.rewards)
        # The environment's own rewards: of its faults and its target, which the robot lacks.
        value = rewards if score == plugins.RETURN else value
        found.append(Episode(plan.steps, value, rewards, trial.displacement, fall))
    return tuple(found)


def _policy_of(
    policy: CommandSource | Policy | str | Path, robot: Robot
) -> tuple[CommandSource, Policy | None]:
    """Returns the source of the commands of a trial, and the function that is in its place."""
    if callable(policy):
        motors = robot.anatomy.motors
        return Playback(motors, np.zeros((1, len(motors))), name_of(policy)), policy
    if isinstance(policy, Playback):
        return policy, None
    return arguments.controller_of(policy, robot), None


def load_policy(
    source: str | Path | Mapping[str, Any],
    robot: RobotSource,
    function: Callable[[FloatArray], Any] | None = None,
) -> Controller:
    """Returns a trained policy, or a function of Python, as the controller of a robot.

    Example:
        >>> import selfmodel
        >>> terms = [{"term": "gravity"}, {"term": "joint_positions"}]
        >>> lean = lambda seen: 0.3 * seen[0] - seen[3:]
        >>> selfmodel.load_policy({"observation": terms}, "quadruped", lean)
        <Controller: a policy of 11 observations, 8 motors and the function <lambda>>

    Args:
        source: Path of the policy file, or its keys and values.
        robot: The nominal robot, its name, or the path of its MJCF or URDF file.
        function: Function from an observation to an action, in the place of the file's network.

    Raises:
        InputError: A file is invalid, the policy does not fit the robot, or the function fails.
    """
    from selfmodel.logs.policies import read_policy  # noqa: PLC0415  # few robots have one

    given = source if isinstance(source, Mapping) else path_of(source, "a policy file")
    return Controller(read_policy(given, arguments.load_robot(robot), function), np.zeros(0))


def write_log(trial: TrialSource, path: str | Path, robot: RobotSource) -> Path:
    """Writes a trial, such as one of ``Trial.from_arrays``, as a new log.

    Example:
        >>> import selfmodel
        >>> trial = selfmodel.read_log("after.mcap").trial
        >>> log = selfmodel.write_log(trial, "copy.mcap", "quadruped")
        >>> selfmodel.read_log(log).trial.trajectory.steps
        60

    Args:
        trial: The trial, or the path of its log; of its step timing, what is late is written.
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
        TrialHeader(Settings(), timed=trial.trajectory.late is not None),
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
