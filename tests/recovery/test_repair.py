"""Promises of both repairs: where they begin, their cost, their candidates, their errors."""

import dataclasses
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import WorkError
from selfmodel.evolution import Evolution, Generation, GenerationCallback
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.progress import ignore
from selfmodel.recovery import candidates, repair as module
from selfmodel.recovery.candidates import (
    CandidateController,
    RobustFitness,
    converged,
    robust,
    unflattered,
)
from selfmodel.recovery.layers import layered
from selfmodel.recovery.repair import (
    COST,
    FIRST_COST,
    SHORT_STEPS,
    MakeRepair,
    RepairSearch,
    RobustRepair,
    from_repertoire,
    rollouts_of,
)
from selfmodel.recovery.scores import DISPLACEMENT, SCORES, Score, upright_within
from selfmodel.recovery.tracking import following
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import DESIGNS, network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import suite_bodies
from selfmodel.trials.trajectory import forward_displacement
from tests.helpers.drivers import random_controllers, random_cpgs, random_repertoire
from tests.helpers.hostile import unstable
from tests.helpers.policies import policy_of

NOISY_EA = partial(Evolution, draw=draw_genomes, noisy=True)
LAST = Score("last", ("base_position",), lambda *given: given[2]["base_position"][..., -1, 0])
TINY = dataclasses.replace(Settings().scaled(8), generations=2, steps=40)
SMALL = dataclasses.replace(Settings().scaled(20), generations=8, steps=100)


def found_by(
    simulator: Simulator,
    settings: Settings = SMALL,
    score: Score = DISPLACEMENT,
    *,
    make: MakeRepair = RobustRepair,
    hypotheses: Sequence[Hypothesis] = (INTACT,),
    design: Design | None = None,
    seeds: Sequence[Controller] = (),
    seed: int = 0,
    on_generation: GenerationCallback = ignore,
    **options: object,
) -> tuple[CandidateController, ...]:
    """The candidates of a small repair."""
    robot = simulator.robot
    repair = make(simulator, settings, design or network_for(robot), score, **options)
    rng, assumed = np.random.default_rng(seed), partial(assumed_uncertainty, robot)
    return repair(hypotheses, assumed, seeds, rng, on_generation)


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


@pytest.mark.parametrize("repair", [RepairSearch, RobustRepair])
def test_a_repair_is_of_its_seed_at_any_number_of_threads(quadruped: Robot, repair: MakeRepair):
    weak = parse("motor:front_left_knee=0.5", quadruped.anatomy)
    one, two = (
        found_by(Simulator(quadruped, threads), TINY, make=repair, hypotheses=(weak, INTACT))
        for threads in (1, 2)
    )

    assert [each.controller for each in one] == [each.controller for each in two]
    np.testing.assert_array_equal(one[0].scores, two[0].scores)
    values = [float(robust(each.scores[None])[0]) for each in one]
    assert values == sorted(values, reverse=True)


@pytest.mark.parametrize("repair", [RepairSearch, RobustRepair])
def test_a_repair_that_no_simulation_survives_is_an_error(quadruped: Robot, repair: MakeRepair):
    with pytest.raises(WorkError, match=r"as intact, got (0 of 8|none) with .*: check"):
        found_by(Simulator(unstable(quadruped), 2), TINY, make=repair)


@pytest.mark.parametrize("kind", ["network", "cpg"])
@pytest.mark.parametrize("repair", [RepairSearch, RobustRepair])
def test_a_repair_of_one_design_does_not_start_from_controllers_of_another(
    quadruped: Robot, repair: MakeRepair, kind: str
):
    seeds = [*random_controllers(quadruped, 2), *random_cpgs(quadruped, 2)]
    design = DESIGNS[kind](quadruped, None)
    found = found_by(Simulator(quadruped, 1), TINY, make=repair, design=design, seeds=seeds)

    assert {each.controller.design for each in found} == {design}


def test_the_papers_repair_returns_its_survivors_with_their_exact_fitness(quadruped: Robot):
    seeds = random_controllers(quadruped, 8, seed=3)
    simulator = Simulator(quadruped, 2)
    found = found_by(simulator, TINY, make=RepairSearch, seeds=seeds)
    runs = [(INTACT, each.controller) for each in found]
    trajectory = simulator.run(runs, TINY.steps, ["base_position"]).trajectory
    of_seeds = simulator.run([(INTACT, each) for each in seeds], TINY.steps, ["base_position"])

    assert [each.scores[0] for each in found] == forward_displacement(trajectory).tolist()
    assert found[0].scores[0] >= forward_displacement(of_seeds.trajectory).max()
    assert 1 < len({each.controller for each in found}) == len(found) <= TINY.survivors


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


ENDING = [*(one for one in SCORES.values() if one.ends_at_fall)]
ENDING += [upright_within(max_speed=8.0), following((0.3, 0.0, 0.0))]


@pytest.mark.parametrize(
    ("score", "has_policy"),
    [*((one, False) for one in ENDING), (ENDING[0], True)],
    ids=lambda one: getattr(one, "name", one),
)
def test_a_rollout_ends_at_a_fall_where_nothing_counts_after_it_to_the_same_bits(
    tmp_path: Path, score: Score, *, has_policy: bool
):
    hopper = suite_bodies.robot("hopper", "hop")
    drivers = [*random_controllers(hopper, 6), *random_controllers(hopper, 1, seed=9)]
    if has_policy:
        design = layered(policy_of(tmp_path, hopper)).design
        drivers = [
            Controller(design, one)
            for one in draw_genomes(np.random.default_rng(0), (7, design.weights))
        ]
    certain = assumed_uncertainty(hopper)
    steps, found = list[int](), list[np.ndarray]()
    for ends in (True, False):
        own = dataclasses.replace(score, ends_at_fall=ends)
        simulator = Simulator(hopper, 1)
        fitness = RobustFitness(simulator, own, (INTACT,), certain)
        found.append(fitness(drivers, 2, 150, np.random.default_rng(0)))
        steps.append(simulator.stats.steps)

    assert found[0].tobytes() == found[1].tobytes()
    assert steps[0] < steps[1], "some have fallen"


@pytest.mark.search
def test_candidates_are_better_than_chance_under_new_conditions_and_best_first(quadruped: Robot):
    simulator = Simulator(quadruped, 2)
    found = found_by(simulator)
    fitness = fitness_of(simulator)
    by_chance, best = (
        robust(fitness(drivers, 8, SMALL.steps, np.random.default_rng(1)))
        for drivers in (random_controllers(quadruped, 40), [found[0].controller])
    )

    assert best[0] > np.quantile(by_chance, 0.9)


@pytest.mark.search
@pytest.mark.parametrize(
    ("known", "options"), [(1, {}), (0, {"make_search": NOISY_EA})], ids=["cma-es", "ea"]
)
def test_it_costs_what_it_may_and_reports_its_progress(
    quadruped: Robot, known: int, options: dict[str, object]
):
    simulator = Simulator(quadruped, 2)
    seeds = random_controllers(quadruped, known)
    generations: list[Generation] = []
    found = found_by(simulator, seeds=seeds, on_generation=generations.append, **options)
    cost, spent = rollouts_of(SMALL, known=bool(known)), simulator.stats.steps / SMALL.steps

    assert abs(spent - cost) < SMALL.population, "the largest difference is a generation"
    assert [own.number for own in generations] == list(range(1, len(generations) + 1))
    assert generations[-1].number == generations[-1].total
    assert np.isfinite(found[0].scores).all()
    assert not {own.controller for own in found} & {*seeds}


@pytest.mark.search
@pytest.mark.parametrize(
    ("score", "steps"),
    [(DISPLACEMENT, {210, 420}), (LAST, {420})],
    ids=["grows with time", "does not"],
)
def test_rollouts_have_half_of_the_steps_at_first_with_a_score_that_grows_with_time(
    quadruped: Robot, score: Score, steps: set[int]
):
    settings = dataclasses.replace(Settings().scaled(6), generations=3, steps=420)
    simulator = Simulator(quadruped, 2)
    simulator.run_under = run_under = Mock(wraps=simulator.run_under)
    found_by(simulator, settings, score)
    random, *searched, first, last = (call.args[3] for call in run_under.call_args_list)

    assert random == SHORT_STEPS
    assert searched == sorted(searched)
    halves = sum(210 for one in searched if one == 210)
    assert halves <= 0.5 * sum(searched), "the share of half rollouts is HALVED"
    assert {*searched} == steps
    assert (first, last) == (420, 420), "candidates are compared over whole trials"


def test_a_known_controller_makes_a_large_repair_cheaper_and_no_small_one():
    large = Settings()
    assert rollouts_of(large, known=True) == round(COST * large.evaluations)
    assert rollouts_of(large, known=False) == FIRST_COST * large.evaluations
    assert rollouts_of(SMALL, known=True) == rollouts_of(SMALL, known=False)
    medium = Settings().scaled(30)
    assert rollouts_of(medium, known=True) == 600
    assert COST * medium.evaluations < 600 < FIRST_COST * medium.evaluations


@pytest.mark.search
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
    monkeypatch.setattr(module, "comparisons_of", lambda _: ((8, 10), (4, 10)))
    if number is None:
        with pytest.raises(WorkError, match="got 16 of 40 with the best 4 of"):
            found_by(Simulator(quadruped, 2), TINY)
    else:
        assert len(found_by(Simulator(quadruped, 2), TINY)) == number


COARSE = np.array([9.0, 8.0, 7.0])


@pytest.mark.parametrize(
    ("fine", "tried", "kept"),
    [
        ([9.0, 8.0, 7.0], 0, [0]),
        ([9.0, 8.0, 7.0], 1, [0, 1]),
        ([9.0, 8.0, 7.0], 3, [0, 1, 2]),
        ([7.1, 6.5, 5.7], 0, [1]),
        ([7.1, 6.5, 5.7], 2, [1, 2]),
        ([7.1, 6.3, 8.0], 0, [2]),
        ([1.0, -np.inf, 5.0], 0, []),
        ([1.0, -np.inf, 5.0], 3, []),
    ],
)
def test_the_first_new_finalist_that_keeps_four_fifths_at_a_quarter_of_the_time_step_is_the_next(
    quadruped: Robot,
    monkeypatch: pytest.MonkeyPatch,
    fine: list[float],
    tried: int,
    kept: list[int],
):
    controllers = random_controllers(quadruped, 3)
    scores = COARSE[:, None] + [0] * 8
    finalists = tuple(CandidateController(*own) for own in zip(controllers, scores, strict=True))

    def scored(fitness: RobustFitness, given: list, count: int, *_: object) -> np.ndarray:
        robot = fitness.simulator.robot
        assert robot.model.opt.timestep == quadruped.model.opt.timestep / 4
        assert count == 2
        return np.array([[fine[controllers.index(one)]] * count for one in given])

    monkeypatch.setattr(RobustFitness, "__call__", scored)
    fitness = fitness_of(Simulator(quadruped, 1))
    found = converged(finalists, fitness, 40, np.random.default_rng(0), controllers[:tried])

    assert [each.controller for each in found] == [controllers[k] for k in kept]


@pytest.mark.parametrize(
    ("coarse", "fine", "is_kept"),
    [
        ([10.0] * 4, [10.0] * 3 + [-np.inf], False),
        ([10.0] * 3 + [-np.inf], [10.0] * 3 + [-np.inf], True),
        ([10.0] * 3 + [-np.inf], [10.0] * 4, True),
        ([-np.inf] * 4, [10.0] * 4, False),
        ([10.0] * 4, [10.0, 10.0, 10.0, 0.0], True),  # a loss of a quarter, by chance
        ([10.0] * 4, [9.0, 8.0, 7.0, 1.0], True),
        ([10.0] * 4, [8.0, 7.0, 7.0, 6.0], False),
    ],
)
def test_a_finalist_is_dropped_for_a_loss_beyond_chance_and_for_a_divergence_of_its_own(
    quadruped: Robot,
    monkeypatch: pytest.MonkeyPatch,
    coarse: list[float],
    fine: list[float],
    *,
    is_kept: bool,
):
    one = CandidateController(random_controllers(quadruped, 1)[0], np.array(coarse * 4))
    monkeypatch.setattr(RobustFitness, "__call__", lambda *_given: np.array([fine]))
    fitness = fitness_of(Simulator(quadruped, 1))
    assert bool(converged((one,), fitness, 40, np.random.default_rng(0))) == is_kept


@pytest.mark.parametrize(
    ("kept", "parts", "searches"),
    [([True], 1, 1), ([False, True], 4, 2), ([False, False], 4, 2)],
)
def test_a_search_whose_finalists_are_all_dropped_is_repeated_at_that_step_and_stays_there(
    quadruped: Robot, kept: list[bool], parts: int, searches: int
):
    class Stub:
        simulator, parts = Simulator(quadruped, 1), 1

    repair, steps = Stub(), list[float]()
    one = (CandidateController(random_controllers(quadruped, 1)[0], np.ones(1)),)

    def search() -> tuple[tuple, tuple]:
        steps.append(quadruped.model.opt.timestep / repair.simulator.robot.model.opt.timestep)
        return one, one if kept[len(steps) - 1] else ()

    (found,) = unflattered(repair, search)
    assert (found.controller, found.parts, repair.parts) == (one[0].controller, parts, parts)
    assert steps == [1, 4][:searches]


def test_finalists_meet_the_first_of_their_last_conditions_again(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    scores: list[np.ndarray] = []

    def spied(fitness: RobustFitness, *given: object) -> np.ndarray:
        scores.append(whole(fitness, *given))
        return scores[-1]

    whole = RobustFitness.__call__
    monkeypatch.setattr(RobustFitness, "__call__", spied)
    monkeypatch.setattr(module, "comparisons_of", lambda _: ((8, 2), (4, 8)))
    plain = found_by(Simulator(quadruped, 2), TINY)
    compared = next(one for one in scores[::-1] if one.shape == (4, 8))
    best = np.argmax(robust(compared))
    assert scores[-1].shape == (1, 2)
    assert not np.array_equal(scores[-1][0], compared[best, :2])
    monkeypatch.setattr(candidates, "FINER", 1)
    (same,) = found_by(Simulator(quadruped, 2), TINY)
    np.testing.assert_array_equal(scores[-1][0], same.scores)
    assert len(plain) == 1


@pytest.mark.parametrize(("population", "generations"), [(2, 1), (3, 2)])
def test_the_least_search_finds_a_controller_that_is_not_known(
    quadruped: Robot, population: int, generations: int
):
    least = dataclasses.replace(Settings().scaled(population), generations=generations, steps=10)
    known = random_controllers(quadruped, 3)
    found = found_by(Simulator(quadruped, 1), least, seeds=known, make_search=NOISY_EA)

    assert found
    assert not {own.controller for own in found} & {*known}


@pytest.mark.search
def test_mutants_of_a_known_controller_are_candidates_and_itself_is_not(quadruped: Robot):
    least = dataclasses.replace(Settings().scaled(12), generations=1, steps=100)
    known = found_by(Simulator(quadruped, 2), TINY, seed=5)[0].controller
    found = found_by(Simulator(quadruped, 2), least, seeds=(known,))
    different = [np.count_nonzero(own.controller.genome != known.genome) for own in found]

    assert min(different) <= 5, "one in a hundred weights of a mutant is drawn anew"
    assert known not in [own.controller for own in found]


GAITS = Settings().scaled(40)


def test_a_repertoire_begins_with_known_controllers_and_distinct_gaits(quadruped: Robot):
    found, known = random_repertoire(quadruped, 1000), np.full(68, 0.3)
    make = from_repertoire(found)
    asked = make(68, GAITS, np.random.default_rng(0), [known]).ask()
    other = make(68, GAITS, np.random.default_rng(1), [known]).ask()
    short = dataclasses.replace(GAITS, steps=100)

    assert len(asked) == 1 + round(GAITS.evaluations / 8 * 5)  # 200 of 1,000 steps each
    assert (asked[0] == known).all()
    drawn = [own.tobytes() for own in asked[1:]]
    assert set(drawn) <= {own.tobytes() for own in found.genomes}
    assert len(set(drawn)) == len(drawn)
    assert not np.array_equal(asked, other)
    few = random_repertoire(quadruped, 2)
    assert len(from_repertoire(few)(68, GAITS, np.random.default_rng(0)).ask()) == 4
    cheap = make(68, short, np.random.default_rng(0)).ask()
    assert len(cheap) == round(GAITS.evaluations / 8)
