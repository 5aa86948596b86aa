"""Correctness of a diagnosis when the true hypothesis is known."""

from collections.abc import Sequence

import numpy as np

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import Trial


def is_correct(
    best: Hypothesis, truth: Hypothesis, trials: Sequence[Trial], simulator: Simulator
) -> bool:
    """Returns whether a hypothesis is the truth, or behaves like the truth in all trials.

    Two hypotheses behave alike if all signals of their simulations are the same to the bit under
    the controller of every trial.

    Args:
        best: Best hypothesis of a diagnosis, in canonical form.
        truth: Hypothesis of the physical robot, in canonical form.
        trials: Trials that the diagnosis explains.
        simulator: Self-model.
    """
    return best == truth or all(_same_bits(best, truth, trial, simulator) for trial in trials)


def _same_bits(best: Hypothesis, truth: Hypothesis, trial: Trial, simulator: Simulator) -> bool:
    controller = trial.plan.controller
    runs = [(best, controller), (truth, controller)]
    behaviour = simulator.run(runs, trial.behaviour.steps, SIGNALS).behaviour
    return all(np.array_equal(*behaviour[signal]) for signal in SIGNALS)
