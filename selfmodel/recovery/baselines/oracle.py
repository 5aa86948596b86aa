"""Oracle: what the damaged body can do, found on the physical robot's own hidden model."""

import numpy as np

from selfmodel.recovery.baselines.problem import (
    BaselineSettings,
    BaselineTrial,
    OnTrial,
    PhysicalTrials,
    Problem,
)

FINALISTS = 5
"""Best controllers of each search that are compared in further runs: a single noisy run of the best
is too optimistic."""

RUNS = 5
"""Further runs of each finalist."""


def oracle(
    problem: Problem, settings: BaselineSettings, rng: np.random.Generator, on_trial: OnTrial
) -> tuple[BaselineTrial, ...]:
    """Repeats the best of several searches on the hidden model; all trials have one controller.

    The oracle is a bound and no method: no robot has its own hidden model. Its value is the mean of
    its trials, not their best.
    """
    finalists = [
        controller
        for _ in range(settings.searches)
        for controller in problem.search(problem.design, problem.hidden, settings.evaluations, rng)[
            :FINALISTS
        ]
    ]
    means = np.mean([problem.hidden(finalists) for _ in range(RUNS)], axis=0)
    best = finalists[int(np.argmax(means))]
    trials = PhysicalTrials(problem, settings, on_trial)
    while trials.left:
        trials.run(best)
    return trials.done
