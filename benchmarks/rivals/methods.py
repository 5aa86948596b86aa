"""The methods: each spends physical trials on a damaged robot, without selfmodel's diagnosis."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from scipy.spatial import distance
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern

from selfmodel.arrays import BoolArray, FloatArray, IndexArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import InputError, TrialError
from selfmodel.evolution import Evolution, reproduce
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.recovery.falls import first_falls, held_at_the_end
from selfmodel.recovery.map_elites import Evaluate
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trajectory import Sample, collect

FINALISTS, RUNS = 5, 5
"""Best controllers of each search of the oracle, and further runs of each of them: a single noisy
run of the best is too optimistic."""

KEPT = 50
"""Number of controllers that a search returns."""

LENGTH_SCALE, NOISE = 0.4, 0.001
"""Length scale rho over duty factors of the Matérn 5/2 kernel, and variance of the noise. Source of
these and the next two: A. Cully, J. Clune, D. Tarapore and J.-B. Mouret, *Robots that can adapt
like animals* (Nature 521:503, 2015), Methods, and the authors' program (github.com/resibots/ITE,
``hexa_bomean.cpp``)."""

EXPLORATION = 0.05
"""Weight kappa of the standard deviation in the upper confidence bound."""

CLOSE_ENOUGH = 0.9
"""The trials end when the best of them reaches this part of the best prediction, alpha."""

Fitness = Callable[[Sequence[Controller]], FloatArray]
"""Fitness of controllers, ``(n,)``: forward displacement up to the first fall, m."""


@dataclass(frozen=True)
class Trial:
    """Forward displacement of a physical trial, m, that up to the first fall, and control steps."""

    displacement: float
    upright: float
    fallen: bool
    steps: int


@dataclass(eq=False)
class Problem:
    """A damaged physical robot, and what a method may use to recover it.

    Attributes:
        physical: The damaged physical robot.
        robot: The healthy robot as its model describes it.
        normal: Unit normal of the ground, ``(3,)``.
        trials: Physical trials that the method may spend, of ``steps`` each.
        period: Generations of T-Resilience between two physical trials.
        evaluations: Evaluations of a search in simulation.
        evaluate: Evaluation in simulation of the healthy robot, without noise.
        healthy: Fitness in simulation of the healthy robot, with noise of sensors and start.
        hidden: Fitness of the physical robot's own model with its own noise: for the oracle alone.
        repertoire: Repertoire of the healthy robot; None if no method needs it.
        done: Trials so far.
    """

    physical: PhysicalRobot
    robot: Robot
    normal: FloatArray
    steps: int
    trials: int
    design: Design
    settings: Settings
    period: int
    evaluations: int
    rng: np.random.Generator
    evaluate: Evaluate
    healthy: Fitness
    hidden: Fitness
    repertoire: Repertoire | None = None
    done: list[Trial] = field(default_factory=list)

    @property
    def left(self) -> int:
        """Number of trials that are left."""
        return self.trials - len(self.done)

    def controller(self, genome: FloatArray) -> Controller:
        """Returns the controller of a genome."""
        return Controller(self.design, genome)

    def search(self, fitness: Fitness) -> Sequence[Controller]:
        """Returns the best distinct controllers of a search by CMA-ES, best first."""
        cma_es = CmaEs(self.design.weights, self.settings, self.rng, ())
        known: dict[Controller, float] = {}

        def evaluated(genomes: FloatArray) -> FloatArray:
            controllers = [self.controller(genome) for genome in genomes]
            scores = fitness(controllers)
            known.update(zip(controllers, scores.tolist(), strict=True))
            return scores

        while cma_es.evaluations < self.evaluations:
            cma_es.tell(evaluated(cma_es.ask()))
        evaluated(cma_es.candidates(KEPT))
        return sorted(known, key=lambda one: -known[one])[:KEPT]

    def run(self, controller: Controller) -> float:
        """Runs a trial, and returns its displacement up to the first fall, m.

        A run that ends early counts as far as it went.
        """
        samples: list[Sample] = []
        try:
            for sample in self.physical.run(controller, self.steps):
                samples.append(sample)  # noqa: PERF402  # the samples before an error are kept
        except TrialError:
            if not samples:
                raise
        logged = collect(self.robot.anatomy.names, samples)
        whole = held_at_the_end(logged) if logged.steps < self.steps else logged
        found = int(first_falls(whole, self.normal, self.robot.standing_height))
        fall, x = min(found, logged.steps), logged["base_position"][:, 0]
        upright = float(x[max(fall - 1, 0)] - x[0])
        self.done.append(Trial(float(x[-1] - x[0]), upright, fall < logged.steps, logged.steps))
        return upright


def oracle(problem: Problem) -> None:
    """Repeats the best of two searches on the hidden model; all trials have one controller.

    The oracle is a bound and no method: no robot has its own hidden model. Its value is the mean of
    its trials, not their best.
    """
    finalists = [one for _ in range(2) for one in problem.search(problem.hidden)[:FINALISTS]]
    means = np.mean([problem.hidden(finalists) for _ in range(RUNS)], axis=0)
    while problem.left:
        problem.run(finalists[int(np.argmax(means))])


def physical_evolution(problem: Problem) -> None:
    """Evolves controllers on the physical robot, with the EA of the paper and no self-model.

    Source: the paper, section IV: the control experiment.
    """
    length = problem.design.weights
    search = Evolution(length, problem.settings, problem.rng, draw=draw_genomes)
    while problem.left:
        genomes = search.ask()
        fitness = [problem.run(problem.controller(one)) for one in genomes[: problem.left]]
        if len(fitness) == len(genomes):
            search.tell(np.array(fitness))


def healthy_evolution(problem: Problem) -> None:
    """Searches in simulation of the healthy robot with noise, and tries the best controllers.

    The trials run the distinct controllers of one search, best first: what the failure spares.
    """
    for controller in problem.search(problem.healthy)[: problem.trials]:
        problem.run(controller)


def random_search(problem: Problem) -> None:
    """Tries controllers with random genomes on the physical robot."""
    while problem.left:
        problem.run(problem.controller(draw_genomes(problem.rng, (problem.design.weights,))))


def trial_and_error(problem: Problem) -> None:
    """Intelligent Trial and Error: Bayesian optimisation over a repertoire, no diagnosis.

    Tries the gait with the largest upper confidence bound, again and again. The Gaussian process
    predicts the difference between the speed of a gait on the physical robot and in the
    repertoire. Speeds are in m/s: with the published constants, the prior standard deviation is 1
    in the unit of the performance. Source: Cully et al. (2015).

    Raises:
        InputError: The problem has no repertoire.
    """
    repertoire = problem.repertoire
    if repertoire is None:
        raise InputError("trial-and-error needs a repertoire of the healthy robot, and got none")
    timestep = problem.robot.control_timestep
    predicted = repertoire.scores / (repertoire.origin.steps * timestep)
    duration = problem.steps * timestep
    tried: list[int] = []
    speeds: list[float] = []
    while problem.left:
        points, gaits = repertoire.descriptors[tried], repertoire.descriptors
        correction, deviation = posterior(points, np.array(speeds) - predicted[tried], gaits)
        expected = predicted + correction
        if speeds and max(speeds) >= CLOSE_ENOUGH * expected.max():
            break
        tried.append(int(np.argmax(expected + EXPLORATION * deviation)))
        speeds.append(problem.run(repertoire.controller(tried[-1])) / duration)


def t_resilience(problem: Problem) -> None:
    """Evolves controllers of the healthy robot for displacement, transferability and diversity.

    Every ``period`` generations, a random member of the population is tried on the physical robot.
    The differences between these trials and their simulations train a surrogate, which predicts
    the transferability of all others. The last trial is for the member with the largest
    displacement after the predicted difference.

    Source: S. Koos, A. Cully and J.-B. Mouret, *Fast damage recovery in robotics with the
    T-Resilience algorithm* (International Journal of Robotics Research 32:1700, 2013). The
    surrogate is the Gaussian process of ``trial_and_error`` instead of a support vector machine.
    All differences are listed in ``docs/results/other-methods.md``.
    """
    size, rng = problem.settings.population, problem.rng
    genomes = draw_genomes(rng, (size, problem.design.weights))
    displacements, duty = _simulated(problem, genomes)
    points: list[FloatArray] = []
    differences: list[float] = []

    def predicted(queries: FloatArray) -> FloatArray:
        """Predicted difference between simulation and physical trial, m, ``(n,)``."""
        known = np.array(points).reshape(len(points), queries.shape[1])
        return posterior(known, np.array(differences), queries)[0]

    while problem.left:
        for _ in range(problem.period):
            # The population is sorted, so the entrant with the lower index wins.
            parents = genomes[rng.integers(size, size=(size, 2)).min(axis=1)]
            children = reproduce(parents, draw_genomes, problem.settings, rng)
            both = zip(
                (genomes, displacements, duty),
                (children, *_simulated(problem, children)),
                strict=True,
            )
            genomes, displacements, duty = (np.concatenate(pair) for pair in both)
            diversity = distance.cdist(genomes, genomes).mean(axis=1)
            objectives = np.stack([displacements, -predicted(duty), diversity], axis=1)
            chosen = best_first(objectives)[:size]
            genomes, displacements, duty = genomes[chosen], displacements[chosen], duty[chosen]
        member = int(rng.integers(size))
        if problem.left == 1:
            member = int(np.argmax(displacements - predicted(duty)))
        physical = problem.run(problem.controller(genomes[member]))
        points.append(duty[member])
        differences.append(abs(float(displacements[member]) - physical))


def _simulated(problem: Problem, genomes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns displacements, m, and duty factors; 0 for a gait that falls or goes backwards."""
    scores, duty = problem.evaluate([problem.controller(genome) for genome in genomes])
    return np.maximum(scores, 0.0), np.nan_to_num(duty)


def posterior(
    points: FloatArray, values: FloatArray, queries: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Returns mean and standard deviation of a Gaussian process of variance 1, ``(m,)`` each.

    The observations are at points ``(n, d)``, the queries ``(m, d)``; without observations, mean
    and deviation are 0 and 1.
    """
    if not len(points):
        return np.zeros(len(queries)), np.ones(len(queries))
    kernel = Matern(LENGTH_SCALE, length_scale_bounds="fixed", nu=2.5)
    process = GaussianProcessRegressor(kernel, alpha=NOISE, optimizer=None)
    mean, deviation = process.fit(points, values).predict(queries, return_std=True)
    return np.asarray(mean), np.asarray(deviation)


def best_first(objectives: FloatArray) -> IndexArray:
    """Returns the order of NSGA-II: by front without dominance, then by crowding distance.

    Source: K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, *A fast and elitist multiobjective
    genetic algorithm: NSGA-II* (IEEE Transactions on Evolutionary Computation 6:182, 2002).
    """
    no_worse = (objectives[:, np.newaxis] >= objectives).all(axis=-1)
    better = (objectives[:, np.newaxis] > objectives).any(axis=-1)
    dominates: BoolArray = np.asarray(no_worse & better)
    fronts = np.full(len(objectives), -1, dtype=np.intp)
    crowding = np.zeros(len(objectives))
    while (left := fronts < 0).any():
        own = np.flatnonzero(left & ~dominates[left].any(axis=0))
        fronts[own] = fronts.max() + 1
        for column in objectives[own].T:
            order = own[np.argsort(column, kind="stable")]
            values = np.sort(column)
            crowding[order[[0, -1]]] = np.inf
            if (spread := values[-1] - values[0]) > 0:
                crowding[order[1:-1]] += (values[2:] - values[:-2]) / spread
    return np.lexsort((-crowding, fronts))


METHODS: Mapping[str, Callable[[Problem], None]] = MappingProxyType(
    {
        "oracle": oracle,
        "physical-evolution": physical_evolution,
        "trial-and-error": trial_and_error,
        "healthy-evolution": healthy_evolution,
        "random-search": random_search,
        "t-resilience": t_resilience,
    }
)
"""Every method by its name; the oracle is a bound."""
