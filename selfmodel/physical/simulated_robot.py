"""Physical robots: what the algorithm may ask of one, and a simulated one that hides its fault."""

import dataclasses
from collections import deque
from collections.abc import Iterator
from functools import partial

import mujoco
import numpy as np

from selfmodel.controllers.command_source import CommandSource, make_batch
from selfmodel.errors import TrialError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.physical.debris import add_debris, drop_debris, lost_limbs
from selfmodel.physical.initial_pose import randomize_initial_pose
from selfmodel.physical.measurement_noise import ExactMeasurement, Measurement, NoisyMeasurement
from selfmodel.physical.reality_gap import Gap, perturbed
from selfmodel.physical.structural_mismatch import Structure, add_structure
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.robot.sensing import SensorReader
from selfmodel.robot.state_access import bind_data, signal_fields
from selfmodel.trials.behaviour import SIGNALS, Sample

OWN_SEED = 1
"""The seed of what is random in a physical robot without a gap, such as its terrain: another than
the self-model's, which is 0."""


class SimulatedRobot:
    """A physical robot in simulation, with something wrong with it that it tells nobody.

    Args:
        robot: The robot as its model describes it.
        hidden: What is wrong with it.
        gap: How else it differs from its model; None, or a level of 0: not at all.
        structure: How it is built differently from its model; None: not at all.
        stream: Which of the gap's streams of noise is this robot's own: robots that share a gap,
            such as one before and after its failure, have different ones.
    """

    def __init__(
        self,
        robot: Robot,
        hidden: Hypothesis = INTACT,
        gap: Gap | None = None,
        structure: Structure | None = None,
        stream: int = 0,
    ) -> None:
        self._robot = robot
        self._gap = gap if gap is not None and gap.level > 0 else None
        self._limbs = lost_limbs(robot, hidden) if self._gap is not None else ()
        seed = gap.seed if gap else OWN_SEED
        edits = [partial(add_structure, structure=structure)] if structure is not None else []
        if self._limbs:
            edits.append(partial(add_debris, limbs=self._limbs))
        self._embodiment = build(
            robot,
            hidden,
            seed,
            edits=edits,
            perturb=None if self._gap is None else partial(perturbed, gap=self._gap),
        )
        self._noise = np.random.SeedSequence(seed, spawn_key=(stream,))

    def run(self, controller: CommandSource, steps: int) -> Iterator[Sample]:
        """Runs a controller; see ``PhysicalRobot``.

        Without a gap, the same bits as the ``Simulator``'s, unless something about the fault is
        random, such as the bumps of a terrain: those are this robot's own. With one, each run takes
        the next stream of noise: two runs differ, and the n-th of the same seed is the same to the
        bit.

        Raises:
            TrialError: The simulation diverged.
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
        delay, substeps = (
            robot.control_delay,
            round(robot.control_timestep / float(model.opt.timestep)),
        )
        if self._gap is not None:
            measurement = NoisyMeasurement(self._gap.level, robot.anatomy, embodiment, rng)
            delay += self._gap.delay
            randomize_initial_pose(robot, model, data, self._gap.level, rng)
            drop_debris(model, data, self._limbs)
        mujoco.mj_forward(model, data)
        senses = SensorReader(model, robot.anatomy, [embodiment])
        brain = make_batch([controller], [embodiment.silent_neurons], len(robot.anatomy.sensors))
        commands = np.zeros((1, model.nu))
        underway = deque(np.zeros((delay, model.nu)))
        # What is logged as commanded is what the controller said, not what the motors have got.
        where = signal_fields(robot, model)
        live = {signal: place.reader(bind_data(data)) for signal, place in where.items()}
        live |= {"sensors": lambda: brain.readings, "commands": lambda: commands}
        for k in range(steps):
            senses.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], brain.readings)
            measurement.corrupt_readings(brain.readings[0])
            brain.step(commands)
            underway.append(commands[0].copy())
            data.ctrl[:] = underway.popleft()
            yield Sample(
                time=k * robot.control_timestep,
                values={
                    signal: measurement.measure(signal, live[signal]()[0]).copy()
                    for signal in SIGNALS
                },
            )
            if k + 1 < steps:
                mujoco.mj_step(model, data, substeps)
                if data.warning.number.any():
                    raise TrialError(
                        f"the simulation of the physical robot broke down after step {k}: its "
                        f"model is unstable under this controller; try a smaller physics time step"
                    )
