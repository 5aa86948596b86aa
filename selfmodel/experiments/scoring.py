"""Whether a diagnosis is right, for experiments in which the truth is known."""

from collections.abc import Sequence

import numpy as np

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial


def is_correct(
    best: Hypothesis, truth: Hypothesis, trials: Sequence[Trial], simulator: Simulator
) -> bool:
    """Returns whether a hypothesis is the truth, or cannot be told from it by these trials.

    Two hypotheses cannot be told apart if their simulated behaviour, all signals of it, is the
    same to the bit under the controller of every trial.

    Args:
        best: The hypothesis that a diagnosis ranks first, in canonical form.
        truth: What is really wrong, in canonical form.
        trials: The trials that the diagnosis explains.
        simulator: The self-model.
    """
    return best == truth or all(_same_bits(best, truth, trial, simulator) for trial in trials)


def _same_bits(best: Hypothesis, truth: Hypothesis, trial: Trial, simulator: Simulator) -> bool:
    controller = trial.plan.controller
    runs = [(best, controller), (truth, controller)]
    behaviour = simulator.run(runs, trial.behaviour.steps, SIGNALS).behaviour
    return all(np.array_equal(*behaviour[signal]) for signal in SIGNALS)
