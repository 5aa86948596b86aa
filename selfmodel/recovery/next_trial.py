"""Choice of the next physical trial: a repair, or a trial that separates hypotheses."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.evolution import reproduce
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.recovery.database import Database
from selfmodel.recovery.disagreement import Disagreement
from selfmodel.recovery.events import DiscriminatingTrial, Event
from selfmodel.recovery.repair.candidate_controller import CandidateController
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator

GENERATIONS = 8
"""Generations of offspring of the controllers with the largest disagreement: the first offspring of
a gait moves almost as the gait does."""

MAX_HYPOTHESES = 5
"""Maximum number of hypotheses to separate; the time of the choice grows with this number."""


@dataclass(frozen=True, eq=False)
class Situation:
    """Input of a choice of the next trial.

    Attributes:
        known: Trials and diagnoses so far; the last diagnosis is of all trials.
        trials_left: Number of trials that remain, including the trial to choose.
        simulator: Self-model.
        settings: The paper's numbers.
        rng: Random number generator of all random choices.
        repaired: Evolves candidates that compensate for the last diagnosis, best first.
        on_event: Callback, called with each event as it happens.
    """

    known: Database
    trials_left: int
    simulator: Simulator
    settings: Settings
    rng: np.random.Generator
    repaired: Callable[[], Sequence[CandidateController]]
    on_event: Callable[[Event], None]


NextTrial = Callable[[Situation], Controller]
"""Chooses the controller of the next physical trial."""


def by_repair(situation: Situation) -> Controller:
    """Returns the best candidate of the repair that was not tried yet.

    If all candidates were tried, a mutant of the best one is returned.
    """
    found = [candidate.controller for candidate in situation.repaired()]
    tried = situation.known.controllers
    untried = [controller for controller in found if controller not in tried]
    return (untried or _untried_offspring(found[:1], tried, situation.settings, situation.rng))[0]


def by_disagreement(situation: Situation) -> Controller:
    """Returns the controller with the largest disagreement of the hypotheses, or a repair.

    A repair is returned once the diagnosis is ``explained`` or ``intact`` and either has no
    undetectable fault or has the same undetectable faults as the diagnosis before, which the last
    trial did not resolve. The last trial is always a repair: only a repair that is tried restores
    the robot.
    """
    *earlier, diagnosis = situation.known.diagnoses
    unresolved = bool(earlier) and earlier[-1].undetectable == diagnosis.undetectable
    is_certain = diagnosis.verdict in ("intact", "explained")
    certain = is_certain and (unresolved or not diagnosis.undetectable)
    if certain or situation.trials_left == 1:
        return by_repair(situation)
    situation.on_event(DiscriminatingTrial(candidates_to_separate(diagnosis)))
    return discriminating_controller(
        diagnosis,
        situation.known.controllers,
        situation.simulator,
        situation.settings,
        situation.rng,
    )


def discriminating_controller(
    diagnosis: Diagnosis,
    known: Sequence[Controller],
    simulator: Simulator,
    settings: Settings,
    rng: np.random.Generator,
) -> Controller:
    """Returns the controller with the largest disagreement of the hypotheses to separate.

    Args:
        diagnosis: Last diagnosis.
        known: Controllers of earlier trials, newest first; none is tried again.
        simulator: Self-model.
        settings: The paper's numbers.
        rng: Random number generator of all random choices.
    """
    disagreement = Disagreement(candidates_to_separate(diagnosis), simulator, settings.steps)
    pool = candidates(known, settings, rng)
    for _ in range(GENERATIONS):
        best = disagreement.most_discriminative_first(pool)[: settings.survivors]
        children = offspring(best, settings, rng)
        distinct = dict.fromkeys([*best, *children])
        pool = [controller for controller in distinct if controller not in known]
    return disagreement.most_discriminative(pool)


def candidates_to_separate(diagnosis: Diagnosis) -> tuple[Hypothesis, ...]:
    """Returns the best hypothesis and the hypotheses to separate from it, at most five in all.

    These are the indistinguishable hypotheses or, if there are none and the diagnosis is
    ``unexplained``, the next in the ranking; then the hypotheses with an undetectable fault. If
    there are none of these either, the next in the ranking follow.
    """
    followers = tuple(
        candidate.hypothesis
        for candidate in diagnosis.ranked[1:]
        if math.isfinite(candidate.distance)
    )
    others = diagnosis.indistinguishable or (
        followers if diagnosis.verdict == "unexplained" else ()
    )
    to_separate = dict.fromkeys([*others, *diagnosis.undetectable]) or followers
    return (diagnosis.best, *to_separate)[:MAX_HYPOTHESES]


def candidates(
    known: Sequence[Controller], settings: Settings, rng: np.random.Generator
) -> list[Controller]:
    """Returns the distinct controllers to choose from, none of which was tried.

    Args:
        known: Controllers of earlier trials, newest first. Candidates are one population of
            offspring of those of the newest controller's design.
        settings: Numbers of the EA.
        rng: Random number generator of all random choices.
    """
    newest = known[0]
    same_design = [controller for controller in known if controller.design == newest.design]
    return _untried_offspring(same_design, known, settings, rng)


def _untried_offspring(
    parents: Sequence[Controller],
    tried: Sequence[Controller],
    settings: Settings,
    rng: np.random.Generator,
) -> list[Controller]:
    """Returns the distinct children that were not tried; a random controller if there is none.

    Args:
        parents: At least one controller, all of one design.
        tried: Controllers of earlier trials.
        settings: Numbers of the EA.
        rng: Random number generator of all random choices.
    """
    distinct = dict.fromkeys(offspring(parents, settings, rng))
    found = [controller for controller in distinct if controller not in tried]
    if not found:  # every child equals its parent, as without mutation
        design, genome = parents[0].design, parents[0].genome
        found = [Controller(design, draw_genomes(rng, genome.shape))]
    return found


def offspring(
    parents: Sequence[Controller], settings: Settings, rng: np.random.Generator
) -> list[Controller]:
    """Returns one population of children.

    Args:
        parents: At least one controller, all of one design, used in turn.
        settings: Numbers of the EA.
        rng: Random number generator of all random choices.
    """
    genomes = np.array([parent.genome for parent in parents])
    bred = reproduce(
        np.resize(genomes, (settings.population, genomes.shape[1])), draw_genomes, settings, rng
    )
    return [Controller(parents[0].design, genome) for genome in bred]
