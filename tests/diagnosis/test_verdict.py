"""Tests of the verdict: intact, explained, ambiguous, unexplained.

There is no reality gap, so an unexplained trial is due to the searched hypotheses.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from selfmodel.comparators import FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis, Fit
from selfmodel.diagnosis.significance import FAULTY_RATIO, LOSS_RATIO, TEST
from selfmodel.diagnosis.verdict import EQUAL_DISTANCES
from selfmodel.faults import BROKEN, FRICTION, JAMMED
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import KINDS, PAPER_KINDS
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.behaviour import Behaviour, forward_displacement
from selfmodel.trials.trial import Stage, Trial, TrialPlan
from tests.helpers.comparators import Prepared, PreparedPieces
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory

SMALL = dataclasses.replace(Settings().scaled(12), generations=2, steps=300)
CASES = ROBOTS["quadruped"].cases
GAIT = 4
"""Index of a random controller under which every failure below is detectable."""


def trial(robot: Robot, truth: str, controller: Controller, stage: Stage = "after") -> Trial:
    """A trial of a damaged robot."""
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    plan = TrialPlan(f"{stage}-{truth}-{hash(controller)}", stage, controller, SMALL.steps, 0)
    return in_memory(robot)(physical, plan)


def diagnosed(
    robot: Robot,
    trials: Sequence[Trial],
    intact: Sequence[Trial] = (),
    *,
    comparator: Comparator = SEGMENT_PREDICTION,
    kinds: Sequence[FaultKind] = PAPER_KINDS,
    seeds: Sequence[Hypothesis] = (),
) -> Diagnosis:
    search = DiagnosticSearch(Simulator(robot, 1), comparator, SMALL, kinds, healthy_trials=intact)
    return search(trials, seeds, np.random.default_rng(0), lambda _: None)


@pytest.fixture(scope="module")
def gait(quadruped: Robot) -> Controller:
    return random_controllers(quadruped, 5)[GAIT]


@pytest.fixture(scope="module")
def before(quadruped: Robot, gait: Controller) -> list[Trial]:
    return [trial(quadruped, "intact", gait, "before")]


@pytest.mark.parametrize(
    ("truth", "kinds"),
    [
        ("sensor:front_left_touch", "sensor,sensor-gain"),
        pytest.param("jam:front_left_shoulder", "jam,jam-angle", marks=pytest.mark.search),
    ],
)
def test_a_fault_without_a_degree_is_explained_though_its_degree_is_considered(
    quadruped: Robot, gait: Controller, before: list[Trial], truth: str, kinds: str
):
    """A severity close to nominal is indistinguishable from the nominal one."""
    chosen = tuple(KINDS[name] for name in kinds.split(","))
    found = diagnosed(quadruped, [trial(quadruped, truth, gait)], before, kinds=chosen)

    assert str(found.best) == truth
    assert (found.verdict, found.indistinguishable) == ("explained", ())


class HardOfHearing:
    """Takes a touch that is half felt for none, so that gains below a half are all the same."""

    name = "hard of hearing"

    def prepare(self, trial: Trial) -> PreparedPieces:
        """Prepares short predictions, of what is felt."""
        prepared = SEGMENT_PREDICTION.prepare(trial)
        return PreparedPieces(
            prepared.request, lambda simulated: prepared.losses(self._felt(simulated))
        )

    def _felt(self, simulated: Behaviour) -> Behaviour:
        touch = [name.endswith("touch") for name in simulated.names.sensors]
        readings = simulated["sensors"].copy()
        readings[..., touch] = readings[..., touch] > 0.5
        return dataclasses.replace(simulated, signals={**simulated.signals, "sensors": readings})


def test_faults_that_differ_by_a_degree_are_no_rivals(
    quadruped: Robot, gait: Controller, before: list[Trial]
):
    truth = "sensor:front_left_touch"
    trials = [trial(quadruped, truth, gait)]
    found = diagnosed(
        *(quadruped, trials, before),
        comparator=HardOfHearing(),
        kinds=(KINDS["sensor"], KINDS["sensor-gain"]),
    )

    assert str(found.best) == truth
    assert any("=gain" in str(one.hypothesis) for one in found.ranked[1:3])
    assert found.ranked[1].distance == found.ranked[0].distance
    assert found.indistinguishable == ()


@pytest.mark.parametrize(
    "case", [1, *(pytest.param(case, marks=pytest.mark.search) for case in (2, 3, 6, 9))]
)
def test_a_failure_of_table_one_is_found_and_explained(
    quadruped: Robot, gait: Controller, before: list[Trial], case: int
):
    found = diagnosed(quadruped, [trial(quadruped, CASES[case], gait)], before)

    assert str(found.best) == CASES[case]
    assert found.verdict == ("explained" if found.best else "intact")
    assert found.indistinguishable == ()
    assert found.test == TEST
    assert found.ranked[0].distance < 1e-9
    assert (found.intact_distance > 1e-4) == (case != 9)


@pytest.mark.search
def test_a_hidden_neuron_is_unexplained(quadruped: Robot, gait: Controller, before: list[Trial]):
    found = diagnosed(quadruped, [trial(quadruped, CASES[10], gait)], before)

    assert found.verdict == "unexplained"


@pytest.mark.parametrize(
    ("truth", "kinds"),
    [
        ("friction=0.3", PAPER_KINDS),
        pytest.param("motor:front_left_knee=0.2", PAPER_KINDS, marks=pytest.mark.search),
        pytest.param("break:front_left_shoulder", [JAMMED, FRICTION], marks=pytest.mark.search),
    ],
)
def test_what_is_of_no_kind_that_is_considered_is_not_explained(
    quadruped: Robot, gait: Controller, before: list[Trial], truth: str, kinds: list[FaultKind]
):
    found = diagnosed(quadruped, [trial(quadruped, truth, gait)], before, kinds=kinds)

    assert found.verdict == "unexplained"


def test_without_a_trial_of_the_intact_robot_nothing_is_unexplained(
    quadruped: Robot, gait: Controller
):
    found = diagnosed(quadruped, [trial(quadruped, CASES[10], gait)])

    assert found.verdict in {"intact", "explained", "ambiguous"}


@dataclasses.dataclass(frozen=True)
class Coarse:
    """The paper's comparator with a coarse ruler, m."""

    ruler: float
    name: str = "coarse"

    def prepare(self, trial: Trial) -> Prepared:
        """Prepares the displacement, in rulers."""
        sound = FORWARD_DISPLACEMENT.prepare(trial)
        return Prepared(
            sound.request, lambda simulated: np.floor(sound.distances(simulated) / self.ruler)
        )


@dataclasses.dataclass(frozen=True)
class CoarseInPieces(Coarse):
    """The same of every one of five pieces."""

    def prepare(self, trial: Trial) -> PreparedPieces:
        """Prepares the same five times."""
        whole = super().prepare(trial)
        return PreparedPieces(
            whole.request,
            lambda simulated: np.repeat(whole.distances(simulated)[:, np.newaxis], 5, axis=1),
        )


@pytest.mark.parametrize(("make", "test"), [(Coarse, EQUAL_DISTANCES), (CoarseInPieces, TEST)])
def test_hypotheses_that_no_trial_tells_apart_are_rivals(
    quadruped: Robot, gait: Controller, make: Callable[[float], Comparator], test: str
):
    anatomy = quadruped.anatomy
    singles = [
        canonical([fault], anatomy)
        for kind in (BROKEN, JAMMED)
        for fault in kind.candidates(anatomy)
    ]
    runs = [(one, gait) for one in (INTACT, *singles)]
    outcome = Simulator(quadruped, 1).run(runs, SMALL.steps, ["base_position"])
    intact, *ways = forward_displacement(outcome.behaviour)
    apart, one, other = min(
        (abs(ways[i] - ways[k]), singles[i], singles[k])
        for i, k in itertools.combinations(range(len(singles)), 2)
        if min(abs(ways[i] - intact), abs(ways[k] - intact)) > 3 * abs(ways[i] - ways[k])
    )
    found = diagnosed(
        quadruped,
        [trial(quadruped, str(one), gait)],
        comparator=make(1.01 * apart),
        seeds=[one, other],
    )
    distances = {candidate.hypothesis: candidate.distance for candidate in found.ranked}

    assert found.verdict == "ambiguous"
    assert found.test == test
    assert {one, other} <= {found.best, *found.indistinguishable}
    assert found.best not in found.indistinguishable
    assert len(found.indistinguishable) <= SMALL.kept
    assert {distances.get(rival, 0.0) for rival in found.indistinguishable} == {0.0}
    assert found.intact_distance > 0


def deaf(robot: Robot, gait: Controller, sensor: str) -> Controller:
    """The same gait with zero weights for one sensor."""
    number = robot.anatomy.names.sensors.index(sensor)
    genome = gait.genome.copy()
    inputs = len(robot.anatomy.sensors) + 1
    genome[number : network_for(robot).hidden * inputs : inputs] = 0
    return Controller(network_for(robot), genome)


def test_fewer_faults_win_and_what_only_says_more_is_no_rival(quadruped: Robot, gait: Controller):
    # With zero weights for a sensor, its failure changes no bit of the motion.
    truth = parse("break:front_left_knee", quadruped.anatomy)
    more = parse("break:front_left_knee+sensor:back_left_touch", quadruped.anatomy)
    one = trial(quadruped, str(truth), deaf(quadruped, gait, "back_left_touch"))
    found = diagnosed(quadruped, [one], comparator=FORWARD_DISPLACEMENT, seeds=[more])

    assert [candidate.hypothesis for candidate in found.ranked[:2]] == [truth, more]
    assert [candidate.distance for candidate in found.ranked[:2]] == [0, 0]
    assert found.verdict == "explained"
    assert found.indistinguishable == ()


def test_a_fault_that_the_trial_does_not_need_is_not_diagnosed(quadruped: Robot, gait: Controller):
    more = parse("break:front_left_knee+sensor:back_left_angle", quadruped.anatomy)
    one = trial(quadruped, "break:front_left_knee", gait)
    found = diagnosed(quadruped, [one], seeds=[more])

    assert str(found.best) == "break:front_left_knee"


def test_intact_is_always_judged_whatever_the_search_looked_at(quadruped: Robot, gait: Controller):
    one = trial(quadruped, "break:front_left_shoulder", gait)
    search = DiagnosticSearch(Simulator(quadruped, 1), FORWARD_DISPLACEMENT, SMALL)
    found = search([one], [], np.random.default_rng(3), lambda _: None)
    (expected,) = search.losses.distances([INTACT], [one])

    assert found.intact_distance == expected > 0


@pytest.mark.parametrize(
    ("loss", "excess", "has_faults", "unexplained"),
    [
        (LOSS_RATIO * 0.99, 0.0, False, False),
        (LOSS_RATIO * 1.01, 0.0, False, True),
        (LOSS_RATIO * 1.01, 0.0, True, True),
        (1.1, 4.9, False, False),
        (1.1, 5.1, False, True),
        (1.1, math.inf, True, False),
        (FAULTY_RATIO * 1.01, 5.1, True, True),
        (FAULTY_RATIO * 1.01, 4.9, True, False),
    ],
)
def test_a_loss_is_unexplained_if_it_is_significant_and_for_faults_large(
    loss: float, excess: float, *, has_faults: bool, unexplained: bool
):
    assert Fit(loss, 9.0, 1.0, excess, 5.0, has_faults).is_unexplained == unexplained


def test_without_healthy_trials_nothing_is_unexplained():
    assert not Fit(9.0, 9.0, None, None, 5.0, has_faults=False).is_unexplained


@pytest.mark.parametrize("joints", [{}, {"front_left_knee": 4.1}])
def test_a_robot_with_a_joint_that_moves_otherwise_is_not_intact(joints: dict[str, float]):
    fit = Fit(1.0, 1.0, 1.0, 0.0, 3.5, has_faults=False, joints=joints)

    assert fit.is_unexplained == bool(joints)
