"""Promises of choosing the next trial: what it asks, and of which controllers."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.controllers.controller import Controller
from selfmodel.controllers.network import Network
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, Verdict
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery import next_trial as disagreement
from selfmodel.recovery.candidates import CandidateController
from selfmodel.recovery.next_trial import (
    EARLY_STEPS,
    Disagreement,
    by_disagreement,
    candidates_to_separate,
    disagreements,
    discriminating_controller,
)
from selfmodel.recovery.recover import RecoveryLoop, by_repair
from selfmodel.recovery.repair import untried_mutants
from selfmodel.recovery.result import DiscriminatingTrial, Event
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.rollout import SimulationResult
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.signals import DISAGREEMENT_SCALES, Names, Signal
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs

SIDES = ("left", "right")
SMALL = dataclasses.replace(Settings().scaled(8), steps=120)


def diagnosis(*texts: str, robot: Robot, indistinguishable: int = 0, verdict: Verdict) -> Diagnosis:
    """A diagnosis with these hypotheses, best first; the first few after the best are rivals."""
    found = [parse(text, robot.anatomy) for text in texts]
    return Diagnosis(
        ranked=tuple(Candidate(one, float(rank)) for rank, one in enumerate(found)),
        trials=1,
        intact_distance=9.0,
        indistinguishable=tuple(found[1 : 1 + indistinguishable]),
        verdict=verdict,
        test="by decree",
    )


TEXTS = ("intact", *(f"break:{side}_{end}_knee" for side in ("front", "back") for end in SIDES))
UNSEEN = "sensor:front_left_touch"


@pytest.mark.parametrize(
    ("verdict", "rivals", "unseen", "expected"),
    [
        ("ambiguous", 1, [], TEXTS[:2]),
        ("ambiguous", 4, [UNSEEN], TEXTS),
        ("explained", 0, [], TEXTS),
        ("ambiguous", 1, [UNSEEN], (*TEXTS[:2], UNSEEN)),
        ("explained", 0, [UNSEEN], (TEXTS[0], UNSEEN)),
        ("unexplained", 0, [UNSEEN], TEXTS),  # the next in the ranking first
        ("not judged", 0, [UNSEEN], TEXTS),
    ],
)
def test_rivals_come_first_then_what_is_unseen_and_without_any_those_that_follow(
    quadruped: Robot, verdict: Verdict, rivals: int, unseen: list[str], expected: Sequence[str]
):
    found = diagnosis(*TEXTS, robot=quadruped, indistinguishable=rivals, verdict=verdict)
    besides = tuple(parse(text, quadruped.anatomy) for text in unseen)
    found = dataclasses.replace(found, undetectable=besides)

    assert [str(one) for one in candidates_to_separate(found)] == list(expected)
    diverged = tuple(dataclasses.replace(one, distance=np.inf) for one in found.ranked[1:])
    found = dataclasses.replace(found, ranked=(found.ranked[0], *diverged), verdict="explained")
    left = dict.fromkeys((*found.indistinguishable, *found.undetectable))
    assert candidates_to_separate(found) == (found.best, *left)[:5]


@pytest.mark.parametrize("mutation", [0.0, 0.05])
def test_offspring_is_of_every_controller_that_was_tried_and_is_none_of_them(
    quadruped: Robot, mutation: float
):
    for tried in (random_controllers(quadruped, 3), random_cpgs(quadruped, 3)):
        numbers = dataclasses.replace(SMALL, mutation=mutation, crossovers=0)
        pool = untried_mutants(tried, tried, numbers, np.random.default_rng(0))

        assert {child.design for child in pool} == {tried[0].design}
        assert not set(pool) & set(tried)
        assert 1 <= len(pool) == len(set(pool)) <= numbers.population
        if mutation:
            kin = [[np.mean(c.genome == t.genome) > 0.7 for t in tried] for c in pool]
            assert np.all(np.sum(kin, axis=1) == 1)
            assert np.all(np.any(kin, axis=0))
        else:
            assert len(pool) == 1, "every mutant equals its parent: a random controller"


@pytest.mark.search
def test_what_is_asked_is_bred_to_ask_more_and_of_its_seed_at_any_number_of_threads(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(disagreement, "GENERATIONS", 3)
    touch = parse("sensor:front_left_touch", quadruped.anatomy)
    found = diagnosis("intact", robot=quadruped, verdict="explained")
    found = dataclasses.replace(found, undetectable=(touch,))
    known = random_controllers(quadruped, 2)
    first = untried_mutants(known, known, SMALL, np.random.default_rng(1))
    simulator = Simulator(quadruped, 2)
    best = Disagreement([INTACT, touch], simulator, SMALL.steps).most_discriminative(first)
    simulator.run = run = Mock(wraps=simulator.run)
    bred, again = (
        discriminating_controller(found, known, one, SMALL, np.random.default_rng(1))
        for one in (simulator, Simulator(quadruped, 1))
    )

    runs = [(one, call.args[1]) for call in run.call_args_list for one in call.args[0]]
    closed = [one for one in runs if not isinstance(one[0][1], Playback)]
    assert len(closed) == len(set(closed)), "what is bred of is not simulated again"
    assert len(closed) > 3 * SMALL.survivors
    column = [sensor.name for sensor in quadruped.anatomy.sensors].index("front_left_touch")
    runs = simulator.run([(INTACT, one) for one in (best, bred)], EARLY_STEPS, ("sensors",))
    less, more = runs.trajectory["sensors"][..., column].mean(axis=1)
    assert more > less
    assert bred == again
    assert bred not in [*first, *known]


def loop_of(
    robot: Robot,
    tried: Sequence[Controller],
    found: Sequence[Controller],
    diagnoses: Sequence[Diagnosis] = (),
    on_event: Callable[[Event], None] = lambda _event: None,
) -> RecoveryLoop:
    """A recovery after trials of some controllers, in which the repair finds others."""
    empty = Trajectory(robot.anatomy.names, np.zeros(1), {})
    trials = [
        Trial(TrialPlan(f"{i:02d}-after", "after", one, 1, 0), robot.name, empty, f"{i:02d}-after")
        for i, one in enumerate(tried)
    ]
    unused = dict.fromkeys(("choose_comparator", "run_trial", "store_diagnosis"))
    loop = RecoveryLoop(
        simulator=Simulator(robot, 1), settings=SMALL, seed=0, on_event=on_event, **unused
    )
    loop.trials, loop.diagnoses = tuple(trials), tuple(diagnoses)
    loop.trials_left, loop.rng = 1, np.random.default_rng(0)
    loop.repaired = lambda: tuple(CandidateController(one, np.zeros(1)) for one in found)
    return loop


def test_a_repair_that_was_tried_is_followed_by_the_next_best_and_the_last_by_the_best(
    quadruped: Robot,
):
    first, second, third = random_controllers(quadruped, 3)
    assert by_repair(loop_of(quadruped, [first], [first, second, third])) == second
    assert by_repair(loop_of(quadruped, [second, first], [first, second, third])) == third
    assert by_repair(loop_of(quadruped, [first, second], [second, first])) == second


@pytest.mark.parametrize("keeps", [True, False])
def test_an_intact_robot_keeps_its_controller_with_a_repair_around_it(
    quadruped: Robot, *, keeps: bool
):
    gait, better = random_controllers(quadruped, 2)
    for verdict in ("intact", "unexplained"):
        found = diagnosis("intact", robot=quadruped, verdict=verdict)
        loop = loop_of(quadruped, [gait], [better], [found])
        loop.gait, loop._repairs = gait, [Mock(adapts_gait=keeps)]
        assert by_repair(loop) == (gait if keeps and verdict == "intact" else better)


@pytest.mark.parametrize(
    ("verdict", "unseen", "trials_left", "asks"),
    [
        ("ambiguous", [0], 2, True),
        ("unexplained", [0], 2, True),
        ("explained", [0], 2, False),
        ("explained", [1], 2, True),
        ("explained", [2, 1], 2, True),
        ("explained", [1, 1], 2, False),
        ("ambiguous", [1, 1], 2, True),
        ("ambiguous", [1], 1, False),
    ],
)
def test_hypotheses_are_told_apart_until_one_explains_all_or_asking_is_in_vain(
    quadruped: Robot,
    monkeypatch: pytest.MonkeyPatch,
    verdict: Verdict,
    unseen: list[int],
    trials_left: int,
    *,
    asks: bool,
):
    gait, compensating, separating = random_controllers(quadruped, 3)
    monkeypatch.setattr(disagreement, "discriminating_controller", lambda *_: separating)
    # How much is unseen after each trial.
    besides = [parse(f"jam:{joint.name}", quadruped.anatomy) for joint in quadruped.anatomy.joints]
    told = diagnosis("jam:front_left_knee", "intact", robot=quadruped, verdict=verdict)
    diagnoses = [dataclasses.replace(told, undetectable=tuple(besides[:count])) for count in unseen]
    found = diagnoses[-1]
    events: list[Event] = []
    loop = loop_of(quadruped, [gait], [compensating], diagnoses, events.append)
    loop.trials_left = trials_left

    assert by_repair(loop) == compensating
    assert by_disagreement(loop) == (separating if asks else compensating)
    assert events == ([DiscriminatingTrial(candidates_to_separate(found))] if asks else [])


NAMES = Names(sensors=("touch",), motors=("motor",), hinges=("hinge",))
UP = np.array([0.0, 0.0, 1.0])
HEIGHT = 0.3


@dataclass(frozen=True)
class Fate:
    """What is predicted of a controller.

    Attributes:
        spread: How far the joint's positions under the two hypotheses are apart, rad.
        falls: The step at which the robot falls under the second hypothesis, if it does.
        diverges: Whether the simulation of the second hypothesis does.
        late: Whether they part only after what is read off.
    """

    spread: float
    falls: int | None = None
    diverges: bool = False
    late: bool = False


class Oracle:
    """A simulator that knows the fate of each controller."""

    robot = SimpleNamespace(standing_height=HEIGHT, anatomy=SimpleNamespace(names=NAMES))

    def __init__(self, fates: Sequence[Fate]) -> None:
        network = Network(NAMES.sensors, NAMES.motors)
        weights = np.arange(len(fates)) / 100
        self.controllers = [
            Controller(network, np.full(network.weights, weight)) for weight in weights
        ]
        self._fates = dict(zip(self.controllers, fates, strict=True))

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        """Predicts what the fates say; only the second hypothesis is not uneventful."""
        known = dict(enumerate(self.controllers))
        shapes = {signal: (len(runs), steps, NAMES.width(signal)) for signal in record}
        signals = {signal: np.zeros(shape) for signal, shape in shapes.items()}
        signals["base_position"][..., 2] = HEIGHT
        signals["base_orientation"][..., 0] = 1
        diverged = np.zeros(len(runs), dtype=bool)
        for row, (hypothesis, driver) in enumerate(runs):
            # What a controller commands is its number.
            controller = known[driver.commands[0, 0]] if isinstance(driver, Playback) else driver
            signals["commands"][row] = self.controllers.index(controller)
            fate = self._fates[controller]
            if hypothesis == INTACT:
                continue
            signals["joint_positions"][row, EARLY_STEPS if fate.late else 0 :] = fate.spread
            if fate.falls is not None:
                signals["base_position"][row, fate.falls :, 2] = 0.4 * HEIGHT
            if fate.diverges:
                diverged[row] = True
                signals["joint_positions"][row, -1] = np.nan
        time = np.arange(steps) * 0.01
        return SimulationResult(Trajectory(NAMES, time, signals), diverged)


def test_a_dead_sensor_is_asked_for_where_it_would_read_most(quadruped: Robot):
    # What the controllers would make of the reading, another motion, is not evidence.
    simulator = Simulator(quadruped, 2)
    hypotheses = [INTACT, parse("sensor:front_left_touch", quadruped.anatomy)]
    pool = random_controllers(quadruped, 12)
    touch = [sensor.name for sensor in quadruped.anatomy.sensors].index("front_left_touch")
    runs = simulator.run([(INTACT, one) for one in pool], EARLY_STEPS, ("sensors",))
    touches = runs.trajectory["sensors"][..., touch].mean(axis=1)

    assert len(set(touches)) > 4
    assert (
        Disagreement(hypotheses, simulator, EARLY_STEPS).most_discriminative(pool)
        == pool[int(np.argmax(touches))]
    )


@pytest.mark.parametrize(
    ("fates", "index"),
    [
        ([Fate(0.1), Fate(0.2), Fate(0.2), Fate(0.15)], 1),  # of equals the first
        ([Fate(0.01), Fate(0.3, late=True)], 0),
        ([Fate(0.2, diverges=True), Fate(0.1)], 1),
        ([Fate(0.05), Fate(0.2, falls=0), Fate(0.1)], 2),
        ([Fate(0.05), Fate(0.2, falls=EARLY_STEPS), Fate(0.1)], 2),
        ([Fate(0.05), Fate(0.2, falls=380), Fate(0.1)], 2),
        # If all fall, the latest one.
        ([Fate(0.3, diverges=True), Fate(0.3, falls=5), Fate(0.2, falls=50)], 2),
        ([Fate(0.3, falls=150), Fate(0.2, falls=380), Fate(0.1, falls=200)], 1),
    ],
)
def test_the_controller_with_the_largest_early_disagreement_and_without_a_fall_is_chosen(
    quadruped: Robot, fates: Sequence[Fate], index: int
):
    oracle = Oracle(fates)
    hypotheses = [INTACT, parse("break:front_left_knee", quadruped.anatomy)]
    with pytest.MonkeyPatch.context() as patch:
        level = SimpleNamespace(normal=UP)
        patch.setattr(disagreement, "build", lambda _robot, _hypothesis: level)
        one = Disagreement(hypotheses, oracle, 400).most_discriminative(oracle.controllers)
    assert oracle.controllers.index(one) == index


@settings(deadline=None)
@given(seed=st.integers(0, 2**32), hypotheses=st.integers(1, 4), size=st.floats(0, 10))
def test_disagreement_is_a_part_of_one_and_knows_no_order_of_the_hypotheses(
    seed: int, hypotheses: int, size: float
):
    rng = np.random.default_rng(seed)
    shape = (2, hypotheses, 7)
    signals = {
        signal: size * rng.normal(size=(*shape, NAMES.width(signal)))
        for signal in DISAGREEMENT_SCALES
    }
    turned = Rotation.from_rotvec(size * rng.normal(size=(np.prod(shape), 3)))
    signals["base_orientation"] = turned.as_quat(scalar_first=True).reshape(*shape, 4)
    order = rng.permutation(hypotheses)
    time = np.arange(7) * 0.01
    found = disagreements(Trajectory(NAMES, time, signals))
    shuffled = {signal: values[:, order] for signal, values in signals.items()}

    assert np.all((found >= 0) & (found <= 1))
    assert disagreements(Trajectory(NAMES, time, shuffled)) == pytest.approx(found, abs=1e-12)
    if hypotheses == 1 or size == 0:
        assert np.all(found == 0)
