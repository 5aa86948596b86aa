"""Promises of choosing the next trial: what it asks, and of which controllers."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, Verdict
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.recovery.events import DiscriminatingTrial, Event
from selfmodel.recovery.next_trial import (
    EARLY_STEPS,
    GENERATIONS,
    Disagreement,
    by_disagreement,
    candidates_to_separate,
    discriminating_controller,
)
from selfmodel.recovery.recover import RecoveryLoop, by_repair, untried_mutants
from selfmodel.recovery.repair import CandidateController
from selfmodel.recovery.result import Database
from selfmodel.robot.designs import cpg_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.outcome import SimulationResult
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs

SMALL = dataclasses.replace(Settings().scaled(12), steps=150)


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


def test_the_rivals_are_in_the_running_and_without_any_those_that_follow(quadruped: Robot):
    texts = [f"break:{joint.name}" for joint in quadruped.anatomy.joints]
    known = [parse(text, quadruped.anatomy) for text in texts]

    def running(indistinguishable: int) -> tuple[Hypothesis, ...]:
        return candidates_to_separate(
            diagnosis(
                *texts, robot=quadruped, indistinguishable=indistinguishable, verdict="ambiguous"
            )
        )

    assert running(1) == tuple(known[:2])
    assert running(7) == running(0) == tuple(known[:5])


def test_what_may_be_wrong_besides_is_in_the_running_after_the_rivals(quadruped: Robot):
    texts = ("intact", "break:front_left_knee", "jam:front_left_knee")
    found = diagnosis(*texts, robot=quadruped, indistinguishable=1, verdict="ambiguous")
    touch = parse("sensor:front_left_touch", quadruped.anatomy)
    best, rival, _ = (one.hypothesis for one in found.ranked)

    assert candidates_to_separate(dataclasses.replace(found, undetectable=(touch,))) == (
        best,
        rival,
        touch,
    )
    assert candidates_to_separate(
        dataclasses.replace(found, indistinguishable=(), undetectable=(touch,))
    ) == (best, touch)


def test_what_explains_too_little_is_held_against_what_follows_it_first(quadruped: Robot):
    found = diagnosis(
        "intact",
        "break:front_left_knee",
        robot=quadruped,
        indistinguishable=0,
        verdict="unexplained",
    )
    touch = parse("sensor:front_left_touch", quadruped.anatomy)
    best, follower = (one.hypothesis for one in found.ranked)

    assert candidates_to_separate(dataclasses.replace(found, undetectable=(touch,))) == (
        best,
        follower,
        touch,
    )


def test_a_hypothesis_that_diverges_is_not_in_the_running(quadruped: Robot):
    found = diagnosis("intact", "break:front_left_knee", robot=quadruped, verdict="explained")
    apart = dataclasses.replace(found.ranked[1], distance=float("inf"))

    assert candidates_to_separate(dataclasses.replace(found, ranked=(found.ranked[0], apart))) == (
        INTACT,
    )


@settings(deadline=None)
@given(
    seed=st.integers(0, 2**32),
    known=st.integers(1, 4),
    mutation=st.sampled_from([0.0, 0.01, 1.0]),
)
def test_a_controller_that_was_tried_is_no_candidate(
    quadruped: Robot, seed: int, known: int, mutation: float
):
    tried = random_controllers(quadruped, known, seed % 97)
    numbers = dataclasses.replace(SMALL, mutation=mutation, crossovers=0)
    pool = untried_mutants(tried, tried, numbers, np.random.default_rng(seed))

    assert not set(pool) & set(tried)
    assert 1 <= len(pool) == len(set(pool)) <= numbers.population


def test_mutants_are_of_the_kind_of_their_parents(quadruped: Robot):
    newest, older = random_cpgs(quadruped, 2)
    found = untried_mutants([newest], [newest, older], SMALL, np.random.default_rng(0))

    assert {one.design for one in found} == {cpg_for(quadruped)}


def test_offspring_is_bred_of_every_controller_that_was_tried(quadruped: Robot):
    tried = random_controllers(quadruped, 3)
    numbers = dataclasses.replace(SMALL, mutation=0.05, crossovers=0)
    pool = untried_mutants(tried, tried, numbers, np.random.default_rng(0))
    kin = [[np.mean(child.genome == parent.genome) > 0.8 for parent in tried] for child in pool]

    assert np.all(np.sum(kin, axis=1) == 1)
    assert np.all(np.any(kin, axis=0))


def test_what_is_asked_is_bred_to_ask_more(quadruped: Robot):
    simulator, known = Simulator(quadruped, 2), random_controllers(quadruped, 2)
    touch = parse("sensor:front_left_touch", quadruped.anatomy)
    found = diagnosis("intact", robot=quadruped, verdict="explained")
    found = dataclasses.replace(found, undetectable=(touch,))
    first = untried_mutants(known, known, SMALL, np.random.default_rng(1))
    best = Disagreement([INTACT, touch], simulator, SMALL.steps).most_discriminative(first)
    bred = discriminating_controller(found, known, simulator, SMALL, np.random.default_rng(1))

    column = [sensor.name for sensor in quadruped.anatomy.sensors].index("front_left_touch")
    runs = simulator.run([(INTACT, one) for one in (best, bred)], EARLY_STEPS, ("sensors",))
    less, more = runs.behaviour["sensors"][..., column].mean(axis=1)
    assert more > less
    assert bred not in first


def test_the_controller_that_disagrees_most_is_not_tried_a_second_time(quadruped: Robot):
    simulator = Simulator(quadruped, 2)
    touch = parse("sensor:front_left_touch", quadruped.anatomy)
    found = diagnosis("intact", robot=quadruped, verdict="explained")
    found = dataclasses.replace(found, undetectable=(touch,))
    newest, *older = random_controllers(quadruped, 2)
    for _ in range(3):  # without mutation, offspring of the best one remains the best one
        numbers = dataclasses.replace(SMALL, mutation=0.001, crossovers=0)
        stream = np.random.default_rng(1)
        best = discriminating_controller(found, [newest, *older], simulator, numbers, stream)
        assert best not in [newest, *older]
        older.append(best)


def loop_of(
    robot: Robot,
    tried: Sequence[Controller],
    found: Sequence[Controller],
    diagnoses: Sequence[Diagnosis] = (),
    on_event: Callable[[Event], None] = lambda _event: None,
) -> RecoveryLoop:
    """A recovery after trials of some controllers, in which the repair finds others."""
    empty = Behaviour(robot.anatomy.names, np.zeros(1), {})
    trials = [
        Trial(TrialPlan(f"{i:02d}-after", "after", one, 1, 0), robot.name, empty, f"{i:02d}-after")
        for i, one in enumerate(tried)
    ]
    unused = dict.fromkeys(("choose_comparator", "run_trial", "journal"))
    loop = RecoveryLoop(
        simulator=Simulator(robot, 1), settings=SMALL, seed=0, on_event=on_event, **unused
    )
    loop.known = Database(tuple(trials), tuple(diagnoses))
    loop.trials_left, loop.rng = 1, np.random.default_rng(0)
    loop.repaired = lambda: tuple(CandidateController(one, np.zeros(1)) for one in found)
    return loop


def test_a_repair_that_was_tried_is_followed_by_the_next_best(quadruped: Robot):
    first, second, third = random_controllers(quadruped, 3)
    assert by_repair(loop_of(quadruped, [first], [first, second, third])) == second
    assert by_repair(loop_of(quadruped, [second, first], [first, second, third])) == third


def test_if_all_repairs_were_tried_a_mutant_of_the_best_is_next(quadruped: Robot):
    first, second = random_controllers(quadruped, 2)
    chosen = by_repair(loop_of(quadruped, [first, second], [second, first]))
    alike = np.mean(chosen.genome == second.genome)
    assert 0.5 < alike < 1


class CountingSimulator(Simulator):
    """Counts how often each controller is simulated for so many steps under each hypothesis."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, threads=2)
        self.times: Counter = Counter()

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        """Simulates as ever."""
        self.times.update((run, steps) for run in runs if not isinstance(run[1], Playback))
        return super().run(runs, steps, record)


def test_what_is_bred_of_is_not_looked_at_again(quadruped: Robot):
    simulator = CountingSimulator(quadruped)
    found = diagnosis("intact", "jam:front_left_knee", robot=quadruped, verdict="ambiguous")
    discriminating_controller(
        found, random_controllers(quadruped, 2), simulator, SMALL, np.random.default_rng(1)
    )

    assert len(simulator.times) > GENERATIONS * SMALL.survivors
    assert set(simulator.times.values()) == {1}


def test_the_same_stream_chooses_the_same_at_any_number_of_threads(quadruped: Robot):
    found = diagnosis(
        *("jam:front_left_knee", "jam:front_left_shoulder"),
        robot=quadruped,
        indistinguishable=1,
        verdict="ambiguous",
    )
    tried = random_controllers(quadruped, 2)
    one, other = (
        discriminating_controller(
            found, tried, Simulator(quadruped, n), SMALL, np.random.default_rng(3)
        )
        for n in (1, 2)
    )

    assert one == other != tried[0]


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
    quadruped: Robot, verdict: Verdict, unseen: list[int], trials_left: int, *, asks: bool
):
    # How much is unseen after each trial.
    gait, compensating = random_controllers(quadruped, 2)
    besides = [parse(f"jam:{joint.name}", quadruped.anatomy) for joint in quadruped.anatomy.joints]
    told = diagnosis("jam:front_left_knee", "intact", robot=quadruped, verdict=verdict)
    diagnoses = [dataclasses.replace(told, undetectable=tuple(besides[:count])) for count in unseen]
    found = diagnoses[-1]
    events: list[Event] = []
    loop = loop_of(quadruped, [gait], [compensating], diagnoses, events.append)
    loop.trials_left = trials_left

    assert by_repair(loop) == compensating
    assert (by_disagreement(loop) != compensating) == asks
    assert events == ([DiscriminatingTrial(candidates_to_separate(found))] if asks else [])
