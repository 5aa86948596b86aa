"""Repairs of a controller that is known to walk: layers around it, or a fine-tuned last layer.

The search begins at what changes nothing, under the conditions of the robust repair. A layer that
regains too little of what the failure took is followed by a larger one.
"""

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import takewhile
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller, Design
from selfmodel.controllers.policy import Policy, PolicyBatch
from selfmodel.controllers.trained import Finetuned, last_layer, network_of
from selfmodel.errors import InputError
from selfmodel.evolution import GenerationCallback
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.recovery.candidates import (
    CandidateController,
    Candidates,
    RobustFitness,
    converged,
    robust,
    unflattered,
    viable,
)
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.recovery.repair import FINALISTS, JUDGED, MakeSearch, comparisons_of, run_search
from selfmodel.recovery.scores import UPRIGHT, Score
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.rollout import Rollout
from selfmodel.simulation.simulator import Simulator

FIRST_COST, COST = 0.5, 0.26
"""Rollouts of the search of a layer that begins at none and at another layer, relative to the
evaluations of the paper's EA. There are at least two generations. Three times 0.26 from none led
from 8.6 to 9.9 m and from 7.3 to 11.1 m (a Go1 with a dead thigh motor, two seeds)."""

DEVIATION, POPULATION, CONDITIONS = 0.1, 10, 4
"""Standard deviation, genomes and conditions of a generation of a layer's search. With a deviation
of 0.3, nearly all layers of a Go1 fell; 0.1 is 0.05 of a command's half range, and a gain of 7 %.
With 16 genomes under one condition each, 9 of 16 robots across a gap fell, and with 4 conditions 4.
"""

STALLED = 0.8
"""Share of what the failure took from the score that a layer is to regain; the search of one that
regains less has stalled, and goes on with the next larger layer."""

RANK, OBSERVED = 8, 200
"""Features of a fine-tuned policy, and control steps of the walks that they are the features of."""


@dataclass(eq=False)
class LayerRepair:
    """Repair by a change of a controller that is known to walk; a ``Repair``.

    Attributes:
        design: A layer, from which on larger ones are searched; or a policy with a network, whose
            last layer is fine-tuned.
        parts: Physics steps in place of each; see ``unflattered``.
    """

    simulator: Simulator
    settings: Settings
    design: Design
    score: Score = UPRIGHT
    adapts_gait: ClassVar[bool] = True
    evaluations: int = field(default=0, init=False)
    parts: int = field(default=1, init=False)
    _sizes: Sequence[Design] = field(default=(), init=False)

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        uncertainty: Callable[[], DomainDistribution],
        seeds: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> tuple[CandidateController, ...]:
        """Returns layers that are better than none, best first, or else that of zeros."""
        drawn = uncertainty()
        self._sizes = self._sizes or self._smallest_first(hypotheses[0])
        tried = [one for one in seeds if one.design in self._sizes]
        begin = max([self._sizes.index(one.design) for one in tried], default=0)

        def searched() -> tuple[Candidates, Candidates]:
            fitness, known = RobustFitness(self.simulator, self.score, hypotheses, drawn), tried
            for design in self._sizes[begin:]:
                none = Controller(design, np.zeros(design.weights))
                known = list(dict.fromkeys([none, *(widened(one, design) for one in known)]))
                known += self._evolved(fitness, known, rng, on_generation)
                known, scores, intact, again = self._compared(fitness, known, rng)
                values = robust(scores)
                if values.max() - values[-1] >= STALLED * (intact - values[-1]):
                    break
            small = {widened(one, known[0].design): one for one in tried}
            order = np.argsort(-values, kind="stable")
            rows = [k for k in order if values[k] > values[-1]] + [len(known) - 1]
            finite = viable([known[k] for k in rows], scores[rows], fitness, self.evaluations)
            kept = converged(finite, fitness, self.settings.steps, again, small)
            better = tuple(takewhile(lambda one: one.controller != finite[-1].controller, kept))
            return _at_its_size(finite, small), _at_its_size(better or kept[:1], small)

        return unflattered(self, searched)

    def _smallest_first(self, hypothesis: Hypothesis) -> Sequence[Design]:
        own = self.design
        if isinstance(own, Compensated):
            return list(dict.fromkeys([own, replace(own, feedback=True)]))
        if not isinstance(own, Policy) or isinstance(own, Finetuned):
            return [own]
        return [Finetuned.of(own, features_of(own, self.simulator, [INTACT, hypothesis]))]

    def _evolved(
        self,
        fitness: RobustFitness,
        known: Sequence[Controller],
        rng: np.random.Generator,
        on_generation: GenerationCallback,
    ) -> list[Controller]:
        """Returns new layers of a search that begins at the best known one."""
        design, settings = known[0].design, self.settings
        genomes = [one.genome for one in known]
        search = around_identity(design.weights, settings, rng, genomes)
        cost = COST if np.any(genomes) else FIRST_COST
        run_search(
            *(search, fitness, design),
            rollouts=max(round(cost * settings.evaluations), 2 * POPULATION * CONDITIONS),
            steps=settings.steps,
            rng=rng,
            on_generation=on_generation,
            conditions=CONDITIONS,
            count_ended=False,
        )
        self.evaluations += search.evaluations
        evolved = [Controller(design, one) for one in search.candidates(FINALISTS)]
        return [one for one in dict.fromkeys(evolved) if one not in known]

    def _compared(
        self, fitness: RobustFitness, known: Sequence[Controller], rng: np.random.Generator
    ) -> tuple[list[Controller], FloatArray, float, np.random.Generator]:
        """Returns the best of some layers and the first one, which is none, as the last.

        With them are their scores, ``(n, conditions)``, that of the intact robot without one, and
        the generator in the state in which the conditions were drawn.
        """
        (_, fewer), (_, conditions) = comparisons_of(self.settings)
        none, steps = known[0], self.settings.steps
        first = robust(fitness(known, fewer, steps, rng))
        best = [known[k] for k in np.argsort(-first, kind="stable")[:JUDGED] if k]
        intact = replace(fitness, hypotheses=(INTACT,))
        whole = robust(intact([none], conditions, steps, rng))[0]
        again, compared = copy.deepcopy(rng), [*best, none]
        return compared, fitness(compared, conditions, steps, rng), float(whole), again


def features_of(
    policy: Policy, simulator: Simulator, hypotheses: Sequence[Hypothesis]
) -> FloatArray:
    """Returns the features of the last layer of a policy's network, ``(rank, inputs)``.

    They are the principal directions of its inputs while a robot with each hypothesis walks, each
    divided by the root mean square of the inputs along it; the first is nearly their mean.
    """
    graph = network_of(policy)
    robot, layer = simulator.robot, last_layer(graph)
    drivers = [Controller(policy, np.zeros(0))] * len(hypotheses)
    variants = [build(robot, hypothesis) for hypothesis in hypotheses]
    rollout = Rollout(robot, variants, drivers, (), stats=simulator.stats)
    part = replace(graph, output=layer.input, outputs=0)
    states, seen = part.initial(len(drivers)), list[FloatArray]()
    batch = PolicyBatch(policy, len(drivers))
    for k in rollout.steps(OBSERVED):
        batch.readings[:] = rollout.live["sensors"]()
        for signal, values in rollout.observed.items():
            batch.observed[signal][:] = values
        batch.step(np.empty((len(drivers), len(policy.motors))))
        if k % policy.interface.decimation == 0:
            inputs, states = part.step(batch.input, states)
            seen.append(inputs)
    rows = np.concatenate(seen)
    rows = rows[np.isfinite(rows).all(axis=1)]
    _, sizes, directions = np.linalg.svd(rows, full_matrices=False)
    kept = sizes[:RANK] > sizes[0] * 1e-6
    scale = sizes[:RANK][kept, np.newaxis] / np.sqrt(len(rows))
    return np.asarray(directions[:RANK][kept] / scale)


def _at_its_size(some: Candidates, small: Mapping[Controller, Controller]) -> Candidates:
    own = (small.get(one.controller, one.controller) for one in some)
    return tuple(replace(one, controller=its) for one, its in zip(some, own, strict=True))


def widened(controller: Controller, design: Design) -> Controller:
    """Returns a layer as one of at least as many numbers, the others 0."""
    more = design.weights - controller.design.weights
    return Controller(design, np.pad(controller.genome, (0, more)))


def _near_identity(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    return np.clip(DEVIATION * rng.standard_normal(shape), -1, 1)


around_identity: MakeSearch = partial(
    CmaEs,
    draw=_near_identity,
    random=POPULATION,
    deviation=DEVIATION,
    seed_deviation=DEVIATION,
    starts=1,
    population=POPULATION,
)
"""Makes a run of CMA-ES from the best known layer, or else near that which changes nothing."""


def layered(controller: Controller) -> Controller:
    """Returns a controller within a compensating layer that changes nothing.

    A controller that has a layer is returned as it is.
    """
    if isinstance(controller.design, Compensated):
        return controller
    design = Compensated.around(controller)
    return Controller(design, np.zeros(design.weights))


def finetunable(controller: Controller) -> Controller:
    """Returns a controller, if it is a policy whose network has a last layer of weights.

    Raises:
        InputError: It is not.
    """
    try:
        network_of(controller.design)
    except ValueError as error:
        raise InputError(
            f"the repair finetune changes a network: {error}: give the repair compensate"
        ) from error
    return controller
