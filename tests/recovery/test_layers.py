"""Promises of the repair by layers: never worse than none, the smallest that does, few trials."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.progress import ignore
from selfmodel.recovery import recover as module
from selfmodel.recovery.candidates import CandidateController, RobustFitness
from selfmodel.recovery.layers import LayerRepair, layered
from selfmodel.recovery.recover import RecoveryLoop
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.result import Event, Restored
from selfmodel.recovery.scores import DISPLACEMENT, Score
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_cpgs
from tests.helpers.memory import in_memory

TINY = dataclasses.replace(Settings().scaled(60), steps=20)
SOUND = 1.0
"""Score of the intact robot, whose layer of zeros scores 0 after the failure."""


@pytest.fixture
def none(quadruped: Robot) -> Controller:
    """A CPG within a layer that changes nothing."""
    return layered(random_cpgs(quadruped, 1)[0])


def found_by(
    robot: Robot,
    none: Controller,
    value: Callable[[np.ndarray], float],
    tried: Sequence[Controller] = (),
    finer: float = 1.0,
) -> tuple[CandidateController, ...]:
    """The candidates of a repair, in a world in which a layer has a value by its genome.

    At a quarter of the time step the values are those times ``finer``.
    """

    def scored(
        fitness: RobustFitness, layers: Sequence[Controller], count: int, *_: object
    ) -> np.ndarray:
        assert len({one.design for one in layers}) == 1, "as a batch must have"
        intact = fitness.hypotheses == (INTACT,)
        share = 1.0 if fitness.simulator.robot is robot else finer
        values = [SOUND if intact else share * value(one.genome) for one in layers]
        fitness.simulator.stats.steps += len(layers) * count * TINY.steps
        return np.repeat(values, count).reshape(len(layers), count)

    repair = LayerRepair(Simulator(robot, 1), TINY, none.design, DISPLACEMENT)
    damage = parse("motor:front_left_knee=0", robot.anatomy)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RobustFitness, "__call__", scored)
        rng = np.random.default_rng(0)
        uncertainty = assumed_uncertainty(robot)
        return repair((damage,), lambda: uncertainty, [none, *tried], rng, ignore)


def test_where_every_change_is_worse_the_robot_is_not_changed(quadruped: Robot, none: Controller):
    (found,) = found_by(quadruped, none, lambda genome: -np.abs(genome).sum())
    assert not found.controller.genome.any()
    assert found.mean == 0


def test_the_smallest_layer_that_regains_enough_is_the_repair(quadruped: Robot, none: Controller):
    found = found_by(quadruped, none, lambda genome: 5 * genome[0])
    assert {one.controller.design for one in found} == {none.design}
    values = [one.mean for one in found]
    assert values == sorted(values, reverse=True)
    assert values[0] >= 0.8 * SOUND
    assert values[-1] > 0


@pytest.mark.parametrize(("finer", "is_changed"), [(0.5, False), (0.9, True)])
def test_a_layer_that_a_coarse_time_step_flatters_is_no_repair(
    quadruped: Robot, none: Controller, finer: float, *, is_changed: bool
):
    found = found_by(quadruped, none, lambda genome: 5 * genome[0], finer=finer)
    assert (found[0].controller != none) == is_changed
    assert is_changed or len(found) == 1


def test_a_search_that_stalls_goes_on_with_the_larger_layer(quadruped: Robot, none: Controller):
    small = none.design.weights
    found = found_by(quadruped, none, lambda genome: 0.1 * genome[0] + genome[small:].sum())
    best = found[0].controller
    assert best.design == dataclasses.replace(none.design, feedback=True)
    assert best.genome[small:].any()


def test_a_layer_that_was_tried_is_begun_at(quadruped: Robot, none: Controller):
    large = Compensated.around(none, feedback=True)
    tried = Controller(large, np.full(large.weights, 0.3))
    found = found_by(quadruped, none, lambda genome: genome.mean(), [tried])
    assert found[0].mean > 0.3, "the search goes on from what was tried"
    assert {one.controller.design for one in found} == {large}


def test_a_small_layer_that_was_tried_is_the_repair_where_nothing_is_better(
    quadruped: Robot, none: Controller
):
    tried = Controller(none.design, np.full(none.design.weights, 0.3))

    def value(genome: np.ndarray) -> float:
        known = np.array_equal(genome[: none.design.weights], tried.genome)
        return 0.5 if known and not genome[none.design.weights :].any() else -np.abs(genome).sum()

    found = found_by(quadruped, none, value, [tried])
    assert [one.controller for one in found] == [tried]


def test_behind_a_tried_layer_is_the_best_new_one(quadruped: Robot, none: Controller):
    tried = Controller(none.design, np.full(none.design.weights, 0.3))

    def value(genome: np.ndarray) -> float:
        return 0.9 if np.array_equal(genome, tried.genome) else 0.2 * genome.any()

    found = found_by(quadruped, none, value, [tried])
    assert [one.controller == tried for one in found] == [True, False]
    assert found[1].mean == 0.2


@pytest.mark.parametrize(
    ("scores", "falls", "adapts", "ends", "trials"),
    [
        ([10.0, 9.0, 9.0], [False], True, True, 1),
        ([10.0, 9.0, 8.9, 9.1], [False] * 2, True, True, 2),
        ([10.0, 9.0, 9.5, 8.0, 8.0], [True, False, False], True, True, 3),
        ([10.0, 9.0, float("nan"), 8.0, 8.0], [False] * 3, True, True, 3),
        ([-20.0, -30.0, -22.1, -21.9], [False] * 2, True, True, 2),
        ([10.0, 9.0, 9.5, 9.5, 9.5], [False] * 3, False, True, 3),
        ([10.0, 9.0, 9.5, 9.5, 9.5], [False] * 3, True, False, 3),
    ],
)
def test_a_robot_with_a_controller_that_walks_as_before_again_is_not_tried_further(
    quadruped: Robot,
    monkeypatch: pytest.MonkeyPatch,
    scores: list[float],
    falls: list[bool],
    trials: int,
    *,
    adapts: bool,
    ends: bool,
):
    class Repair(RepairSearch):
        adapts_gait = adapts

    def of_trial(_score: Score, _robot: Robot, _hypothesis: object, trial: Trial) -> float:
        return scores[int(trial.plan.name[:2])]

    def fall_of(_robot: Robot, _hypothesis: object, trial: Trial) -> int | None:
        return 7 if [False, False, *falls][int(trial.plan.name[:2])] else None

    monkeypatch.setattr(Score, "of_trial", of_trial)
    monkeypatch.setattr(module, "fall_of", fall_of)
    small = dataclasses.replace(Settings().scaled(4), generations=2, steps=20)
    kept, events = list[object](), list[Event]()
    loop = RecoveryLoop(
        simulator=Simulator(quadruped, 1),
        choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
        run_trial=in_memory(quadruped),
        store_diagnosis=kept.append,
        settings=dataclasses.replace(small, diagnostic_search="ea"),
        seed=0,
        on_event=events.append,
        make_repair=Repair,
        ends_early=ends,
    )
    damage = parse("jam:front_left_knee", quadruped.anatomy)
    outcome = loop.run(SimulatedRobot(quadruped), SimulatedRobot(quadruped, damage))

    assert [trial.plan.stage for trial in outcome.trials[2:]] == ["recovery"] * trials
    assert len(outcome.tried) == len(outcome.trials) == 2 + trials
    assert len(kept) == 1 + trials, "the last diagnosis is of all trials"
    assert (Restored() in events) == (trials < 3)
