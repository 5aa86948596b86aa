"""The contract of a comparator, as a check that anybody can run on theirs."""

import numpy as np

from selfmodel.behaviour import SIGNALS, Behaviour
from selfmodel.comparator import Comparator
from selfmodel.trial import Trial


def check_comparator(comparator: Comparator, trial: Trial, simulated: Behaviour) -> None:
    """Checks that a comparator does what ``Comparator`` says.

    Args:
        comparator: The one to check.
        trial: A logged trial.
        simulated: All signals of at least two runs with the trial's controller, the first of
            which did what the trial shows, ``(n, steps, width)``.

    Raises:
        ValueError: It breaks its contract; the message says in which way.
    """
    if not comparator.name or comparator.name != comparator.name.strip():
        raise ValueError(f"a comparator needs a name, got {comparator.name!r}")
    record = comparator.request(trial).record
    if not record or not set(record) <= set(SIGNALS):
        raise ValueError(f"a request must record some of {SIGNALS}, got {record}")
    asked = Behaviour(
        simulated.names, simulated.time, {signal: simulated[signal] for signal in record}
    )
    before = {signal: asked[signal].copy() for signal in record}
    distances = comparator.distances(asked, trial)
    runs = len(asked[record[0]])
    if distances.shape != (runs,):
        raise ValueError(f"expected a distance for each of {runs} runs, got {distances.shape}")
    if not np.all(np.isfinite(distances)) or np.any(distances < 0):
        raise ValueError(f"distances must be finite and at least 0, got {distances}")
    if distances[0] != 0:
        raise ValueError(f"a run that did what the trial shows must be at 0, got {distances[0]}")
    if not np.array_equal(distances, comparator.distances(asked, trial)):
        raise ValueError("the same arguments must give the same distances")
    if any(not np.array_equal(before[signal], asked[signal]) for signal in record):
        raise ValueError("a comparator must not change what it is given")
    for run in range(runs):
        alone = Behaviour(
            asked.names, asked.time, {signal: asked[signal][run : run + 1] for signal in record}
        )
        if not np.array_equal(comparator.distances(alone, trial), distances[run : run + 1]):
            raise ValueError(f"the distance of run {run} must not depend on the other runs")
