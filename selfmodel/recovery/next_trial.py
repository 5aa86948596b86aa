"""How the next physical trial is chosen: to restore the function, or to tell hypotheses apart."""

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
from selfmodel.recovery.events import Event, Question
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator

GENERATIONS = 8
"""How often offspring is bred of the controllers on which hypotheses disagree most. A gait's first
children walk as it does."""

MOST = 5
"""Hypotheses that a trial is to tell apart at most: the time grows with their number."""


@dataclass(frozen=True, eq=False)
class Situation:
    """What a choice of the next trial is made from.

    Attributes:
        known: The trials and diagnoses so far, the last of them of all trials.
        trials_left: How many trials may still be run, this one included.
        simulator: The self-model.
        settings: The paper's numbers.
        rng: Every random choice comes from it.
        repaired: Evolves the controller that compensates for what the last diagnosis says.
        on_event: Is told what happens.
    """

    known: Database
    trials_left: int
    simulator: Simulator
    settings: Settings
    rng: np.random.Generator
    repaired: Callable[[], Controller]
    on_event: Callable[[Event], None]


NextTrial = Callable[[Situation], Controller]
"""A way to choose the controller of the next physical trial."""


def by_repair(situation: Situation) -> Controller:
    """Chooses the controller that compensates for the best hypothesis, as the paper does."""
    return situation.repaired()


def by_disagreement(situation: Situation) -> Controller:
    """Chooses the controller on which hypotheses disagree, and a repair when that is over.

    It is over once a diagnosis is ``explained``, and nothing may be wrong unseen besides or the
    trial before could not show it either; and when only one trial is left: the trials are spent to
    bring the robot back, and what is never tried restores nothing.
    """
    *earlier, diagnosis = situation.known.diagnoses
    asked = bool(earlier) and earlier[-1].undetectable == diagnosis.undetectable
    sure = diagnosis.verdict == "explained" and (asked or not diagnosis.undetectable)
    if sure or situation.trials_left == 1:
        return situation.repaired()
    situation.on_event(Question(candidates_to_separate(diagnosis)))
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
    """Returns the controller on which the hypotheses that are in the running disagree most.

    Args:
        diagnosis: What is known of them.
        known: Controllers that were tried, the newest first; the newest is not tried again.
        simulator: The self-model.
        settings: The paper's numbers.
        rng: Every random choice comes from it.
    """
    dispute = Disagreement(candidates_to_separate(diagnosis), simulator, settings.steps)
    pool = candidates(known, settings, rng)
    for _ in range(GENERATIONS):
        best = dispute.most_discriminative_first(pool)[: settings.survivors]
        children = offspring(best, settings, rng)
        pool = [one for one in dict.fromkeys([*best, *children]) if one != known[0]]
    return dispute.most_discriminative(pool)


def candidates_to_separate(diagnosis: Diagnosis) -> tuple[Hypothesis, ...]:
    """Returns the best hypothesis and those that a trial should tell from it, five at most.

    They are its rivals, or where it has none and explains too little those that follow it in the
    ranking; then what may be wrong besides. Where that is nothing, they are those that follow it.
    """
    followers = tuple(one.hypothesis for one in diagnosis.ranked[1:] if math.isfinite(one.distance))
    others = diagnosis.indistinguishable or (
        followers if diagnosis.verdict == "unexplained" else ()
    )
    untold = dict.fromkeys([*others, *diagnosis.undetectable]) or followers
    return (diagnosis.best, *untold)[:MOST]


def candidates(
    known: Sequence[Controller], settings: Settings, rng: np.random.Generator
) -> list[Controller]:
    """Returns the controllers that a choice is made from, each once, the tried ones first.

    Args:
        known: Controllers that were tried, the newest first. Those of its design are candidates,
            but for the newest; and so are their offspring, as many as an EA has genomes.
        settings: How offspring is bred.
        rng: Every random choice comes from it.
    """
    newest = known[0]
    alike = [controller for controller in known if controller.design == newest.design]
    bred = offspring(alike, settings, rng)
    found = [one for one in dict.fromkeys([*alike, *bred]) if one != newest]
    if not found:  # no child is another than its parent, as where nothing mutates
        found = [Controller(newest.design, draw_genomes(rng, newest.genome.shape))]
    return found


def offspring(
    parents: Sequence[Controller], settings: Settings, rng: np.random.Generator
) -> list[Controller]:
    """Returns as many children as an EA has genomes.

    Args:
        parents: At least one, all of one design; each is one in turn.
        settings: How offspring is bred.
        rng: Every random choice comes from it.
    """
    genomes = np.array([parent.genome for parent in parents])
    bred = reproduce(
        np.resize(genomes, (settings.population, genomes.shape[1])), draw_genomes, settings, rng
    )
    return [Controller(parents[0].design, genome) for genome in bred]
