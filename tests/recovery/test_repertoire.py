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
from selfmodel.recovery import map_elites as module
from selfmodel.recovery.falls import falls_of
from selfmodel.recovery.map_elites import feet_of, make_repertoire, reevaluate, simulated_evaluation
from selfmodel.recovery.repertoire import Origin, Repertoire, model_digest, self_model_digest
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import forward_displacement
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.arms import arm

STEPS = 40
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


def test_a_repertoire_names_its_origin_and_is_the_same_at_any_thread_count(
    repertoire: Repertoire, quadruped: Robot
):
    origin, seen = repertoire.origin, []
    alone = made(quadruped, threads=1, on_filling=seen.append)

    assert np.array_equal(alone.genomes, repertoire.genomes)
    assert np.array_equal(alone.scores, repertoire.scores)
    assert [one.evaluations for one in seen] == [20, 40, 60]
    assert (seen[-1].gaits, seen[-1].best) == (len(alone), alone.scores[0])
    assert (origin.robot, origin.model) == ("quadruped", model_digest(quadruped))
    assert (origin.steps, origin.evaluations, origin.levels, origin.seed) == (STEPS, 60, 20, 3)


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
    gaits = [repertoire.controller(k) for k in range(len(repertoire))]
    scores, _ = evaluate(gaits)
    order = [i for i in np.argsort(-scores, kind="stable") if np.isfinite(scores[i])]
    assert reevaluate(repertoire, evaluate) == tuple(gaits[i] for i in order)
    cells = np.minimum((repertoire.descriptors * 20 + 1e-6).astype(int), 19)
    assert len(np.unique(cells, axis=0)) == len(repertoire) > 5
    assert repertoire.scores.min() > 0
    assert np.all(np.diff(repertoire.scores) <= 0)
    healthy = simulated_evaluation(Simulator(quadruped, 2), INTACT, STEPS)
    again = healthy(gaits)
    assert all(map(np.array_equal, again, (repertoire.scores, repertoire.descriptors)))


def test_each_cell_keeps_its_best_genome_in_hundredths_and_one_without_a_score_is_left_out(
    quadruped: Robot,
):
    design, known = network_for(quadruped), []

    def toy(controllers: list[Controller]) -> tuple[FloatArray, FloatArray]:
        """The nearer to 0, the better; the descriptors are the first four values."""
        genomes = np.array([one.genome for one in controllers])
        scores, duty = -np.square(genomes).sum(axis=1), (genomes[:, :4] + 1) / 2
        scores[1::5], duty[1::5] = -np.inf, np.nan
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


def test_without_pyribs_or_feet_the_remedy_is_named(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    with pytest.raises(InputError, match="needs the touch sensors of feet, and this robot has n"):
        feet_of(arm().anatomy)
    monkeypatch.setitem(sys.modules, "ribs.archives", None)

    with pytest.raises(InputError, match=r"pip install 'selfmodel\[repertoire\]'"):
        made(quadruped)


def test_gaits_that_fall_or_go_backwards_have_no_score(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    controllers = random_controllers(quadruped, 20, seed=1)
    simulator = Simulator(quadruped, 2)
    damaged = parse("break:front_left_shoulder+break:front_right_shoulder", quadruped.anatomy)
    scores, descriptors = simulated_evaluation(simulator, damaged, 150)(controllers)
    runs = [(damaged, one) for one in controllers]
    trajectory = simulator.run(runs, 150, module.RECORD).trajectory
    walks = forward_displacement(trajectory)
    falls = falls_of(quadruped, damaged, trajectory) < 150

    assert falls.any()
    assert (~falls & (walks > 0)).any()
    assert np.array_equal(scores, np.where(falls | (walks <= 0), -np.inf, walks))
    touch = [k for k, sensor in enumerate(quadruped.anatomy.sensors) if sensor.kind == "touch"]
    assert np.array_equal(descriptors, (trajectory["sensors"][..., touch] == 1).mean(axis=1))
    monkeypatch.setattr(module, "BATCH", 7)
    again = simulated_evaluation(simulator, damaged, 150)(controllers)
    assert all(map(np.array_equal, (scores, descriptors), again))


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
def test_a_change_of_the_model_changes_its_digest(digest: Callable[[Robot], str], change: dict):
    changed = SimpleNamespace(**{**ROBOT, **change})

    assert digest(changed) != digest(SimpleNamespace(**ROBOT))
