"""Displacement and falls of one run of a physical robot."""

from dataclasses import dataclass

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.errors import TrialError
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.falls import first_falls, held_at_the_end
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Sample, collect


@dataclass(frozen=True)
class Measured:
    """Measurements of a run.

    Attributes:
        displacement: Forward displacement, m.
        upright: Forward displacement up to the last step before the first fall, m.
        fallen: Whether the robot fell.
        steps: Control steps that the run lasted; fewer than planned if it ended early.
    """

    displacement: float
    upright: float
    fallen: bool
    steps: int


@dataclass(frozen=True, eq=False)
class Track:
    """A physical robot on its ground, with what measures its runs.

    Attributes:
        physical: The physical robot.
        robot: The healthy robot as its model describes it.
        normal: Unit normal of the ground, ``(3,)``.
        steps: Control steps of a run.
    """

    physical: PhysicalRobot
    robot: Robot
    normal: FloatArray
    steps: int


def measure(track: Track, controller: Controller) -> Measured:
    """Runs a controller on a physical robot; a run that ends early counts as far as it went.

    Raises:
        TrialError: The run ended before its first sample.
    """
    samples: list[Sample] = []
    try:
        for sample in track.physical.run(controller, track.steps):
            samples.append(sample)  # noqa: PERF402  # the samples before an error are kept
    except TrialError:
        if not samples:
            raise
    logged = collect(track.robot.anatomy.names, samples)
    judged = held_at_the_end(logged) if logged.steps < track.steps else logged
    fall = min(int(first_falls(judged, track.normal, track.robot.standing_height)), logged.steps)
    x = logged["base_position"][:, 0]
    return Measured(
        displacement=float(x[-1] - x[0]),
        upright=float(x[max(fall - 1, 0)] - x[0]),
        fallen=fall < logged.steps,
        steps=logged.steps,
    )
