"""Estimated number of simulated control steps of a diagnosis, before it runs.

The constants were measured on quadruped and hexapod, with every comparator, populations of 10 and
40, and 3 and 10 generations: with kinds without severities, the estimate was within a factor of 2
of ``SimulationStats.steps``. Severities are fitted, which takes up to four times as many steps.
"""

import math
from dataclasses import dataclass

from selfmodel.settings import Settings
from selfmodel.simulation.requests import Ensemble, Request, Segments

DISTINCT_SCALE, DISTINCT_EXPONENT = 2.2, 0.57
"""The EA simulates about ``scale * evaluations ** exponent`` distinct hypotheses: later generations
repeat those of earlier ones."""

REFINED_PER_CANDIDATE = 4.0
"""Hypotheses that the refinement simulates, per fault of the hypothesis space."""

UNSEARCHED_PER_CANDIDATE = 0.95
"""Hypotheses of unsearched kinds that are simulated, per fault of these kinds."""

SHARE_WITH_OWN_DYNAMICS = 0.46
"""Share of hypotheses that are simulated where sensor faults do not change the motion."""


def steps_of(request: Request, steps: int) -> int:
    """Returns the control steps of one comparison of a hypothesis with a trial.

    Args:
        request: Request of the prepared trial.
        steps: Control steps of the trial.
    """
    if isinstance(request, Segments):
        return len(request.commands) * request.horizon
    return steps * (request.members if isinstance(request, Ensemble) else 1)


@dataclass(frozen=True)
class SearchSize:
    """Properties of a diagnosis that determine its cost.

    Attributes:
        settings: Parameters of the EA.
        candidates: Number of single faults in the hypothesis space.
        unsearched: Number of single faults of unsearched kinds.
        surrogate_steps: Control steps per hypothesis on all trials with the surrogate comparator.
        is_refined: Whether the best hypotheses are refined.
        uses_segments: Whether short predictions are compared, open loop.
        has_healthy: Whether there are trials of the healthy robot.
    """

    settings: Settings
    candidates: int
    unsearched: int
    surrogate_steps: int
    is_refined: bool
    uses_segments: bool
    has_healthy: bool

    @property
    def simulated_steps(self) -> int:
        """Estimated number of simulated control steps."""
        settings = self.settings
        children = settings.population - settings.survivors
        evaluations = settings.population + (settings.generations - 1) * children
        hypotheses = min(evaluations, DISTINCT_SCALE * math.pow(evaluations, DISTINCT_EXPONENT))
        if self.is_refined:
            hypotheses += REFINED_PER_CANDIDATE * self.candidates
        if self.uses_segments:
            if self.has_healthy:
                hypotheses += UNSEARCHED_PER_CANDIDATE * self.unsearched
            hypotheses *= SHARE_WITH_OWN_DYNAMICS
        steps: int = round(hypotheses * self.surrogate_steps)
        return steps
