"""Promises of the algorithm: the paper's loop, no run simulated twice, no look at the truth."""

import dataclasses
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from selfmodel.behaviour import Sample, Signal
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controller import Controller
from selfmodel.diagnose import Diagnose
from selfmodel.diagnosis import Diagnosis
from selfmodel.evolution import Generation
from selfmodel.hypothesis import INTACT, Hypothesis
from selfmodel.judge import is_correct
from selfmodel.notation import parse
from selfmodel.physical import SimulatedRobot
from selfmodel.recover import Event, Recovery, SearchBegins, recover
from selfmodel.repair import Repair
from selfmodel.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulator import Run, Simulated, Simulator
from selfmodel.trial import Plan, Trial
from tests.conftest import exploding, random_controllers
from tests.memory import MemoryJournal

SMALL = dataclasses.replace(Settings().scaled(20), generations=5, steps=200)


class CountingSimulator(Simulator):
    """Counts how often each pair of hypothesis and controller is simulated for each record."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, threads=2)
        self.seen: Counter = Counter()

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> Simulated:
        """Simulates as ever."""
        self.seen.update((*run, steps) for run in runs)
        return super().run(runs, steps, record)


class Sealed:
    """A physical robot of which nothing but ``run`` can be reached."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.__robot = robot  # mangled: no other name leads to it

    def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
        """Runs a controller."""
        return self.__robot.run(controller, steps)

    def __getattribute__(self, name: str) -> object:
        if name not in ("run", "_Sealed__robot"):
            raise AssertionError(f"the algorithm reached for {name} of the physical robot")
        return object.__getattribute__(self, name)


def recovery(
    robot: Robot,
    truth: Hypothesis,
    simulator: Simulator,
    events: list[Event],
    *,
    sealed: bool = True,
) -> Recovery:
    """A small recovery from a failure."""
    physical = SimulatedRobot(robot), SimulatedRobot(robot, truth)
    healthy, damaged = (Sealed(one) for one in physical) if sealed else physical
    return recover(
        healthy=healthy,
        damaged=damaged,
        simulator=simulator,
        comparator=FORWARD_DISPLACEMENT,
        journal=MemoryJournal(robot),
        settings=SMALL,
        seed=5,
        watch=events.append,
    )


def test_a_recovery_tells_the_papers_story(robot: Robot):
    events: list[Event] = []
    truth = parse(f"break:{robot.anatomy.joints[0].name}", robot.anatomy)
    outcome = recovery(robot, truth, Simulator(robot, 2), events)
    story = [
        event.kind if isinstance(event, SearchBegins) else type(event).__name__
        for event in events
        if not isinstance(event, Generation)
    ]

    once = ["diagnostic", "Diagnosis", "repair", "Trial"]
    assert story == ["repair", "Trial", "Trial", *once, *once, *once, "diagnostic", "Diagnosis"]
    stages = [trial.plan.stage for trial in outcome.trials]
    assert stages == ["before", "after", "recovery", "recovery", "recovery"]
    assert outcome.trials[0].plan.controller == outcome.trials[1].plan.controller
    assert outcome.tried[:2] == (INTACT, INTACT)
    repairs = [e for e in events if isinstance(e, SearchBegins) and e.kind == "repair"]
    assert [search.hypothesis for search in repairs] == [INTACT, *outcome.tried[2:]]
    diagnoses = [event for event in events if isinstance(event, Diagnosis)]
    assert [diagnosis.trials for diagnosis in diagnoses] == [1, 2, 3, 4]
    assert [diagnosis.best for diagnosis in diagnoses[:3]] == list(outcome.tried[2:])
    assert outcome.repair_evaluations == outcome.diagnostic_evaluations == 4 * (20 + 4 * 10)
    assert outcome.recovered == max(trial.displacement for trial in outcome.trials[2:])


def test_nothing_is_simulated_twice(quadruped: Robot):
    simulator = CountingSimulator(quadruped)
    events: list[Event] = []
    outcome = recovery(
        quadruped, parse("jam:front_left_knee", quadruped.anatomy), simulator, events
    )
    trials = Counter(trial.plan.controller for trial in outcome.trials[1:])

    # Once for its fitness in a repair; a controller that was tried, once more for each trial that
    # a diagnosis compares it with.
    for (_, controller, _), times in simulator.seen.items():
        assert times <= 1 + trials[controller]
    asked = outcome.repair_evaluations + outcome.diagnostic_evaluations
    assert len(simulator.seen) < asked


def test_the_algorithm_cannot_see_what_is_hidden(quadruped: Robot):
    truth = parse("break:back_left_knee", quadruped.anatomy)
    open_events: list[Event] = []
    recovery(quadruped, truth, Simulator(quadruped, 2), open_events, sealed=False)
    events: list[Event] = []
    recovery(quadruped, truth, Simulator(quadruped, 1), events)

    def facts(told: list[Event]) -> list[object]:
        diagnoses = [event for event in told if isinstance(event, Diagnosis)]
        return [*diagnoses, *(event.displacement for event in told if isinstance(event, Trial))]

    assert facts(events) == facts(open_events)
    with pytest.raises(AssertionError, match="reached for _embodiment"):
        _ = Sealed(SimulatedRobot(quadruped, truth))._embodiment


def test_the_truth_changes_a_diagnosis_only_through_what_the_robot_did(quadruped: Robot):
    """A robot that hides another fault but replays the same samples gets the same diagnosis."""

    class Replay:
        def __init__(self, source: SimulatedRobot, hidden: Hypothesis) -> None:
            self._source, self.hidden = source, hidden

        def run(self, controller: Controller, steps: int) -> Iterator[Sample]:
            """Runs a controller."""
            return self._source.run(controller, steps)

    truth = parse("break:back_left_knee", quadruped.anatomy)
    diagnoses = []
    for hidden in (truth, INTACT):
        events: list[Event] = []
        damaged = Replay(SimulatedRobot(quadruped, truth), hidden)
        recover(
            healthy=SimulatedRobot(quadruped),
            damaged=damaged,
            simulator=Simulator(quadruped, 2),
            comparator=FORWARD_DISPLACEMENT,
            journal=MemoryJournal(quadruped),
            settings=dataclasses.replace(SMALL, trials=1),
            seed=1,
            watch=events.append,
        )
        diagnoses.append([event for event in events if isinstance(event, Diagnosis)])

    assert diagnoses[0] == diagnoses[1]


def test_the_same_seed_recovers_the_same_way_at_any_number_of_threads(quadruped: Robot):
    truth = parse("jam:front_left_shoulder", quadruped.anatomy)
    outcomes = [recovery(quadruped, truth, Simulator(quadruped, n), []) for n in (1, 2)]

    assert outcomes[0].diagnosis == outcomes[1].diagnosis
    ways = [[trial.displacement for trial in outcome.trials] for outcome in outcomes]
    assert ways[0] == ways[1]


def logged(robot: Robot, truth: str, controller: Controller, steps: int = 300) -> Trial:
    """A trial of a damaged robot."""
    physical = SimulatedRobot(robot, parse(truth, robot.anatomy))
    return MemoryJournal(robot).record(physical, Plan(truth, "after", controller, steps, 0))


@pytest.mark.parametrize("truth", ["break:front_left_knee", "jam:back_right_shoulder", "intact"])
def test_the_truth_is_at_distance_zero_and_ranks_first(quadruped: Robot, truth: str):
    trials = [logged(quadruped, truth, c) for c in random_controllers(quadruped, 2)]
    diagnose = Diagnose(Simulator(quadruped, 2), FORWARD_DISPLACEMENT, Settings())
    seeds = [parse(truth, quadruped.anatomy), parse("jam:front_right_knee", quadruped.anatomy)]
    diagnosis = diagnose(trials, seeds, np.random.default_rng(0), lambda _: None)

    assert str(diagnosis.best) == truth
    assert diagnosis.ranked[0].distance == 0
    distances = [candidate.distance for candidate in diagnosis.ranked]
    assert len(distances) == 10
    assert distances == sorted(distances)


def test_a_diverging_hypothesis_is_infinitely_far_and_a_diverging_gait_is_worst(quadruped: Robot):
    simulator = Simulator(quadruped, 2)
    bad = exploding(simulator, "jam:front_left_knee")
    (controller,) = random_controllers(quadruped, 1)
    trial = logged(quadruped, "break:front_left_knee", controller)
    diagnose = Diagnose(simulator, FORWARD_DISPLACEMENT, SMALL)

    distances = diagnose.distances([bad, INTACT], [trial])
    assert distances[0] == np.inf
    assert np.isfinite(distances[1])
    ways = Repair(simulator, SMALL)._simulate([(bad, controller), (INTACT, controller)])
    assert ways[0] == -np.inf
    assert np.isfinite(ways[1])
    assert simulator.tally.diverged == 2


def test_a_diagnosis_is_correct_if_it_cannot_be_told_from_the_truth(quadruped: Robot):
    simulator = Simulator(quadruped, 2)
    deaf = Controller(quadruped.network, np.zeros(quadruped.network.weights))
    (awake,) = random_controllers(quadruped, 1)
    truth = parse("neuron:0", quadruped.anatomy)

    asleep = [logged(quadruped, "neuron:0", deaf)]
    assert is_correct(INTACT, truth, asleep, simulator)  # its neurons do nothing anyway
    assert not is_correct(INTACT, truth, [*asleep, logged(quadruped, "neuron:0", awake)], simulator)
    assert is_correct(truth, truth, [logged(quadruped, "neuron:0", awake)], simulator)


def test_a_repair_starts_from_the_controllers_it_is_given(quadruped: Robot):
    settings = dataclasses.replace(SMALL, generations=1)
    repair = Repair(Simulator(quadruped, 2), settings)
    good = repair(
        INTACT, random_controllers(quadruped, 20), np.random.default_rng(0), lambda _: None
    )
    kept = repair(INTACT, [good], np.random.default_rng(1), lambda _: None)
    runs = [(INTACT, good), (INTACT, kept)]
    ways = repair._fitness.values(runs, lambda _: np.empty(0))

    assert ways[1] >= ways[0]
