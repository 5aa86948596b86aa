"""Promises of the robust repair: its cost, its candidates, its errors."""

import dataclasses
from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.repair.candidate_controller import CandidateController
from selfmodel.recovery.repair.genome_search import SHORT_STEPS
from selfmodel.recovery.repair.noisy_ea import NoisyEa
from selfmodel.recovery.repair.paper_repair import RepairSearch
from selfmodel.recovery.repair.robust_fitness import RobustFitness, robust
from selfmodel.recovery.repair.robust_repair import (
    COST,
    FIRST_COST,
    RobustRepair,
    rollouts_of,
)
from selfmodel.recovery.scores.fitness import DISPLACEMENT, Score
from selfmodel.recovery.scores.joint_limits import upright_within
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from tests.helpers.hostile import unstable

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
    found, generations = repaired(quadruped, Simulator(quadruped, 2), make_search=NoisyEa)
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
        "selfmodel.recovery.repair.robust_repair._comparisons", lambda _: ((8, 10), (4, 10))
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
    repair = RobustRepair(Simulator(quadruped, 1), least, design, DISPLACEMENT, make_search=NoisyEa)
    found = repair((INTACT,), partial(assumed_uncertainty, quadruped), known, rng, lambda _: None)

    assert found
    assert not {own.controller for own in found} & {*known}


def test_mutants_of_a_known_controller_are_candidates_and_itself_is_not(quadruped: Robot):
    least = dataclasses.replace(Settings().scaled(12), generations=1, steps=100)
    known = RepairSearch(Simulator(quadruped, 2), SMALL, score=DISPLACEMENT).best(
        INTACT, (), np.random.default_rng(5), lambda _generation: None
    )
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
