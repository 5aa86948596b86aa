"""Making a repertoire, and evaluating it under a hypothesis."""

import numpy as np
import pytest

from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller
from selfmodel.errors import WorkError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.repertoire.evaluation import simulated_evaluation
from selfmodel.recovery.repertoire.make import Filling, make_repertoire, reevaluate
from selfmodel.recovery.repertoire.model_digest import model_digest
from selfmodel.recovery.repertoire.repertoire import Origin, Repertoire
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator

STEPS = 60
ORIGIN = Origin("quadruped", "0" * 64, 10, 40, 20, 0, "0.1")


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
