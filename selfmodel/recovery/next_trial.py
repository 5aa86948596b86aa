"""Choice of a physical trial that separates hypotheses.

The next test is the test on which models disagree most, as in Bongard, Zykov and Lipson,
*Resilient machines through continuous self-modeling* (Science 2006).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import CommandSource, Controller
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.falls import first_falls
from selfmodel.recovery.recover import RecoveryLoop, by_repair
from selfmodel.recovery.repair import mutants, untried_mutants
from selfmodel.recovery.result import DiscriminatingTrial
from selfmodel.settings import Settings
from selfmodel.simulation.rollout import SimulationResult
from selfmodel.simulation.simulator import Simulator, cached_rows
from selfmodel.trials.signals import DISAGREEMENT_SCALES, difference
from selfmodel.trials.trajectory import Trajectory

GENERATIONS = 8
"""Generations of offspring of the controllers with the largest disagreement: the first offspring of
a gait moves almost as the gait does."""

MAX_HYPOTHESES = 5
"""Maximum number of hypotheses to separate; the time of the choice grows with this number."""

EARLY_STEPS = 100
"""Control steps over which disagreement is computed. Later, contacts make any two predictions
differ. In closed loop, two hypotheses differed 2.4 times as much as self-models that differ by 3 %
in the first quarter of a second, and 1.7 times after three quarters; later steps added nothing."""


def by_disagreement(loop: RecoveryLoop) -> Controller:
    """Returns the controller with the largest disagreement of the hypotheses, or a repair.

    A repair is returned once the diagnosis is ``explained`` or ``intact`` and either has no
    undetectable fault or has the same undetectable faults as the diagnosis before, which the last
    trial did not resolve. The last of all trials is always a repair: only a repair that is tried
    restores the robot.
    """
    *earlier, diagnosis = loop.diagnoses
    unresolved = bool(earlier) and earlier[-1].undetectable == diagnosis.undetectable
    is_certain = diagnosis.verdict in ("intact", "explained")
    certain = is_certain and (unresolved or not diagnosis.undetectable)
    if certain or loop.trials_left == 1:
        return by_repair(loop)
    loop.on_event(DiscriminatingTrial(candidates_to_separate(diagnosis)))
    known = loop.controllers
    return discriminating_controller(diagnosis, known, loop.simulator, loop.settings, loop.rng)


def discriminating_controller(
    diagnosis: Diagnosis,
    known: Sequence[Controller],
    simulator: Simulator,
    settings: Settings,
    rng: np.random.Generator,
) -> Controller:
    """Returns the controller with the largest disagreement of the hypotheses to separate.

    Known controllers, of earlier trials and newest first, are not tried again.
    """
    disagreement = Disagreement(candidates_to_separate(diagnosis), simulator, settings.steps)
    same_design = [controller for controller in known if controller.design == known[0].design]
    pool = untried_mutants(same_design, known, settings, rng)
    for _ in range(GENERATIONS):
        best = [pool[i] for i in disagreement.ordered(pool)[1][: settings.survivors]]
        children = mutants(best, settings.population, settings, rng)
        distinct = dict.fromkeys([*best, *children])
        pool = [controller for controller in distinct if controller not in known]
    return disagreement.most_discriminative(pool)


def candidates_to_separate(diagnosis: Diagnosis) -> tuple[Hypothesis, ...]:
    """Returns the best hypothesis and the hypotheses to separate from it, at most five in all.

    These are the indistinguishable hypotheses or, if there are none and the diagnosis is
    ``unexplained`` or ``not judged``, the next in the ranking; then the hypotheses with an
    undetectable fault. If there are none of these either, the next in the ranking follow.
    """
    followers = tuple(one.hypothesis for one in diagnosis.ranked[1:] if math.isfinite(one.distance))
    unexplained = followers if diagnosis.verdict in ("unexplained", "not judged") else ()
    others = diagnosis.indistinguishable or unexplained
    to_separate = dict.fromkeys([*others, *diagnosis.undetectable]) or followers
    return (diagnosis.best, *to_separate)[:MAX_HYPOTHESES]


@dataclass(eq=False)
class Disagreement:
    """Disagreement of some hypotheses, best first, on controllers; cached by controller.

    Falls count in all steps of a trial, disagreement in the first ``EARLY_STEPS``.
    """

    hypotheses: Sequence[Hypothesis]
    simulator: Simulator
    steps: int
    _known: dict[Controller, FloatArray] = field(default_factory=dict, init=False)

    def most_discriminative(self, candidates: Sequence[Controller]) -> Controller:
        """Returns the controller whose trial is predicted to separate the hypotheses best.

        Controllers with which the robot falls under any hypothesis, or whose simulation diverges,
        are excluded. If no controller remains, the controller with the latest first fall is
        returned. The first of equals is.
        """
        falls, order = self.ordered(candidates)
        for i in order:
            if falls[i] < min(self.steps, EARLY_STEPS):
                break  # the remaining ones fall early, too
            falls[i] = self._first_falls([candidates[i]], self.steps)[0][0]
            if falls[i] == self.steps:
                return candidates[i]
        return candidates[int(falls.argmax())]

    def ordered(self, candidates: Sequence[Controller]) -> tuple[FloatArray, list[int]]:
        """Returns the first early fall per controller, and their indices, the best one first.

        The order is of decreasing disagreement. Controllers with which the robot falls in the first
        ``EARLY_STEPS`` are last, the earliest fall at the end.
        """
        falls, disagreement = np.array(cached_rows(self._known, candidates, self._evaluate)).T
        return falls, np.lexsort((-disagreement, -falls)).tolist()

    def _evaluate(self, candidates: Sequence[Controller]) -> FloatArray:
        """First fall and disagreement per controller, ``(controllers, 2)``."""
        early = min(self.steps, EARLY_STEPS)
        falls, trajectory = self._first_falls(candidates, early)
        upright = np.flatnonzero(falls == early)
        disagreement = np.zeros(len(candidates))
        if upright.size:
            commands = trajectory["commands"][upright, 0]
            known = disagreements_on(commands, self.hypotheses, self.simulator)
            disagreement[upright] = np.where(np.isnan(known), -1.0, known)
        return np.stack([falls, disagreement], axis=1)

    def _first_falls(
        self, drivers: Sequence[Controller], steps: int
    ) -> tuple[IndexArray, Trajectory]:
        """First fall under any hypothesis, ``(drivers,)``, 0 for a divergence; the rollouts."""
        robot, outcome = self.simulator.robot, _run(self.simulator, drivers, self.hypotheses, steps)
        normals = np.array([build(robot, hypothesis).normal for hypothesis in self.hypotheses])
        falls = first_falls(outcome.trajectory, normals, robot.standing_height)
        first = np.where(outcome.diverged, 0, falls).min(axis=1)
        return np.asarray(first), outcome.trajectory


def disagreements_on(
    commands: FloatArray, hypotheses: Sequence[Hypothesis], simulator: Simulator
) -> FloatArray:
    """Returns the disagreement of hypotheses on given commands, 0 to 1, ``(runs,)``.

    All hypotheses are simulated with the same commands, ``(runs, steps, motors)``, such as those of
    a controller under the best hypothesis. In closed loop, a difference in one reading changes the
    whole motion, and a comparator that is given the commands gains no evidence from such a change.
    The disagreement is NaN where a simulation diverged.
    """
    motors = simulator.robot.anatomy.names.motors
    drivers = [Playback(motors, rows) for rows in commands]
    outcome = _run(simulator, drivers, hypotheses, commands.shape[1])
    with np.errstate(invalid="ignore", over="ignore"):  # values of a diverged simulation
        values = disagreements(outcome.trajectory)
    return np.where(outcome.diverged.any(axis=1), np.nan, values)


def _run(
    simulator: Simulator,
    drivers: Sequence[CommandSource],
    hypotheses: Sequence[Hypothesis],
    steps: int,
) -> SimulationResult:
    """Each driver's rollouts by hypothesis, ``(drivers, hypotheses, steps, width)``."""
    runs = [(hypothesis, driver) for driver in drivers for hypothesis in hypotheses]
    outcome = simulator.run(runs, steps, (*DISAGREEMENT_SCALES, "commands"))
    return outcome.grouped(len(drivers), len(hypotheses))


def disagreements(trajectory: Trajectory) -> FloatArray:
    """Returns the disagreement of the hypotheses on each controller, 0 to 1, ``(controllers,)``.

    The disagreement is the mean difference of two predictions, relative to ``DISAGREEMENT_SCALES``,
    over all pairs of hypotheses, signals, columns and early steps. The signals are
    ``(controllers, hypotheses, steps, width)``.
    """
    controllers, hypotheses = trajectory["sensors"].shape[:2]
    pairs = list(combinations(range(hypotheses), 2))
    total = np.zeros(controllers)
    for name, scale in DISAGREEMENT_SCALES.items():
        values = trajectory[name][:, :, :EARLY_STEPS]
        for first, second in pairs:
            differences = difference(name, values[:, first], values[:, second])
            total += np.minimum(np.abs(differences) / scale, 1).mean(axis=(1, 2))
    return total / max(len(pairs), 1) / len(DISAGREEMENT_SCALES)
