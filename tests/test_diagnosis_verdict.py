"""Promises of a diagnosis about itself: what it explains, what it cannot tell apart, what it cannot.

At no reality gap, so that whatever is left unexplained is unexplained by the hypotheses.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from selfmodel.behaviour import Behaviour
from selfmodel.comparator import ClosedLoop, Comparator
from selfmodel.comparators import FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.controller import Controller
from selfmodel.diagnose import EQUAL, Diagnose
from selfmodel.diagnosis import Diagnosis
from selfmodel.faults import FRICTION, JAMMED, PAPER_KINDS, Kind
from selfmodel.hypothesis import INTACT, Hypothesis
from selfmodel.notation import parse
from selfmodel.physical import SimulatedRobot
from selfmodel.robot import Robot
from selfmodel.settings import Settings
from selfmodel.significance import TEST
from selfmodel.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trial import Plan, Stage, Trial
from tests.conftest import random_controllers
from tests.memory import MemoryJournal

SMALL = dataclasses.replace(Settings().scaled(12), generations=2, steps=300)
CASES = ROBOTS["quadruped"].cases
SEEDS = [1, 2]
"""Of random controllers: some under which every failure below shows."""


def trial(robot: Robot, truth: str, controller: Controller, stage: Stage = "after") -> Trial:
    """A trial of a robot with something wrong."""
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    plan = Plan(f"{stage}-{truth}-{hash(controller)}", stage, controller, SMALL.steps, 0)
    return MemoryJournal(robot).record(physical, plan)


def diagnosed(
    robot: Robot,
    trials: Sequence[Trial],
    intact: Sequence[Trial] = (),
    *,
    comparator: Comparator = SEGMENT_PREDICTION,
    kinds: Sequence[Kind] = PAPER_KINDS,
    seeds: Sequence[Hypothesis] = (),
) -> Diagnosis:
    search = Diagnose(Simulator(robot, 1), comparator, SMALL, kinds, intact=intact)
    return search(trials, seeds, np.random.default_rng(0), lambda _: None)


@pytest.fixture(scope="module")
def gait(quadruped: Robot) -> Controller:
    return random_controllers(quadruped, 5)[GAIT]


GAIT = 4


@pytest.fixture(scope="module")
def before(quadruped: Robot, gait: Controller) -> list[Trial]:
    return [trial(quadruped, "intact", gait, "before")]


@pytest.mark.parametrize("case", [1, 2, 3, 6, 9])
def test_a_failure_of_table_one_is_found_and_explained(
    quadruped: Robot, gait: Controller, before: list[Trial], case: int
):
    found = diagnosed(quadruped, [trial(quadruped, CASES[case], gait)], before)

    assert str(found.best) == CASES[case]
    assert found.verdict == "explained"
    assert found.rivals == ()
    assert found.test == TEST
    assert found.ranked[0].distance < 1e-9
    assert (found.intact_distance > 1e-4) == (case != 9)


def test_a_hidden_neuron_is_unexplained(quadruped: Robot, gait: Controller, before: list[Trial]):
    found = diagnosed(quadruped, [trial(quadruped, CASES[10], gait)], before)

    assert found.verdict == "unexplained"


@pytest.mark.parametrize(
    ("truth", "kinds"),
    [
        ("friction=0.3", PAPER_KINDS),
        ("motor:front_left_knee=0.2", PAPER_KINDS),
        ("break:front_left_shoulder", [JAMMED, FRICTION]),
    ],
)
def test_what_is_of_no_kind_that_is_considered_is_not_explained(
    quadruped: Robot, gait: Controller, before: list[Trial], truth: str, kinds: list[Kind]
):
    found = diagnosed(quadruped, [trial(quadruped, truth, gait)], before, kinds=kinds)

    assert found.verdict == "unexplained"


def test_without_a_trial_of_the_intact_robot_nothing_is_unexplained(
    quadruped: Robot, gait: Controller
):
    found = diagnosed(quadruped, [trial(quadruped, CASES[10], gait)])

    assert found.verdict in {"explained", "ambiguous"}


def deaf(robot: Robot, sensor: int) -> Controller:
    """A gait that does not listen to one of its sensors."""
    (gait,) = random_controllers(robot, 1, seed=1)
    genome = gait.genome.copy()
    inputs = len(robot.anatomy.sensors) + 1
    genome[sensor : robot.network.hidden * inputs : inputs] = 0
    return Controller(robot.network, genome)


@dataclasses.dataclass(frozen=True)
class Indifferent:
    """A comparator to which some hypotheses are as good as the best; it judges in one piece."""

    gives: Callable[[int], np.ndarray]
    name: str = "indifferent"

    def request(self, _trial: Trial) -> ClosedLoop:
        """Asks for the way of the root body."""
        return ClosedLoop(record=("base_position",))

    def distances(self, simulated: Behaviour, _trial: Trial) -> np.ndarray:
        """Looks at how many there are."""
        return self.gives(len(simulated["base_position"]))


def test_hypotheses_that_no_trial_tells_apart_are_rivals(quadruped: Robot):
    # A controller that does nothing holds every joint where a jam would hold it... almost; one
    # that is deaf to a sensor moves as if it had failed, to the bit.
    sensor = quadruped.anatomy.sensors[1].name
    controller = deaf(quadruped, 1)
    pair = [
        parse(f"break:back_left_knee+sensor:{name}", quadruped.anatomy)
        for name in (sensor, quadruped.anatomy.sensors[0].name)
    ]
    found = diagnosed(
        quadruped,
        [trial(quadruped, "break:back_left_knee", controller)],
        [trial(quadruped, "intact", controller, "before")],
        comparator=FORWARD_DISPLACEMENT,
        seeds=pair,
    )

    # What only says more is no rival.
    assert str(found.best) == "break:back_left_knee"
    assert found.verdict == "explained"
    assert pair[0] not in found.rivals
    assert pair[0] in [candidate.hypothesis for candidate in found.ranked[:3]]


def test_equally_close_hypotheses_of_the_same_size_make_a_diagnosis_ambiguous(quadruped: Robot):
    controller = deaf(quadruped, 1)
    still = Controller(quadruped.network, np.zeros(quadruped.network.weights))
    del controller
    truth = "break:back_left_knee"
    # Of a robot that only lies there, displacement tells little: two jams are as good as none.
    found = diagnosed(
        quadruped,
        [trial(quadruped, truth, still)],
        comparator=Indifferent(lambda n: np.zeros(n)),
        seeds=[parse(text, quadruped.anatomy) for text in (truth, "jam:back_left_knee")],
    )

    assert found.best == INTACT  # the fewest faults
    assert found.verdict == "explained"  # all others only say more
    assert found.test == EQUAL


def test_fewer_faults_win(quadruped: Robot, gait: Controller, before: list[Trial]):
    truth = parse("break:front_left_knee", quadruped.anatomy)
    more = parse("break:front_left_knee+sensor:back_left_touch", quadruped.anatomy)
    muted = deaf(quadruped, [s.name for s in quadruped.anatomy.sensors].index("back_left_touch"))
    for comparator in (FORWARD_DISPLACEMENT, SEGMENT_PREDICTION):
        found = diagnosed(
            quadruped,
            [trial(quadruped, str(truth), muted)],
            comparator=comparator,
            seeds=[more, truth],
        )
        assert found.best == truth
