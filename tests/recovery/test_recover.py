"""Promises of the algorithm: the paper's loop, no run simulated twice, no look at the truth."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.random import Generator

from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError
from selfmodel.evolution import Draw, Evolution, Generation
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs import read_truth, reader
from selfmodel.logs.journal import FolderJournal, create_journal
from selfmodel.logs.log_file import Contents
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.events import Event, SearchBegins
from selfmodel.recovery.recover import NextTrial, RecoveryLoop, by_repair
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.result import Recovery
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.rollout import SimulationResult
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.behaviour import Sample
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Stage, Trial
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import MemoryJournal, in_memory

TINY = dataclasses.replace(Settings().scaled(6), generations=2, steps=60)


class CountingSimulator(Simulator):
    """Counts how often each pair of hypothesis and controller is simulated for each record."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, threads=2)
        self.seen: Counter = Counter()
        self.on_run: Callable[[Sequence[Run]], object] = lambda _runs: None

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        """Simulates as ever."""
        self.seen.update((*run, steps) for run in runs)
        self.on_run(runs)
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
    seed: int = 5,
    trials: int = 3,
    gait: Controller | None = None,
    next_trial: NextTrial = by_repair,
) -> Recovery:
    """A small recovery from a failure."""
    physical = SimulatedRobot(robot), SimulatedRobot(robot, truth)
    healthy, damaged = (Sealed(one) for one in physical) if sealed else physical
    return RecoveryLoop(
        simulator=simulator,
        choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
        run_trial=in_memory(robot),
        journal=MemoryJournal(),
        settings=dataclasses.replace(TINY, trials=trials),
        seed=seed,
        on_event=events.append,
        kinds=PAPER_KINDS,
        gait=gait,
        next_trial=next_trial,
        make_repair=RepairSearch,
    ).run(healthy, damaged)


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
    first = ["repair", "Trial", "Trial", "ChosenComparator"]
    assert story == [*first, *once, *once, *once, "diagnostic", "Diagnosis"]
    stages = [trial.plan.stage for trial in outcome.trials]
    assert stages == ["before", "after", "recovery", "recovery", "recovery"]
    assert outcome.trials[0].plan.controller == outcome.trials[1].plan.controller
    assert outcome.tried[:2] == (INTACT, INTACT)
    repairs = [e for e in events if isinstance(e, SearchBegins) and e.kind == "repair"]
    assert [search.hypothesis for search in repairs] == [INTACT, *outcome.tried[2:]]
    diagnoses = [event for event in events if isinstance(event, Diagnosis)]
    assert [diagnosis.trials for diagnosis in diagnoses] == [1, 2, 3, 4]
    assert [diagnosis.best for diagnosis in diagnoses[:3]] == list(outcome.tried[2:])
    children = TINY.population // 2
    evaluations = TINY.population + (TINY.generations - 1) * children
    assert outcome.repair_evaluations == outcome.diagnostic_evaluations == 4 * evaluations
    assert outcome.recovered == max(trial.displacement for trial in outcome.trials[2:])


def test_nothing_is_simulated_twice(quadruped: Robot):
    simulator = CountingSimulator(quadruped)
    events: list[Event] = []
    outcome = recovery(
        quadruped, parse("jam:front_left_knee", quadruped.anatomy), simulator, events
    )
    trials = Counter(trial.plan.controller for trial in outcome.trials[1:])

    # Once for its fitness in a repair; a controller that was tried, once more for each trial that
    # a diagnosis compares it with; and intact, for the trial that shows how well it is predicted.
    before = INTACT, outcome.trials[0].plan.controller
    for (hypothesis, controller, _), times in simulator.seen.items():
        assert times <= 1 + trials[controller] + ((hypothesis, controller) == before)
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


def test_the_same_seed_recovers_the_same_way_at_any_number_of_threads(quadruped: Robot):
    truth = parse("jam:front_left_shoulder", quadruped.anatomy)
    outcomes = [recovery(quadruped, truth, Simulator(quadruped, n), []) for n in (1, 2)]

    assert outcomes[0].diagnosis == outcomes[1].diagnosis
    ways = [[trial.displacement for trial in outcome.trials] for outcome in outcomes]
    assert ways[0] == ways[1]


def test_every_search_starts_from_what_the_database_holds(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    started: list[list[bytes]] = []

    class Spy(Evolution):
        def __init__(
            self, length: int, draw: Draw, settings: Settings, rng: Generator, seeds: list
        ) -> None:
            started.append([np.asarray(seed).tobytes() for seed in seeds])
            super().__init__(length, draw, settings, rng, seeds)

    monkeypatch.setattr("selfmodel.recovery.repair.Evolution", Spy)
    monkeypatch.setattr("selfmodel.diagnosis.search.Evolution", Spy)
    events: list[Event] = []
    truth = parse("break:back_left_knee", quadruped.anatomy)
    outcome = recovery(quadruped, truth, Simulator(quadruped, 2), events)
    diagnoses = [event for event in events if isinstance(event, Diagnosis)]
    genomes = [trial.plan.controller.genome.tobytes() for trial in outcome.trials]
    space = HypothesisSpace(quadruped.anatomy, PAPER_KINDS)
    encoded = [
        [space.encode(c.hypothesis, TINY.genes).tobytes() for c in d.ranked] for d in diagnoses
    ]

    def newest_first(count: int) -> list[bytes]:
        return list(dict.fromkeys(reversed(genomes[:count])))

    assert started[0] == []
    assert started[1::2] == [[], *encoded[:3]]
    assert started[2::2] == [newest_first(2), newest_first(3), newest_first(4)]


def test_every_repair_simulates_the_robot_that_was_diagnosed(quadruped: Robot):
    simulator, events = CountingSimulator(quadruped), []
    batches: list[tuple[object, set[Hypothesis]]] = []
    simulator.on_run = lambda runs: batches.append((events[-1], {h for h, _ in runs}))
    truth = parse("break:back_left_knee", quadruped.anatomy)
    recovery(quadruped, truth, simulator, events)
    repairs = [event for event in events if isinstance(event, SearchBegins) and event.hypothesis]

    assert {event.hypothesis for event in repairs} - {INTACT}
    searched = [(event, hypotheses) for event, hypotheses in batches if event in repairs]
    assert searched
    assert all(hypotheses == {event.hypothesis} for event, hypotheses in searched)


def test_another_seed_recovers_another_way(quadruped: Robot):
    truth = parse("jam:front_left_shoulder", quadruped.anatomy)
    simulator = Simulator(quadruped, 2)
    gaits = {
        recovery(quadruped, truth, simulator, [], seed=seed, trials=1).trials[0].plan.controller
        for seed in (1, 2)
    }

    assert len(gaits) == 2


def test_a_gait_that_is_given_changes_nothing_but_the_search_for_it(quadruped: Robot):
    truth = parse("jam:front_left_shoulder", quadruped.anatomy)
    evolved = recovery(quadruped, truth, Simulator(quadruped, 2), [], trials=1)
    gait = evolved.trials[0].plan.controller
    given = recovery(quadruped, truth, Simulator(quadruped, 2), [], trials=1, gait=gait)

    assert given.diagnosis == evolved.diagnosis
    assert [t.displacement for t in given.trials] == [t.displacement for t in evolved.trials]
    assert given.repair_evaluations < evolved.repair_evaluations


def recovery_in_files(
    robot: Robot, truth: Hypothesis, folder: Path, hidden: dict[Stage, str]
) -> tuple[Recovery, FolderJournal]:
    """A small recovery with logs, of which the algorithm reaches no more than it is given."""
    journal = create_journal(folder, robot.anatomy, calibrated=False)

    class SealedJournal:
        add = staticmethod(journal.add)

    outcome = RecoveryLoop(
        simulator=Simulator(robot, 2),
        choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
        run_trial=TrialRunner(journal.trials, robot, TINY, hidden).__call__,
        journal=SealedJournal(),
        settings=dataclasses.replace(TINY, trials=1),
        seed=1,
        on_event=lambda _: None,
        kinds=PAPER_KINDS,
    ).run(SimulatedRobot(robot), SimulatedRobot(robot, truth))
    return outcome, journal


def test_what_the_logs_hide_changes_no_diagnosis(quadruped: Robot, tmp_path: Path):
    truth = parse("break:back_left_knee", quadruped.anatomy)
    outcomes = [
        recovery_in_files(quadruped, truth, tmp_path / name, hidden)[0]
        for name, hidden in (("told", {"after": str(truth)}), ("not-told", {}))
    ]

    assert outcomes[0].diagnosis == outcomes[1].diagnosis
    assert read_truth(tmp_path / "told" / "trials" / "01-after.mcap") == str(truth)
    assert read_truth(tmp_path / "not-told" / "trials" / "01-after.mcap") is None


def test_each_trial_is_read_from_its_log_once_and_is_all_that_is_known(
    quadruped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    reads: Counter[str] = Counter()
    read_contents = reader.read_contents

    def counted(path: Path, unread: Collection[str]) -> Contents:
        reads[path.name] += 1
        return read_contents(path, unread)

    monkeypatch.setattr(reader, "read_contents", counted)
    truth = parse("break:back_left_knee", quadruped.anatomy)
    outcome, journal = recovery_in_files(quadruped, truth, tmp_path / "run", {})
    names = ["00-before.mcap", "01-after.mcap", "02-recovery.mcap"]

    assert reads == dict.fromkeys(names, 1)
    kept = journal.read()
    assert [trial.path for trial in kept.trials] == [trial.path for trial in outcome.trials]
    assert [trial.plan for trial in kept.trials] == [trial.plan for trial in outcome.trials]
    for trial, again in zip(outcome.trials, kept.trials, strict=True):
        for signal, rows in trial.behaviour.signals.items():
            assert rows.tobytes() == again.behaviour[signal].tobytes()
    assert kept.diagnoses[-1] == outcome.diagnosis
    assert len(kept.diagnoses) == 2


def test_the_way_to_choose_is_asked_before_each_trial_and_obeyed(quadruped: Robot):
    met: list[tuple[int, int, int, float]] = []
    given = random_controllers(quadruped, 3)

    def choose(loop: RecoveryLoop) -> Controller:
        known = loop.known
        now = loop.trials_left, len(known.diagnoses), len(known.evidence), loop.rng.random()
        met.append(now)
        return given[len(met) - 1]

    truth = parse("break:back_left_knee", quadruped.anatomy)
    events: list[Event] = []
    outcome = recovery(quadruped, truth, Simulator(quadruped, 2), events, next_trial=choose)

    assert [trial.plan.controller for trial in outcome.trials[2:]] == given
    assert [now[:3] for now in met] == [(3, 1, 1), (2, 2, 2), (1, 3, 3)]
    assert len({now[3] for now in met}) == 3
    assert not [e for e in events if isinstance(e, SearchBegins) and e.kind == "repair"][1:]


def test_a_comparator_that_refuses_the_healthy_trial_ends_the_recovery_before_the_failure(
    quadruped: Robot,
):
    events: list[object] = []

    def refuse(_robot: Robot, _trials: Sequence[Trial]) -> ChosenComparator:
        raise InputError("no position")

    with pytest.raises(InputError, match="no position"):
        RecoveryLoop(
            simulator=Simulator(quadruped, 1),
            choose_comparator=refuse,
            run_trial=in_memory(quadruped),
            journal=MemoryJournal(),
            settings=TINY,
            seed=1,
            on_event=events.append,
            calibrate=lambda _trials: pytest.fail("calibrated"),
            gait=random_controllers(quadruped, 1)[0],
        ).run(SimulatedRobot(quadruped), SimulatedRobot(quadruped))
    assert [event.plan.stage for event in events if isinstance(event, Trial)] == ["before"]
