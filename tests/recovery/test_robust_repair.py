"""Promises of the robust repair: its cost, its candidates, its errors, and where it begins."""

import dataclasses
from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Evolution, Generation
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.recovery import robust_repair
from selfmodel.recovery.cma_es import STARTS
from selfmodel.recovery.repair import CandidateController
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.recovery.robust_repair import (
    COST,
    FIRST_COST,
    SHORT_STEPS,
    RobustFitness,
    RobustRepair,
    from_repertoire,
    robust,
    rollouts_of,
)
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT, Score, upright_within
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.rollout import SimulationResult
from selfmodel.simulation.simulator import Simulator
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import unstable
from tests.recovery.test_repertoire import ORIGIN

pytestmark = pytest.mark.search

NOISY_EA = partial(Evolution, noisy=True)
LAST = Score("last", ("base_position",), lambda *given: given[2]["base_position"][..., -1, 0])
SMALL = dataclasses.replace(Settings().scaled(20), generations=8, steps=100)


class Watched(Simulator):
    """A simulator that notes the hypotheses and the steps of each batch under conditions."""

    def __init__(self, robot: Robot, threads: int = 2) -> None:
        super().__init__(robot, threads)
        self.asked: list[tuple[list[Hypothesis], int]] = []

    def run_under(self, conditions, uncertainty, drivers, steps, record) -> SimulationResult:  # noqa: ANN001  # those of Simulator
        """Simulates as ever."""
        self.asked.append(([one.hypothesis for one in conditions], steps))
        return super().run_under(conditions, uncertainty, drivers, steps, record)


def repaired(
    simulator: Simulator,
    settings: Settings = SMALL,
    score: Score = DISPLACEMENT,
    *,
    hypotheses: Sequence[Hypothesis] = (INTACT,),
    seeds: Sequence[Controller] = (),
    seed: int = 0,
    **options: object,
) -> tuple[tuple[CandidateController, ...], list[Generation]]:
    robot, generations = simulator.robot, []
    repair = RobustRepair(simulator, settings, network_for(robot), score, **options)
    rng, assumed = np.random.default_rng(seed), partial(assumed_uncertainty, robot)
    return repair(hypotheses, assumed, seeds, rng, generations.append), generations


def fitness_of(simulator: Simulator) -> RobustFitness:
    robot = simulator.robot
    return RobustFitness(simulator, DISPLACEMENT, (INTACT,), assumed_uncertainty(robot))


def test_the_mean_and_the_lower_tail_count_alike_and_one_divergence_rejects_nobody():
    scores = np.array([[0.0, 10.0, 10.0, 10.0], [7.0, 7.0, 7.0, 7.0], [4.0, 4.0, 4.0, 8.0]])
    np.testing.assert_allclose(robust(scores), [(7.5 + 0) / 2, 7, (5 + 4) / 2])
    np.testing.assert_allclose(robust(np.array([[3.0]])), [3.0])
    some, none = [5.0, 5.0, 5.0, -np.inf], [-np.inf] * 4
    assert np.argsort(-robust(np.array([none, some]))).tolist() == [1, 0]
    assert np.isfinite(robust(np.array([some]))).all()


def test_scores_are_those_of_each_condition_and_minus_infinity_of_a_divergence(quadruped: Robot):
    drivers = random_controllers(quadruped, 3)
    fitness = fitness_of(Simulator(quadruped, 1))
    scores = fitness(drivers, 4, 50, np.random.default_rng(0))
    alone = fitness(drivers[1:2], 4, 50, np.random.default_rng(0))
    diverged = fitness_of(Simulator(unstable(quadruped), 1))(
        drivers, 2, 50, np.random.default_rng(0)
    )

    assert scores.shape == (3, 4)
    assert len(np.unique(scores)) == 12
    np.testing.assert_array_equal(alone, scores[1:2])
    assert np.isneginf(diverged).all()
    assert np.isneginf(robust(diverged)).all()


def test_candidates_are_better_than_chance_under_new_conditions_and_best_first(quadruped: Robot):
    simulator = Simulator(quadruped, 2)
    found, _ = repaired(simulator)
    fitness = fitness_of(simulator)
    by_chance, best = (
        robust(fitness(drivers, 8, SMALL.steps, np.random.default_rng(1)))
        for drivers in (random_controllers(quadruped, 40), [found[0].controller])
    )

    assert best[0] > np.quantile(by_chance, 0.9)
    values = [float(robust(own.scores[None])[0]) for own in found]
    assert values == sorted(values, reverse=True)
    assert found[0].predicted == pytest.approx(found[0].scores.mean())


@pytest.mark.parametrize("known", [0, 1])
@pytest.mark.parametrize("options", [{}, {"make_search": NOISY_EA}], ids=["cma-es", "ea"])
def test_it_costs_what_it_may_and_reports_its_progress(
    quadruped: Robot, known: int, options: dict[str, object]
):
    simulator = Simulator(quadruped, 2)
    seeds = random_controllers(quadruped, known)
    found, generations = repaired(simulator, seeds=seeds, **options)
    cost, spent = rollouts_of(SMALL, known=bool(known)), simulator.stats.steps / SMALL.steps

    assert abs(spent - cost) < SMALL.population, "the largest difference is a generation"
    assert [own.number for own in generations] == list(range(1, len(generations) + 1))
    assert generations[-1].number == generations[-1].total
    assert np.isfinite(found[0].scores).all()
    assert not {own.controller for own in found} & {*seeds}


@pytest.mark.parametrize(
    ("score", "steps"),
    [
        (DISPLACEMENT, {300, 600}),
        (UPRIGHT, {300, 600}),
        (upright_within(), {300, 600}),
        (LAST, {600}),
    ],
    ids=lambda given: getattr(given, "name", ""),
)
def test_rollouts_have_half_of_the_steps_at_first_with_a_score_that_grows_with_time(
    quadruped: Robot, score: Score, steps: set[int]
):
    settings = dataclasses.replace(Settings().scaled(6), generations=4, steps=600)
    repaired(simulator := Watched(quadruped), settings, score)
    random, *searched, first, last = (number for _, number in simulator.asked)

    assert random == SHORT_STEPS
    assert searched == sorted(searched)
    halves = sum(300 for one in searched if one == 300)
    assert halves <= 0.5 * sum(searched), "the share of half rollouts is HALVED"
    assert {*searched} == steps
    assert (first, last) == (600, 600), "candidates are compared over whole trials"


def test_candidates_of_the_papers_numbers_are_compared_under_many_conditions(quadruped: Robot):
    settings = dataclasses.replace(Settings(), steps=2)
    repaired(simulator := Watched(quadruped), settings, seeds=random_controllers(quadruped, 1))

    assert [len(conditions) for conditions, _ in simulator.asked[-2:]] == [4, 16]


def test_a_known_controller_makes_a_large_repair_cheaper_and_no_small_one():
    large = Settings()
    assert rollouts_of(large, known=True) == round(COST * large.evaluations)
    assert rollouts_of(large, known=False) == FIRST_COST * large.evaluations
    assert rollouts_of(SMALL, known=True) == rollouts_of(SMALL, known=False)
    medium = Settings().scaled(30)
    assert rollouts_of(medium, known=True) == 600
    assert COST * medium.evaluations < 600 < FIRST_COST * medium.evaluations


def test_the_number_of_threads_changes_nothing_and_the_seed_all(quadruped: Robot):
    one, two = (repaired(Simulator(quadruped, threads))[0] for threads in (1, 2))
    other = repaired(Simulator(quadruped, 1), seed=1)[0]

    assert [own.controller for own in one] == [own.controller for own in two]
    np.testing.assert_array_equal(one[0].scores, two[0].scores)
    assert other[0].controller not in [own.controller for own in one]


def test_only_the_hypotheses_that_are_given_are_simulated(quadruped: Robot):
    weak = parse("motor:front_left_knee=0.5", quadruped.anatomy)
    repaired(simulator := Watched(quadruped), hypotheses=(weak, INTACT))

    assert {one for conditions, _ in simulator.asked for one in conditions} == {weak, INTACT}


def test_a_repair_that_no_simulation_survives_is_an_error(quadruped: Robot):
    with pytest.raises(WorkError, match="of quadruped as intact, got 0 of 8 with the best 4 of"):
        repaired(Simulator(unstable(quadruped), 2))


@pytest.mark.parametrize(("share", "number"), [(0.4, None), (0.5, 4)])
def test_a_candidate_whose_simulations_mostly_diverge_is_none(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch, share: float, number: int | None
):
    def partly(self: RobustFitness, *given: object) -> np.ndarray:
        scores = whole(self, *given)
        scores[:, round(share * scores.shape[1]) :] = -np.inf
        return scores

    whole = RobustFitness.__call__
    monkeypatch.setattr(RobustFitness, "__call__", partly)
    monkeypatch.setattr(robust_repair, "_comparisons", lambda _: ((8, 10), (4, 10)))
    if number is None:
        with pytest.raises(WorkError, match="got 16 of 40 with the best 4 of"):
            repaired(Simulator(quadruped, 2))
    else:
        assert len(repaired(Simulator(quadruped, 2))[0]) == number


@pytest.mark.parametrize("generations", [1, 2])
@pytest.mark.parametrize("population", [2, 3])
def test_the_least_search_finds_a_controller_that_is_not_known(
    quadruped: Robot, population: int, generations: int
):
    least = dataclasses.replace(Settings().scaled(population), generations=generations, steps=10)
    known = random_controllers(quadruped, 3)
    found, _ = repaired(Simulator(quadruped, 1), least, seeds=known, make_search=NOISY_EA)

    assert found
    assert not {own.controller for own in found} & {*known}


def test_mutants_of_a_known_controller_are_candidates_and_itself_is_not(quadruped: Robot):
    least = dataclasses.replace(Settings().scaled(12), generations=1, steps=100)
    known = repaired(Simulator(quadruped, 2), seed=5)[0][0].controller
    found, _ = repaired(Simulator(quadruped, 2), least, seeds=(known,))
    different = [np.count_nonzero(own.controller.genome != known.genome) for own in found]

    assert min(different) <= 5, "one in a hundred weights of a mutant is drawn anew"
    assert known not in [own.controller for own in found]


GAITS = Settings().scaled(40)


def repertoire(robot: Robot, gaits: int) -> Repertoire:
    design = network_for(robot)
    genomes = np.round(draw_genomes(np.random.default_rng(5), (gaits, design.weights)), 2)
    return Repertoire(design, genomes, np.arange(gaits, dtype=float), np.zeros((gaits, 4)), ORIGIN)


def test_a_repertoire_begins_with_known_controllers_and_distinct_gaits(quadruped: Robot):
    found, known = repertoire(quadruped, 1000), np.full(68, 0.3)
    make = from_repertoire(found)
    asked = make(68, draw_genomes, GAITS, np.random.default_rng(0), [known]).ask()
    other = make(68, draw_genomes, GAITS, np.random.default_rng(1), [known]).ask()
    short = dataclasses.replace(GAITS, steps=100)

    assert len(asked) == 1 + round(GAITS.evaluations / 8 * 5)  # 200 of 1,000 steps each
    assert (asked[0] == known).all()
    drawn = [own.tobytes() for own in asked[1:]]
    assert set(drawn) <= {own.tobytes() for own in found.genomes}
    assert len(set(drawn)) == len(drawn)
    assert not np.array_equal(asked, other)
    cheap = make(68, draw_genomes, short, np.random.default_rng(0)).ask()
    assert len(cheap) == round(GAITS.evaluations / 8)


@pytest.mark.parametrize(("gaits", "asked"), [(3, STARTS), (60, 60), (300, 300)])
def test_runs_start_from_different_gaits_of_a_repertoire_and_stay_near_them(
    quadruped: Robot, gaits: int, asked: int
):
    make = from_repertoire(repertoire(quadruped, gaits))
    search = make(68, draw_genomes, GAITS, np.random.default_rng(0))
    first = search.ask()

    assert len(first) == asked
    assert len({own.tobytes() for own in first}) == gaits
    if gaits > STARTS:
        search.tell(first.sum(axis=1))
        starts = [group.mean(axis=0) for group in np.split(search.ask(), STARTS)]
        distances = np.array([np.abs(first - start).mean(axis=1) for start in starts])
        assert len(set(distances.argmin(axis=1))) == STARTS
        assert distances.min(axis=1).max() < 0.1
