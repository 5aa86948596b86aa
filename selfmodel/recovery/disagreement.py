"""On which controller hypotheses disagree most: what a physical trial with it would tell.

That a test is chosen for what it tells hypotheses apart is from Bongard, Zykov and Lipson,
*Resilient machines through continuous self-modeling* (Science 2006).
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from types import MappingProxyType

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.command_source import CommandSource
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.cache import Cache
from selfmodel.simulation.outcome import SimulationResult
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour, Signal
from selfmodel.trials.rotation import directions
from selfmodel.trials.signal_difference import difference

EARLY = 100
"""Control steps that disagreement is read off. By then contact has made two predictions differ
whatever they assume: closed loop, where two hypotheses differed 2.4 times as much as self-models
that differ by 3 % in the first quarter of a second, it was 1.7 times after three quarters, and no
more came."""

SCALES: Mapping[Signal, float] = MappingProxyType(
    {
        "sensors": 1.0,
        "joint_positions": 0.3,
        "base_position": 0.1,
        "base_orientation": 0.3,
        "base_linear_velocity": 0.3,
        "base_angular_velocity": 1.0,
    }
)
"""By how much two predictions must differ to be told apart at a glance, in each signal's unit; what
differs by more counts no more, so that one wild prediction does not decide."""

LOWEST = 0.5
"""A base below this part of its standing height has fallen; one that begins on the ground, as a
swimmer's, cannot fall so."""

STEEPEST = np.radians(60)
"""A base that leans by more than at the start has fallen, rad."""


class Disagreement:
    """What some hypotheses disagree on; no controller is looked at twice.

    The predictions that are compared are of the same commands, those that the first hypothesis
    leads to. Through a controller, one reading more makes another motion, and a comparator that is
    given the commands learns nothing from that.

    Args:
        hypotheses: Those that are still in the running, the best first.
        simulator: The self-model.
        steps: Control steps of a trial. Falls are looked for in all of it, disagreement early on.
    """

    def __init__(self, hypotheses: Sequence[Hypothesis], simulator: Simulator, steps: int) -> None:
        self._hypotheses, self._simulator, self._steps = tuple(hypotheses), simulator, steps
        self._early = min(steps, EARLY)
        self._seen: Cache[Controller] = Cache()

    def most_discriminative(self, candidates: Sequence[Controller]) -> Controller:
        """Returns the controller whose trial is predicted to tell the hypotheses apart best.

        A controller with which the robot falls under any of the hypotheses, or whose simulation
        diverges, is out. Where all are, it is the one with which the first fall comes latest.

        Args:
            candidates: At least one; of equals, the first is taken.
        """
        falls, order = self._ordered(candidates)
        for i in order:
            if falls[i] < self._early:
                break  # and so it is with the rest
            whole = self._predicted([candidates[i]], self._steps)
            falls[i] = self._first_falls(whole)[0]
            if falls[i] == self._steps:
                return candidates[i]
        return candidates[int(falls.argmax())]

    def most_discriminative_first(self, candidates: Sequence[Controller]) -> list[Controller]:
        """Returns the controllers, those on which the hypotheses disagree most first.

        Those with which the robot falls at once come last, the earliest fall at the end.
        """
        return [candidates[i] for i in self._ordered(candidates)[1]]

    def _ordered(self, candidates: Sequence[Controller]) -> tuple[IndexArray, list[int]]:
        """When the robot first falls with each, and the numbers of all, the most telling first."""
        falls, telling = np.array(self._seen.get_or_compute(candidates, self._looked_at)).T
        return falls.astype(np.intp), np.lexsort((-telling, -falls)).tolist()

    def _looked_at(self, candidates: Sequence[Controller]) -> FloatArray:
        """When the robot first falls with each, and how much is disagreed on until then."""
        early = self._predicted(candidates, self._early)
        falls = self._first_falls(early)
        upright = np.flatnonzero(falls == self._early)
        telling = np.zeros(len(candidates))
        if upright.size:
            names, commands = early.behaviour.names, early.behaviour["commands"][upright, 0]
            alike = [Playback(names.motors, rows) for rows in commands]
            found = self._predicted(alike, self._early)
            parted = disagreements(found.behaviour)
            telling[upright] = np.where(found.diverged.any(axis=1), -1.0, parted)
        return np.stack([falls, telling], axis=1)

    def _predicted(self, drivers: Sequence[CommandSource], steps: int) -> SimulationResult:
        """Each driver under each hypothesis, ``(drivers, hypotheses, steps, width)``."""
        runs = [(hypothesis, one) for one in drivers for hypothesis in self._hypotheses]
        outcome = self._simulator.run(runs, steps, (*SCALES, "commands"))
        return outcome.grouped(len(drivers), len(self._hypotheses))

    def _first_falls(self, simulated: SimulationResult) -> IndexArray:
        """When the robot first falls under any of the hypotheses; what diverges falls at once."""
        robot = self._simulator.robot
        normals = np.array([build(robot, hypothesis).normal for hypothesis in self._hypotheses])
        falls = first_falls(simulated.behaviour, normals, robot.standing_height)
        return np.asarray(np.where(simulated.diverged, 0, falls).min(axis=1))


def disagreements(behaviour: Behaviour) -> FloatArray:
    """Returns how much the hypotheses disagree on each controller, 0 to 1.

    It is the mean over all pairs of hypotheses, signals, columns and early steps of the difference
    between their predictions.

    Args:
        behaviour: The signals of ``SCALES``, ``(controllers, hypotheses, steps, width)`` each.

    Returns:
        ``(controllers,)``; 0 for a single hypothesis, NaN where a simulation diverged.
    """
    controllers, hypotheses = behaviour["sensors"].shape[:2]
    pairs = list(combinations(range(hypotheses), 2))
    total = np.zeros(controllers)
    for name, scale in SCALES.items():
        values = behaviour[name][:, :, :EARLY]
        for one, other in pairs:
            apart = difference(name, values[:, one], values[:, other])
            total += np.minimum(np.abs(apart) / scale, 1).mean(axis=(1, 2))
    return total / max(len(pairs), 1) / len(SCALES)


def first_falls(behaviour: Behaviour, normals: FloatArray, standing_height: float) -> IndexArray:
    """Returns the step at which the robot has first fallen, or the number of steps if it never has.

    Args:
        behaviour: Of the base its position and orientation, ``(..., steps, width)`` each.
        normals: Unit vectors that stand on the ground, ``(..., 3)``, of a shape that broadcasts to
            that of the runs. The ground goes through the origin.
        standing_height: Of the base at the start, m.

    Returns:
        Of shape ``(...)``.
    """
    height = np.einsum("...sk,...k->...s", behaviour["base_position"], normals)
    upward = directions(behaviour["base_orientation"])[..., 2:]  # the world's, as the base has it
    # The cosine of how far the base leans.
    upright = (upward * upward[..., :1, :]).sum(axis=-1)
    low = (height < LOWEST * standing_height) & (standing_height > 0)
    fallen = low | (upright < np.cos(STEEPEST))
    return np.where(fallen.any(axis=-1), fallen.argmax(axis=-1), behaviour.steps)
