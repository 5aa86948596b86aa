"""Simulated physical robot: a hidden fault, a reality gap and structural mismatches."""

import dataclasses
from collections import deque
from collections.abc import Iterator
from functools import partial

import mujoco
import numpy as np

from selfmodel.controllers.controller import CommandSource, make_batch
from selfmodel.errors import TrialError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.physical.debris import add_debris, detached_limbs, place_debris
from selfmodel.physical.initial_pose import randomize_initial_pose, start_spread
from selfmodel.physical.measurement_noise import ExactMeasurement, Measurement, NoisyMeasurement
from selfmodel.physical.reality_gap import RealityGap, perturbed_model
from selfmodel.physical.structural_mismatch import StructuralMismatch, add_structural_mismatch
from selfmodel.robot.control_delay import added_steps, split_delay
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.mujoco_errors import mujoco_errors_as_input_errors
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.robot.state import BASE_SIGNALS, bind_data, observed_fields
from selfmodel.trials.behaviour import Sample
from selfmodel.trials.signals import SIGNALS

OWN_SEED = 1
"""Seed of the randomness of a fault, such as terrain, in a physical robot without a gap; the
self-model's seed is 0."""


class SimulatedRobot:
    """Simulated physical robot with a hidden fault.

    Args:
        robot: The robot as its model describes it.
        hidden: Hidden faults of the physical robot, as a hypothesis.
        gap: Reality gap; None or a level of 0 for no gap.
        structure: Structural mismatch; None for the structure of the model.
        stream: Number of the robot's random number stream among those of the gap's seed. Robots
            that share a gap, such as one robot before and after its failure, have different
            streams.
    """

    def __init__(
        self,
        robot: Robot,
        hidden: Hypothesis = INTACT,
        gap: RealityGap | None = None,
        structure: StructuralMismatch | None = None,
        stream: int = 0,
    ) -> None:
        self._robot = robot
        self._gap = gap if gap is not None and gap.level > 0 else None
        self._limbs = detached_limbs(robot, hidden) if self._gap is not None else ()
        seed = gap.seed if gap else OWN_SEED
        self._embodiment = physical_embodiment(robot, hidden, seed, self._gap, structure)
        self._noise = np.random.SeedSequence(seed, spawn_key=(stream,))

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``.

        Without a gap, the samples are bit-identical to the ``Simulator``'s, unless the fault is
        random, such as terrain, which differs from the self-model's. With a gap, each run has the
        next random number stream: two runs differ, and the n-th runs of two robots with the same
        seed are bit-identical.

        Raises:
            TrialError: The simulation diverged.
            InputError: MuJoCo cannot simulate the model.
        """
        (child,) = self._noise.spawn(1)
        embodiment = self._embodiment
        if self._gap is not None:
            (own,) = child.spawn(1)
            embodiment = dataclasses.replace(embodiment, seed=int(own.generate_state(1)[0]))
        return self._run(embodiment, controller, steps, np.random.default_rng(child))

    def _run(
        self,
        embodiment: Embodiment,
        controller: CommandSource,
        steps: int,
        rng: np.random.Generator,
    ) -> Iterator[Sample]:
        robot = self._robot
        model, data = embodiment.model, mujoco.MjData(embodiment.model)
        measurement: Measurement = ExactMeasurement()
        delay = robot.control_delay
        delay += added_steps(delay, float(embodiment.added_delay[0]))
        substeps = round(robot.control_timestep / float(model.opt.timestep))
        if self._gap is not None:
            measurement = NoisyMeasurement(self._gap.level, robot, embodiment, rng)
            delay += self._gap.delay
            randomize_initial_pose(robot, model, data, start_spread(self._gap.level), rng)
            place_debris(model, data, self._limbs)
        with mujoco_errors_as_input_errors("simulate the physical robot"):
            mujoco.mj_forward(model, data)
        reader = SensorReader(model, robot.anatomy, [embodiment])
        controllers = make_batch(
            [controller], [embodiment.silent_neurons], len(robot.anatomy.sensors)
        )
        commands = np.zeros((1, model.nu))
        whole, part = split_delay(delay, substeps)
        delay_line = deque(np.zeros((whole + bool(part), model.nu)))
        # Logged commands are the controller's outputs, before the control delay.
        state_fields = observed_fields(robot, [embodiment])
        live = {signal: field.reader(bind_data(data)) for signal, field in state_fields.items()}
        live |= {"sensors": lambda: controllers.readings, "commands": lambda: commands}
        # The pose of a fixed base is known, so no sensor measures it.
        constant = BASE_SIGNALS if robot.has_fixed_base else ()
        for k in range(steps):
            reader.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], controllers.readings)
            measurement.corrupt_readings(controllers.readings[0])
            controllers.step(commands)
            delay_line.append(commands[0].copy())
            data.ctrl[:] = delay_line.popleft()
            yield Sample(
                time=k * robot.control_timestep,
                values={
                    signal: (
                        live[signal]()[0]
                        if signal in constant
                        else measurement.measure(signal, live[signal]()[0])
                    ).copy()
                    for signal in SIGNALS
                },
            )
            moves = k + 1 < steps
            if moves and part:
                moves = _advanced(model, data, part)
                data.ctrl[:] = delay_line[0]
            if k + 1 < steps and not (moves and _advanced(model, data, substeps - part)):
                raise TrialError(
                    f"the simulation of the physical robot diverged after step {k}: its model "
                    f"is unstable under this controller; try a smaller physics time step"
                )


def physical_embodiment(
    robot: Robot,
    hidden: Hypothesis,
    seed: int,
    gap: RealityGap | None = None,
    structure: StructuralMismatch | None = None,
) -> Embodiment:
    """Returns the model of a physical robot, with the debris of its detached limbs if it has a gap.

    Args:
        robot: The robot as its model describes it.
        hidden: Hidden faults of the physical robot, as a hypothesis.
        seed: Seed of the random parts of the faults.
        gap: Reality gap with a level above 0; None for no gap.
        structure: Structural mismatch; None for the structure of the model.
    """
    edits = [partial(add_structural_mismatch, structure=structure)] if structure is not None else []
    limbs = () if gap is None else detached_limbs(robot, hidden)
    if limbs:
        edits.append(partial(add_debris, limbs=limbs))
    perturb = None if gap is None else partial(perturbed_model, gap=gap)
    return build(robot, hidden, seed, edits=edits, perturb=perturb)


def _advanced(model: mujoco.MjModel, data: mujoco.MjData, substeps: int) -> bool:
    """Advances by a number of physics steps; returns whether the state is valid afterwards."""
    try:
        mujoco.mj_step(model, data, substeps)
    except mujoco.FatalError:  # such as a lack of memory for contacts
        return False
    return not data.warning.number.any()
