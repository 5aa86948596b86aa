"""Promises of the robust repair: its cost, its candidates, its errors."""

import dataclasses
from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Evolution, Generation
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.cma_es import STARTS
from selfmodel.recovery.repair import CandidateController, RepairSearch
from selfmodel.recovery.repertoire.repertoire import Repertoire
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
from selfmodel.simulation.simulator import Simulator
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import unstable
from tests.recovery.repertoire.test_repertoire import ORIGIN

NOISY_EA = partial(Evolution, noisy=True)
LAST = Score("last", ("base_position",), lambda *given: given[2]["base_position"][..., -1, 0])

SMALL = dataclasses.replace(Settings().scaled(20), generations=8, steps=100)


def repaired(
    robot: Robot,
    simulator: Simulator,
    seed: int = 0,
    seeds: Sequence[Controller] = (),
    **options: object,
) -> tuple[tuple[CandidateController, ...], list[Generation]]:
    repair = RobustRepair(simulator, SMALL, network_for(robot), DISPLACEMENT, **options)
    generations: list[Generation] = []
    found = repair(
        (INTACT,),
        partial(assumed_uncertainty, robot),
        seeds,
        np.random.default_rng(seed),
        generations.append,
    )
    return found, generations


def test_candidates_are_better_than_chance_under_new_conditions_and_best_first(quadruped: Robot):
    simulator = Simulator(quadruped, 2)
    found, _ = repaired(quadruped, simulator)
    fitness = RobustFitness(simulator, DISPLACEMENT, (INTACT,), assumed_uncertainty(quadruped))
    design, rng = network_for(quadruped), np.random.default_rng(9)
    random = [type(found[0].controller)(design, genome) for genome in draw_genomes(rng, (40, 68))]
    by_chance = robust(fitness(random, 8, SMALL.steps, np.random.default_rng(1)))
    best = robust(fitness([found[0].controller], 8, SMALL.steps, np.random.default_rng(1)))

    assert best[0] > np.quantile(by_chance, 0.9)
    values = [float(robust(own.scores[None])[0]) for own in found]
    assert values == sorted(values, reverse=True)
    assert found[0].predicted == pytest.approx(found[0].scores.mean())


@pytest.mark.parametrize("known", [0, 1])
def test_it_costs_what_it_may_and_reports_its_progress(quadruped: Robot, known: int):
    simulator, design = Simulator(quadruped, 2), network_for(quadruped)
    seeds = [Controller(design, np.zeros(design.weights))] * known
    _, generations = repaired(quadruped, simulator, seeds=seeds)
    cost, spent = rollouts_of(SMALL, known=bool(known)), simulator.stats.steps / SMALL.steps

    assert abs(spent - cost) < SMALL.population, "the largest difference is a generation"
    assert [own.number for own in generations] == list(range(1, len(generations) + 1))
    assert generations[-1].number == generations[-1].total


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
    asked: list[int] = []

    class Watched(Simulator):
        def run_under(self, conditions, uncertainty, controllers, steps, *rest, **options):  # noqa: ANN001, ANN002, ANN003, ANN202
            asked.append(steps)
            return super().run_under(conditions, uncertainty, controllers, steps, *rest, **options)

    RobustRepair(Watched(quadruped, 2), settings, network_for(quadruped), score)(
        (INTACT,),
        partial(assumed_uncertainty, quadruped),
        (),
        np.random.default_rng(0),
        lambda _generation: None,
    )
    random, *searched = asked[:-2]
    assert random == SHORT_STEPS
    assert searched == sorted(searched)
    halves = sum(300 for one in searched if one == 300)
    assert halves <= 0.5 * sum(searched), "the share of half rollouts is HALVED"
    assert {*searched} == steps
    assert asked[-2:] == [600, 600], "candidates are compared over whole trials"


def test_candidates_of_every_repair_of_the_papers_budget_are_compared_under_many_conditions(
    quadruped: Robot,
):
    compared: list[int] = []

    class Watched(Simulator):
        def run_under(self, conditions, uncertainty, controllers, *rest, **options):  # noqa: ANN001, ANN002, ANN003, ANN202
            compared.append(len(conditions))
            return super().run_under(conditions, uncertainty, controllers, *rest, **options)

    settings = dataclasses.replace(Settings(), steps=2)
    known = Controller(design := network_for(quadruped), np.zeros(design.weights))
    RobustRepair(Watched(quadruped, 2), settings, design, DISPLACEMENT)(
        (INTACT,),
        partial(assumed_uncertainty, quadruped),
        (known,),
        np.random.default_rng(0),
        lambda _generation: None,
    )
    assert compared[-2:] == [4, 16]


def test_a_known_controller_makes_a_large_repair_cheaper_and_no_small_one():
    large = Settings()
    assert rollouts_of(large, known=True) == round(COST * large.evaluations)
    assert rollouts_of(large, known=False) == FIRST_COST * large.evaluations
    assert rollouts_of(SMALL, known=True) == rollouts_of(SMALL, known=False)
    medium = Settings().scaled(30)
    assert rollouts_of(medium, known=True) == 600
    assert COST * medium.evaluations < 600 < FIRST_COST * medium.evaluations


def test_the_number_of_threads_changes_nothing(quadruped: Robot):
    found = [repaired(quadruped, Simulator(quadruped, threads))[0] for threads in (1, 2)]
    assert [own.controller for own in found[0]] == [own.controller for own in found[1]]
    np.testing.assert_array_equal(found[0][0].scores, found[1][0].scores)
    assert repaired(quadruped, Simulator(quadruped, 1), seed=1)[0][0].controller not in [
        own.controller for own in found[0]
    ]


def test_the_papers_ea_can_be_its_search(quadruped: Robot):
    found, generations = repaired(quadruped, Simulator(quadruped, 2), make_search=NOISY_EA)
    assert np.isfinite(found[0].scores).all()
    assert generations[0].evaluations == SMALL.population
    assert generations[-1].number == generations[-1].total
    assert generations[-1].evaluations >= 0.85 * FIRST_COST * SMALL.evaluations


def test_only_the_hypotheses_that_are_given_are_simulated(quadruped: Robot):
    weak = parse("motor:front_left_knee=0.5", quadruped.anatomy)
    seen: set[object] = set()

    class Watched(Simulator):
        def run_under(self, conditions, *rest, **options):  # noqa: ANN001, ANN002, ANN003, ANN202
            seen.update(condition.hypothesis for condition in conditions)
            return super().run_under(conditions, *rest, **options)

    repair = RobustRepair(Watched(quadruped, 2), SMALL, network_for(quadruped), DISPLACEMENT)
    repair(
        (weak, INTACT),
        partial(assumed_uncertainty, quadruped),
        (),
        np.random.default_rng(0),
        lambda _generation: None,
    )
    assert seen == {weak, INTACT}


def test_a_repair_that_no_simulation_survives_is_an_error(quadruped: Robot):
    with pytest.raises(WorkError, match="of quadruped as intact, got 0 of 8 with the best 4 of"):
        repaired(quadruped, Simulator(unstable(quadruped), 2))


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
    monkeypatch.setattr(
        "selfmodel.recovery.robust_repair._comparisons", lambda _: ((8, 10), (4, 10))
    )
    if number is None:
        with pytest.raises(WorkError, match="got 16 of 40 with the best 4 of"):
            repaired(quadruped, Simulator(quadruped, 2))
    else:
        assert len(repaired(quadruped, Simulator(quadruped, 2))[0]) == number


@pytest.mark.parametrize("generations", [1, 2])
@pytest.mark.parametrize("population", [2, 3])
def test_the_least_search_finds_a_controller_that_is_not_known(
    quadruped: Robot, population: int, generations: int
):
    least = dataclasses.replace(Settings().scaled(population), generations=generations, steps=10)
    design, rng = network_for(quadruped), np.random.default_rng(0)
    known = [Controller(design, genome) for genome in draw_genomes(rng, (3, design.weights))]
    repair = RobustRepair(
        Simulator(quadruped, 1), least, design, DISPLACEMENT, make_search=NOISY_EA
    )
    found = repair((INTACT,), partial(assumed_uncertainty, quadruped), known, rng, lambda _: None)

    assert found
    assert not {own.controller for own in found} & {*known}


def test_mutants_of_a_known_controller_are_candidates_and_itself_is_not(quadruped: Robot):
    least = dataclasses.replace(Settings().scaled(12), generations=1, steps=100)
    known = RepairSearch(Simulator(quadruped, 2), SMALL, score=DISPLACEMENT)(
        (INTACT,),
        partial(assumed_uncertainty, quadruped),
        (),
        np.random.default_rng(5),
        lambda _generation: None,
    )[0].controller
    found = RobustRepair(Simulator(quadruped, 2), least, network_for(quadruped), DISPLACEMENT)(
        (INTACT,),
        partial(assumed_uncertainty, quadruped),
        (known,),
        np.random.default_rng(0),
        lambda _generation: None,
    )
    different = [np.count_nonzero(own.controller.genome != known.genome) for own in found]

    assert min(different) <= 5, "one in a hundred weights of a mutant is drawn anew"
    assert known not in [own.controller for own in found]


def test_the_mean_and_the_lower_tail_count_alike():
    scores = np.array([[0.0, 10.0, 10.0, 10.0], [7.0, 7.0, 7.0, 7.0], [4.0, 4.0, 4.0, 8.0]])
    np.testing.assert_allclose(robust(scores), [(7.5 + 0) / 2, 7, (5 + 4) / 2])
    np.testing.assert_allclose(robust(np.array([[3.0]])), [3.0])


def test_scores_are_those_of_each_condition(quadruped: Robot):
    fitness = RobustFitness(
        Simulator(quadruped, 1), DISPLACEMENT, (INTACT,), assumed_uncertainty(quadruped)
    )
    drivers = random_controllers(quadruped, 3)
    scores = fitness(drivers, 4, 50, np.random.default_rng(0))

    assert scores.shape == (3, 4)
    assert len(np.unique(scores)) == 12
    np.testing.assert_array_equal(
        fitness(drivers[1:2], 4, 50, np.random.default_rng(0)), scores[1:2]
    )


def test_a_simulation_that_diverges_scores_minus_infinity(quadruped: Robot):
    fitness = RobustFitness(
        Simulator(unstable(quadruped), 1), DISPLACEMENT, (INTACT,), assumed_uncertainty(quadruped)
    )
    scores = fitness(random_controllers(quadruped, 2), 2, 50, np.random.default_rng(0))

    assert np.isneginf(scores).all()
    assert np.isneginf(robust(scores)).all()


def test_one_diverged_rollout_does_not_reject_a_controller():
    some, none = [5.0, 5.0, 5.0, -np.inf], [-np.inf] * 4
    assert np.argsort(-robust(np.array([none, some]))).tolist() == [1, 0]
    assert np.isfinite(robust(np.array([some]))).all()


GAITS = Settings().scaled(40)


def repertoire(robot: Robot, gaits: int) -> Repertoire:
    design = network_for(robot)
    genomes = np.round(draw_genomes(np.random.default_rng(5), (gaits, design.weights)), 2)
    return Repertoire(design, genomes, np.arange(gaits, dtype=float), np.zeros((gaits, 4)), ORIGIN)


def test_the_first_generation_is_known_controllers_and_distinct_gaits(quadruped: Robot):
    found, known = repertoire(quadruped, 1000), np.full(68, 0.3)
    make = from_repertoire(found)
    asked = make(68, draw_genomes, GAITS, np.random.default_rng(0), [known]).ask()

    assert len(asked) == 1 + round(GAITS.evaluations / 8 * 5)  # 200 of 1,000 steps each
    assert (asked[0] == known).all()
    gaits = {own.tobytes() for own in found.genomes}
    drawn = [own.tobytes() for own in asked[1:]]
    assert set(drawn) <= gaits
    assert len(set(drawn)) == len(drawn)


@pytest.mark.parametrize(("gaits", "asked"), [(3, STARTS), (60, 60), (200, 200)])
def test_a_small_repertoire_is_simulated_once_and_its_runs_start_from_different_gaits(
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
        near = {int(np.abs(first - start).mean(axis=1).argmin()) for start in starts}
        assert len(near) == STARTS


def test_the_sample_is_random_and_its_cost_is_bounded(quadruped: Robot):
    make = from_repertoire(repertoire(quadruped, 1000))
    short = dataclasses.replace(GAITS, steps=100)
    samples = [make(68, draw_genomes, short, np.random.default_rng(seed)).ask() for seed in (0, 1)]
    assert len(samples[0]) == round(GAITS.evaluations / 8)
    assert not np.array_equal(*samples)


def test_its_runs_stay_near_the_best_gaits(quadruped: Robot):
    found = repertoire(quadruped, 300)
    search = from_repertoire(found)(68, draw_genomes, GAITS, np.random.default_rng(0))
    fitness = search.ask().sum(axis=1)
    search.tell(fitness)
    groups = np.split(search.ask(), STARTS)

    for group in groups:
        distance = np.abs(found.genomes - group.mean(axis=0)).mean(axis=1).min()
        assert distance < 0.1
