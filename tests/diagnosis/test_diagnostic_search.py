"""The search of a diagnosis is an axis of its own, the same for every comparator, with its cost."""

import dataclasses
from collections.abc import Callable
from functools import cache, partial

import numpy as np
import pytest

from selfmodel.comparators import FORWARD_DISPLACEMENT, NOISY_TRANSFER, SEGMENT_PREDICTION
from selfmodel.diagnosis.comparator import Comparator, Prepared
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.text import verdict_sentences
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.settings import DIAGNOSTIC_SEARCHES, EA, STEPWISE, Settings
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import trial_of

SMALL = dataclasses.replace(Settings(steps=60).scaled(12), generations=3, genes=2)
REQUEST = ClosedLoop(record=("joint_positions",))


class ByDistance:
    """The distance of joint positions, one a trial."""

    name = "by-distance"

    def prepare(self, trial: Trial) -> "OneDistance":
        """Prepares the joint positions."""
        return OneDistance(partial(distance_of, trial=trial))


@dataclasses.dataclass
class OneDistance:
    """A prepared trial without losses."""

    distances: Callable[[Trajectory], np.ndarray]
    request: ClosedLoop = REQUEST


class OfOnePiece:
    """The same distance, as the only loss of a trial."""

    name = "of-one-piece"

    def prepare(self, trial: Trial) -> Prepared:
        """Prepares the joint positions."""
        return Prepared(REQUEST, lambda run: distance_of(run, trial)[:, np.newaxis])


BY_DISTANCE, OF_ONE_PIECE = ByDistance(), OfOnePiece()


def distance_of(simulated: Trajectory, trial: Trial) -> np.ndarray:
    """Returns the mean difference of joint positions, ``(n,)``."""
    difference = np.abs(simulated["joint_positions"] - trial.trajectory["joint_positions"])
    return np.ascontiguousarray(difference).reshape(len(difference), -1).mean(axis=1)


@cache
def diagnosed(
    robot: Robot,
    comparator: Comparator,
    search: str,
    damage: str,
    *,
    trials: int = 1,
    limit: int | None = None,
) -> tuple[Diagnosis, int]:
    """Returns the diagnosis of some trials, and the control steps that were simulated for it."""
    logged = [trial_of(robot, damage, one, steps=60) for one in random_controllers(robot, trials)]
    simulator = Simulator(robot, 1)
    settings = dataclasses.replace(SMALL, diagnostic_search=search, max_simulated_steps=limit)
    diagnose = DiagnosticSearch(simulator, comparator, settings, PAPER_KINDS)
    found = diagnose(logged, [], np.random.default_rng(0), lambda _: None)
    return found, simulator.stats.steps


@pytest.mark.parametrize(
    ("search", "trials"),
    [
        *((search, 1) for search in (STEPWISE, EA)),
        *(pytest.param(search, 2, marks=pytest.mark.search) for search in DIAGNOSTIC_SEARCHES),
    ],
)
def test_the_same_distance_with_and_without_losses_is_the_same_diagnosis_at_the_same_cost(
    quadruped: Robot, search: str, trials: int
):
    damage = "break:front_left_shoulder+jam:back_right_knee"
    one, other = (
        diagnosed(quadruped, comparator, search, damage, trials=trials)[0]
        for comparator in (BY_DISTANCE, OF_ONE_PIECE)
    )
    assert one == other
    assert one.cost.hypotheses > len(PAPER_KINDS)


@pytest.mark.parametrize("comparator", [FORWARD_DISPLACEMENT, SEGMENT_PREDICTION])
@pytest.mark.parametrize("search", DIAGNOSTIC_SEARCHES)
def test_the_cost_of_a_diagnosis_is_all_that_was_simulated(
    quadruped: Robot, comparator: Comparator, search: str
):
    found, simulated = diagnosed(quadruped, comparator, search, "break:front_left_knee")
    assert found.cost.control_steps == simulated
    assert str(found.best) == "break:front_left_knee" or search == EA


def test_one_distance_is_searched_step_by_step_to_the_damage_that_the_small_ea_misses(
    quadruped: Robot,
):
    damage = "break:front_left_shoulder+jam:back_right_knee"
    by_steps, by_ea = (
        diagnosed(quadruped, BY_DISTANCE, search, damage, trials=1)[0] for search in (STEPWISE, EA)
    )
    assert str(by_steps.best) == damage
    assert by_steps.verdict == "explained"
    assert by_ea.ranked[0].distance > by_steps.ranked[0].distance == 0


@pytest.mark.parametrize("comparator", [FORWARD_DISPLACEMENT, SEGMENT_PREDICTION])
@pytest.mark.parametrize("search", DIAGNOSTIC_SEARCHES)
@pytest.mark.parametrize("limit", [500, 1500])
def test_no_search_simulates_more_than_its_limit_and_one_that_reaches_it_does_not_judge(
    quadruped: Robot, comparator: Comparator, search: str, limit: int
):
    damage, trials = "break:front_left_shoulder+jam:back_right_knee", 2
    found, _ = diagnosed(quadruped, comparator, search, damage, trials=trials, limit=limit)
    assert found.cost.control_steps <= limit * trials
    # The limit was reached: less is left than a hypothesis needs in a trial.
    assert found.cost.control_steps > limit * trials - 400 or found.doubt is None
    assert (found.verdict == "not judged") == (found.doubt is not None)
    assert found.doubt is None or f"{limit * trials:,}" in found.doubt.reason


@pytest.mark.parametrize("comparator", [FORWARD_DISPLACEMENT, SEGMENT_PREDICTION])
@pytest.mark.parametrize("search", DIAGNOSTIC_SEARCHES)
def test_a_limit_that_is_reached_in_the_verdict_changes_no_best_hypothesis(
    quadruped: Robot, comparator: Comparator, search: str
):
    damage = "break:front_left_knee"
    whole, _ = diagnosed(quadruped, comparator, search, damage)
    limit = whole.cost.control_steps - 1
    found, _ = diagnosed(quadruped, comparator, search, damage, limit=limit)
    assert (found.best, found.verdict) == (whole.best, "not judged")
    assert "best hypothesis until then" in verdict_sentences(found)


def test_one_distance_a_trial_is_compared_by_its_sum_and_many_losses_one_by_one(quadruped: Robot):
    trials = [
        trial_of(quadruped, "intact", one, steps=60) for one in random_controllers(quadruped, 3)
    ]
    hypotheses = [INTACT, parse("break:front_left_knee", quadruped.anatomy)]
    table = LossTable(Simulator(quadruped, 1), BY_DISTANCE)
    losses = table.losses(hypotheses, trials)
    assert losses.shape == (2, 3)
    np.testing.assert_array_equal(table.compared(hypotheses, trials)[:, 0], losses.sum(axis=1))
    many = LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION)
    np.testing.assert_array_equal(
        many.compared(hypotheses, trials), many.losses(hypotheses, trials)
    )


def test_a_limit_with_which_nothing_can_be_simulated_is_refused(quadruped: Robot):
    # An ensemble has more rollouts than one.
    with pytest.raises(InputError, match="got 60 for 1"):
        diagnosed(quadruped, NOISY_TRANSFER, EA, "intact", limit=60)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [({"diagnostic_search": "steps"}, "stepwise"), ({"max_simulated_steps": 59}, "60 or above")],
)
def test_an_unknown_search_or_limit_is_refused(wrong: dict[str, object], named: str):
    with pytest.raises(InputError, match=named):
        dataclasses.replace(SMALL, **wrong)


def test_settings_of_a_search_are_in_a_log_only_if_they_are_set():
    assert "diagnostic_search" not in SMALL.as_json()
    changed = dataclasses.replace(SMALL, diagnostic_search=EA, max_simulated_steps=1e6)
    assert Settings(**changed.as_json()) == changed
