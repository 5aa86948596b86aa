"""Physical robots: what the algorithm may ask of one, and a simulated one that hides its fault."""

import dataclasses
from collections import deque
from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

import mujoco
import numpy as np

from selfmodel.behaviour import SIGNALS, Sample
from selfmodel.debris import add_debris, drop_debris, lost_limbs
from selfmodel.driver import Driver, drive
from selfmodel.embodiment import Embodiment, embody
from selfmodel.errors import TrialError
from selfmodel.gap import Gap, perturbed
from selfmodel.hypothesis import INTACT, Hypothesis
from selfmodel.instruments import ExactInstruments, Instruments, NoisyInstruments
from selfmodel.places import fields_of, places
from selfmodel.robot import Robot
from selfmodel.senses import Senses
from selfmodel.start import jitter_start
from selfmodel.structure import Structure, add_structure


class PhysicalRobot(Protocol):
    """The only way in which the algorithm reaches a robot: it runs a controller and looks on."""

    def run(self, controller: Driver, steps: int) -> Iterator[Sample]:
        """Runs a controller from the start position, one sample a control step as it happens.

        A caller that stops iterating stops the robot.

        Args:
            controller: What drives the robot.
            steps: Control steps to run.

        Yields:
            The state, the readings and the commands of each step, ``steps`` of them. Times are
            those that the control loop aims at, multiples of the control time step to the bit;
            when a step really was is its ``moment``, on a robot that is ``Timed``.
        """
        ...


@runtime_checkable
class Timed(PhysicalRobot, Protocol):
    """A physical robot with a clock of its own: each of its samples has a ``moment``.

    No trial of it can be made again as it was. So one that is stopped before its end is kept as a
    finished log that says so, where that of a simulated robot is an unfinished file.
    """

    @property
    def clock(self) -> Callable[[], float]:
        """Tells the time, s, from any beginning; it never goes back."""
        ...


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
        model = _model(robot, hidden, seed, gap=self._gap, structure=structure, limbs=self._limbs)
        self._embodiment = embody(model, robot.anatomy, hidden, seed)
        self._noise = np.random.SeedSequence(seed, spawn_key=(stream,))

    def run(self, controller: Driver, steps: int) -> Iterator[Sample]:
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
        self, embodiment: Embodiment, controller: Driver, steps: int, rng: np.random.Generator
    ) -> Iterator[Sample]:
        robot = self._robot
        model, data = embodiment.model, mujoco.MjData(embodiment.model)
        instruments: Instruments = ExactInstruments()
        delay, substeps = (
            robot.control_delay,
            round(robot.control_timestep / float(model.opt.timestep)),
        )
        if self._gap is not None:
            instruments = NoisyInstruments(self._gap.level, robot.anatomy, embodiment, rng)
            delay += self._gap.delay
            jitter_start(robot, model, data, self._gap.level, rng)
            drop_debris(model, data, self._limbs)
        mujoco.mj_forward(model, data)
        senses = Senses(model, robot.anatomy, [embodiment])
        brain = drive([controller], embodiment.neurons[np.newaxis], len(robot.anatomy.sensors))
        commands = np.zeros((1, model.nu))
        underway = deque(np.zeros((delay, model.nu)))
        # What is logged as commanded is what the controller said, not what the motors have got.
        where = places(robot, model)
        live = {signal: place.reader(fields_of(data)) for signal, place in where.items()}
        live |= {"sensors": lambda: brain.readings, "commands": lambda: commands}
        for k in range(steps):
            senses.read(data.sensordata[np.newaxis], data.qpos[np.newaxis], brain.readings)
            instruments.receive(brain.readings[0])
            brain.step(commands)
            underway.append(commands[0].copy())
            data.ctrl[:] = underway.popleft()
            yield Sample(
                time=k * robot.control_timestep,
                values={
                    signal: instruments.observe(signal, live[signal]()[0]).copy()
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


def _model(
    robot: Robot,
    hidden: Hypothesis,
    seed: int,
    *,
    gap: Gap | None,
    structure: Structure | None,
    limbs: tuple[str, ...],
) -> mujoco.MjModel:
    """The model of a physical robot with no fault in it but what reshapes it."""
    model = robot.model
    if structure is not None or limbs or any(fault.kind.reshape for fault in hidden.faults):
        spec = robot.specification(hidden, seed)
        if structure is not None:
            add_structure(spec, structure)
        if limbs:
            add_debris(spec, limbs)
        model = spec.compile()
    return model if gap is None else perturbed(model, gap)
