"""A repertoire: made by MAP-Elites, evaluated under a hypothesis, and what its record promises."""

import sys
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError, WorkError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery import map_elites
from selfmodel.recovery.falls import falls_of
from selfmodel.recovery.map_elites import (
    Filling,
    duty_factors,
    feet_of,
    make_repertoire,
    reevaluate,
    simulated_evaluation,
)
from selfmodel.recovery.repertoire import (
    Modelled,
    Origin,
    Repertoire,
    model_digest,
    self_model_digest,
)
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import forward_displacement
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.arms import arm

STEPS = 60
ORIGIN = Origin("quadruped", "0" * 64, 10, 2, 20, 0, "0.1")


def made(robot: Robot, threads: int = 2, **more: object) -> Repertoire:
    evaluate = simulated_evaluation(Simulator(robot, threads), INTACT, STEPS)
    return make_repertoire(
        robot,
        network_for(robot),
        evaluate,
        **{"steps": STEPS, "seed": 3, "evaluations": 60, "batch": 20, **more},
    )


@pytest.fixture(scope="module")
def repertoire(quadruped: Robot) -> Repertoire:
    return made(quadruped)


def test_a_repertoire_holds_walking_gaits_in_cells_of_their_own(
    repertoire: Repertoire, quadruped: Robot
):
    evaluate = simulated_evaluation(Simulator(quadruped, 2), INTACT, STEPS)
    scores, descriptors = evaluate(repertoire.controllers(range(len(repertoire))))
    cells = np.minimum((repertoire.descriptors * 20 + 1e-6).astype(int), 19)

    assert np.array_equal(scores, repertoire.scores)
    assert np.array_equal(descriptors, repertoire.descriptors)
    assert len(np.unique(cells, axis=0)) == len(repertoire) > 5
    assert repertoire.scores.min() > 0
    assert np.all(np.diff(repertoire.scores) <= 0)


def test_a_repertoire_is_the_same_at_any_thread_count(repertoire: Repertoire, quadruped: Robot):
    alone = made(quadruped, threads=1)

    assert np.array_equal(alone.genomes, repertoire.genomes)
    assert np.array_equal(alone.scores, repertoire.scores)


def test_a_repertoire_says_how_it_was_made(repertoire: Repertoire, quadruped: Robot):
    origin = repertoire.origin

    assert (origin.robot, origin.model) == ("quadruped", model_digest(quadruped))
    assert (origin.steps, origin.evaluations, origin.levels, origin.seed) == (STEPS, 60, 20, 3)


def test_progress_is_reported_after_each_batch(quadruped: Robot):
    seen: list[Filling] = []
    whole = made(quadruped, on_filling=seen.append)

    assert [one.evaluations for one in seen] == [20, 40, 60]
    assert seen[-1].gaits == len(whole)
    assert seen[-1].best == whole.scores[0]


def test_nothing_that_walks_is_an_error(quadruped: Robot):
    def refuse(controllers: list[Controller]) -> tuple[FloatArray, FloatArray]:
        return np.full(len(controllers), -np.inf), np.zeros((len(controllers), 4))

    with pytest.raises(WorkError, match="none of 20 gaits of quadruped moved forward without a f"):
        make_repertoire(
            quadruped, network_for(quadruped), refuse, steps=5, seed=0, evaluations=20, batch=20
        )


def test_gaits_are_sorted_by_their_score_under_a_hypothesis(
    repertoire: Repertoire, quadruped: Robot
):
    damaged = parse("break:front_left_knee", quadruped.anatomy)
    evaluate = simulated_evaluation(Simulator(quadruped, 2), damaged, STEPS)
    found = reevaluate(repertoire, evaluate)
    scores, _ = evaluate(repertoire.controllers(found.gaits))
    walking = int(np.isfinite(scores).sum())

    assert np.array_equal(scores, found.scores)
    assert sorted(found.gaits) == list(range(len(repertoire)))
    assert np.all(np.diff(scores[:walking]) <= 0)
    assert len(found.controllers) == walking
    assert found.controllers[0] == repertoire.controller(found.gaits[0])


def test_a_sample_is_spread_over_the_duty_factors(quadruped: Robot):
    duty = np.full((40, 4), 0.5) + np.arange(40)[:, np.newaxis] / 1000
    duty[[20, 25, 30, 39], range(4)] = 0.05  # few gaits are unlike the others, and not the best
    whole = Repertoire(
        network_for(quadruped), np.zeros((40, 68)), np.arange(40.0)[::-1], duty, ORIGIN
    )
    evaluated: list[int] = []

    def evaluate(controllers: list[Controller]) -> tuple[FloatArray, FloatArray]:
        evaluated.append(len(controllers))
        return np.arange(float(len(controllers))), np.zeros((len(controllers), 4))

    found = reevaluate(whole, evaluate, sample=8)

    assert evaluated == [8]
    assert {0, 20, 25, 30, 39} < set(found.gaits.tolist())
    assert len(set(found.gaits.tolist())) == 8


def test_each_cell_keeps_its_best_genome_in_hundredths_and_one_without_a_score_is_left_out(
    quadruped: Robot,
):
    design, known = network_for(quadruped), []

    def toy(controllers: list[Controller]) -> tuple[FloatArray, FloatArray]:
        """The nearer to 0, the better; the descriptors are the first four values."""
        genomes = np.array([one.genome for one in controllers])
        scores, duty = -np.square(genomes).sum(axis=1), (genomes[:, :4] + 1) / 2
        scores[::5], duty[::5] = -np.inf, np.nan
        known.extend(zip(scores, duty, genomes, strict=True))
        return scores, duty

    options = {"steps": 5, "seed": 0, "evaluations": 200, "batch": 20, "levels": 2}
    found = make_repertoire(quadruped, design, toy, **options)
    best: dict[tuple[int, ...], float] = {}
    for score, duty, genome in known:
        assert np.array_equal(genome, np.rint(genome * 100) / 100)
        assert np.abs(genome).max() <= 1
        if np.isfinite(score):
            cell = tuple(np.minimum((duty * 2 + 1e-6).astype(int), 1))
            best[cell] = max(best.get(cell, -np.inf), score)

    assert len(found) == len(best)
    assert found.scores.tolist() == pytest.approx(sorted(best.values(), reverse=True))


def test_given_controllers_are_in_the_first_batch(quadruped: Robot):
    seen: list[Controller] = []

    def evaluate(controllers: list[Controller]) -> tuple[FloatArray, FloatArray]:
        seen.extend(controllers)
        return np.ones(len(controllers)), np.full((len(controllers), 4), 0.5)

    seeds = random_controllers(quadruped, 2)
    options = {"steps": 5, "seed": 0, "evaluations": 4, "batch": 4}
    make_repertoire(quadruped, network_for(quadruped), evaluate, seeds=seeds, **options)

    assert seen[:2] == list(seeds)


def test_without_pyribs_the_remedy_is_named(quadruped: Robot, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ribs.archives", None)

    with pytest.raises(InputError, match=r"pip install 'selfmodel\[repertoire\]'"):
        made(quadruped)


def test_a_duty_factor_is_the_part_of_the_steps_with_contact(quadruped: Robot):
    names = quadruped.anatomy.names.sensors
    readings = np.zeros((1, 4, len(names)))
    readings[0, :3, names.index("front_left_touch")] = 1
    readings[0, :1, names.index("back_right_touch")] = 1

    assert duty_factors(quadruped.anatomy, readings).tolist() == [[0.75, 0, 0, 0.25]]


def test_gaits_that_fall_or_go_backwards_have_no_score(quadruped: Robot):
    controllers = random_controllers(quadruped, 40, seed=1)
    simulator = Simulator(quadruped, 2)
    damaged = parse("break:front_left_shoulder+break:front_right_shoulder", quadruped.anatomy)
    scores, descriptors = simulated_evaluation(simulator, damaged, 150)(controllers)
    runs = [(damaged, one) for one in controllers]
    behaviour = simulator.run(runs, 150, map_elites.RECORD).behaviour
    walks = forward_displacement(behaviour)
    falls = falls_of(quadruped, damaged, behaviour) < 150

    assert falls.any()
    assert (~falls & (walks > 0)).any()
    assert np.array_equal(scores, np.where(falls | (walks <= 0), -np.inf, walks))
    assert np.array_equal(descriptors, duty_factors(quadruped.anatomy, behaviour["sensors"]))


def test_gaits_of_several_batches_keep_their_order(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    controllers = random_controllers(quadruped, 5)
    evaluate = simulated_evaluation(Simulator(quadruped, 2), INTACT, 30)
    whole = evaluate(controllers)
    monkeypatch.setattr(map_elites, "BATCH", 2)

    assert all(map(np.array_equal, whole, evaluate(controllers)))


def test_a_robot_without_feet_has_no_repertoire():
    with pytest.raises(InputError, match="needs the touch sensors of feet, and this robot has n"):
        feet_of(arm().anatomy)


def test_the_gaits_are_sorted_by_score(quadruped: Robot):
    genomes = np.zeros((2, 68))
    genomes[1] = 0.5
    found = Repertoire(network_for(quadruped), genomes, np.array([1.0, 3]), np.eye(2, 4), ORIGIN)

    assert found.scores.tolist() == [3, 1]
    assert found.controller(0).genome[0] == 0.5
    assert found.descriptors[0].tolist() == [0, 1, 0, 0]


@pytest.mark.parametrize(("gaits", "weights"), [(0, 68), (2, 67)])
def test_arrays_that_do_not_fit_are_refused(quadruped: Robot, gaits: int, weights: int):
    arrays = np.zeros((gaits, weights)), np.zeros(gaits), np.zeros((gaits, 4))
    with pytest.raises(ValueError, match=r"expected genomes \(gaits, 68\)"):
        Repertoire(network_for(quadruped), *arrays, ORIGIN)


ROBOT = {
    "name": "a",
    "mjcf": '<mujoco>\n  <!-- legs --><option timestep="0.01" density="1" />\n</mujoco>',
    "control_timestep": 0.02,
    "assets": {"foot.stl": b"1"},
}


def test_the_model_that_a_log_serialises_anew_has_the_digest_of_the_robot():
    robot = SimpleNamespace(**ROBOT)
    text = '<mujoco><option density="1" timestep="0.01"/></mujoco>'
    logged = SimpleNamespace(**{**ROBOT, "mjcf": text})

    assert self_model_digest(robot) == self_model_digest(logged)
    assert model_digest(robot) != model_digest(logged), "that of repertoires is of the text"


@pytest.mark.parametrize("digest", [model_digest, self_model_digest])
@pytest.mark.parametrize(
    "change",
    [
        {"mjcf": '<mujoco><option timestep="0.01" density="2"/></mujoco>'},
        {"control_timestep": 0.01},
        {"assets": {"foot.stl": b"2"}},
        {"assets": {"feet.stl": b"1"}},
    ],
)
def test_a_change_of_the_model_changes_its_digest(digest: Callable[[Modelled], str], change: dict):
    changed = SimpleNamespace(**{**ROBOT, **change})

    assert digest(changed) != digest(SimpleNamespace(**ROBOT))
