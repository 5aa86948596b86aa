"""Promises of the loop: the paper's order, what each step receives, no look at the truth."""

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import Generator

from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.playback import Playback
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.diagnosis.losses import LossTable
from selfmodel.errors import InputError
from selfmodel.evolution import Draw, Evolution, Generation
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import BROKEN, JAMMED
from selfmodel.faults.notation import parse
from selfmodel.logs import read_truth, reader
from selfmodel.logs.journal import TRIALS, add_diagnosis, make_run, read_diagnoses
from selfmodel.logs.log_file import Contents
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.progress import Progress
from selfmodel.recovery import recover as module
from selfmodel.recovery.candidates import CandidateController
from selfmodel.recovery.next_trial import discriminating_controller
from selfmodel.recovery.recover import RecoveryLoop, by_repair, diagnose_trials
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.result import (
    Event,
    Recovery,
    SearchBegins,
    SelfModelWarning,
    TrialScore,
)
from selfmodel.recovery.scores import Score
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.simulation.rollout import SimulationResult
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Sample, Trajectory
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import changed, gait, logged
from tests.helpers.memory import in_memory

TINY = dataclasses.replace(Settings().scaled(6), generations=2, steps=60, diagnostic_search="ea")
KINDS = (BROKEN, JAMMED)
TRUTH, ALIKE = "break:back_left_knee", "jam:front_left_knee"


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
    robot: Robot, *, simulator: Simulator | None = None, sealed: bool = True, **changes: object
) -> Recovery:
    """A small recovery from a failure, with the paper's repair."""
    parts = {
        "choose_comparator": comparator_choice(FORWARD_DISPLACEMENT),
        "run_trial": in_memory(robot),
        "store_diagnosis": lambda _diagnosis: None,
        "settings": TINY,
        "seed": 5,
        "on_event": lambda _event: None,
        "kinds": KINDS,
        "make_repair": RepairSearch,
    }
    truth = parse(changes.pop("truth", TRUTH), robot.anatomy)
    loop = RecoveryLoop(simulator=simulator or Simulator(robot, 2), **{**parts, **changes})
    physical = SimulatedRobot(robot), SimulatedRobot(robot, truth)
    return loop.run(*(map(Sealed, physical) if sealed else physical))


@pytest.fixture(scope="module")
def watched(quadruped: Robot) -> SimpleNamespace:
    """A recovery with its events, its simulations, its journal and the seeds of each search."""
    started: list[list[bytes]] = []

    class Spy(Evolution):
        def __init__(
            self, length: int, settings: Settings, rng: Generator, seeds: list, *, draw: Draw
        ) -> None:
            started.append([np.asarray(seed).tobytes() for seed in seeds])
            super().__init__(length, settings, rng, seeds, draw=draw)

    events: list[Event] = []
    simulator, diagnoses, seen = Simulator(quadruped, 2), [], Counter()
    batches: list[tuple[Event, set[Hypothesis]]] = []
    simulate = simulator.run

    def run(runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        seen.update((*run, steps) for run in runs)
        batches.append((events[-1], {fault for fault, _ in runs}))
        return simulate(runs, steps, record)

    simulator.run = run
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("selfmodel.recovery.repair.Evolution", Spy)
        patch.setattr("selfmodel.diagnosis.search.Evolution", Spy)
        kept = {"store_diagnosis": diagnoses.append, "on_event": events.append}
        outcome = recovery(quadruped, simulator=simulator, **kept)
    return SimpleNamespace(
        outcome=outcome,
        events=events,
        batches=batches,
        seen=seen,
        diagnoses=diagnoses,
        started=started,
    )


def test_a_recovery_follows_the_paper_and_simulates_nothing_twice(watched: SimpleNamespace):
    events, batches, outcome = watched.events, watched.batches, watched.outcome
    order = [
        event.kind if isinstance(event, SearchBegins) else type(event).__name__
        for event in events
        if not isinstance(event, Generation | Progress)
    ]

    first = ["repair", "Trial", "TrialScore", "Trial", "ChosenComparator"]
    once = ["diagnostic", "Diagnosis", "TrialScore"]
    assert order == [*first, *[*once, "repair", "Trial"] * 3, *once]
    told = [event for event in events if isinstance(event, TrialScore)]
    assert tuple(told) == outcome.scored, "no diagnosis changed a displacement"
    trials = outcome.trials
    assert [trial.plan.stage for trial in trials] == ["before", "after", *["recovery"] * 3]
    assert trials[0].plan.controller == trials[1].plan.controller
    begins = [event for event in events if isinstance(event, SearchBegins)]
    repairs = [event for event in begins if event.kind == "repair"]
    diagnoses = [event for event in events if isinstance(event, Diagnosis)]
    assert [diagnosis.trials for diagnosis in diagnoses] == [1, 2, 3, 4]
    assert outcome.tried == (INTACT, INTACT, *(diagnosis.best for diagnosis in diagnoses[:3]))
    assert [search.hypothesis for search in repairs] == [INTACT, *outcome.tried[2:]]
    assert outcome.repair_evaluations == outcome.diagnostic_evaluations == 4 * TINY.evaluations
    assert outcome.recovered == max(trial.displacement for trial in trials[2:])
    searched = [(event.hypothesis, faults) for event, faults in batches if event in repairs]
    assert all(faults == {hypothesis} for hypothesis, faults in searched)
    # Once for its fitness in a repair; a controller that was tried, once more for each trial that
    # a diagnosis compares it with; and intact, for the trial that shows how well it is predicted.
    runs = Counter(trial.plan.controller for trial in trials[1:])
    for (hypothesis, controller, _), times in watched.seen.items():
        healthy = (hypothesis, controller) == (INTACT, trials[0].plan.controller)
        assert times <= 1 + runs[controller] + healthy


def test_a_recovery_is_of_its_seed_at_any_number_of_threads_and_sees_nothing_hidden(
    quadruped: Robot,
):
    few = dataclasses.replace(TINY, trials=1)
    one = recovery(quadruped, simulator=Simulator(quadruped, 1), settings=few)
    gait = one.trials[0].plan.controller
    given = recovery(quadruped, settings=few, gait=gait)  # with two threads
    other = recovery(quadruped, settings=dataclasses.replace(few, generations=1), seed=6)

    assert given.diagnosis == one.diagnosis
    assert [t.displacement for t in given.trials] == [t.displacement for t in one.trials]
    assert other.trials[0].plan.controller != gait
    assert given.repair_evaluations < one.repair_evaluations, "a given gait saves its search"
    with pytest.raises(AssertionError, match="reached for _variant"):
        _ = Sealed(SimulatedRobot(quadruped))._variant


def test_every_search_starts_from_what_the_database_holds(
    quadruped: Robot, watched: SimpleNamespace
):
    started, trials = watched.started, watched.outcome.trials
    genomes = [trial.plan.controller.genome.tobytes() for trial in trials]
    space = HypothesisSpace(quadruped.anatomy, KINDS)
    encoded = [
        [space.encode(c.hypothesis, TINY.genes).tobytes() for c in diagnosis.ranked]
        for diagnosis in watched.diagnoses
    ]
    newest_first = [list(dict.fromkeys(reversed(genomes[:count]))) for count in (2, 3, 4)]

    assert started[0] == []
    assert started[1::2] == [[], *encoded[:3]]
    assert started[2::2] == newest_first


def test_the_logs_are_all_that_is_known_and_what_they_hide_changes_nothing(
    quadruped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    reads: Counter[str] = Counter()
    read_contents = reader.read_contents

    def counted(path: Path, unread: Collection[str] = ()) -> Contents:
        reads[path.name] += 1
        return read_contents(path, unread)

    monkeypatch.setattr(reader, "read_contents", counted)
    outcomes, folders = [], [tmp_path / "hidden", tmp_path / "bare"]
    for folder, hidden in zip(folders, ({"after": TRUTH}, {}), strict=True):
        make_run(folder, calibrated=False)
        run_trial = TrialRunner(folder / TRIALS, quadruped, TINY, hidden)
        few = dataclasses.replace(TINY, trials=1)
        given = {"run_trial": run_trial, "store_diagnosis": partial(add_diagnosis, folder)}
        outcomes.append(recovery(quadruped, settings=few, sealed=False, **given))

    assert reads == dict.fromkeys(("00-before.mcap", "01-after.mcap", "02-recovery.mcap"), 2)
    assert outcomes[0].diagnosis == outcomes[1].diagnosis
    logs = [folder / TRIALS / "01-after.mcap" for folder in folders]
    assert [read_truth(log) for log in logs] == [TRUTH, None]
    trials = [reader.read_log(trial.path).trial for trial in outcomes[0].trials]
    diagnoses = read_diagnoses(folders[0], HypothesisSpace(quadruped.anatomy, ()))
    assert diagnoses[-1] == outcomes[0].diagnosis
    assert len(diagnoses) == 2
    for trial, again in zip(outcomes[0].trials, trials, strict=True):
        assert (trial.path, trial.plan) == (again.path, again.plan)
        for signal, rows in trial.trajectory.signals.items():
            assert rows.tobytes() == again.trajectory[signal].tobytes()


def test_the_choice_of_the_next_trial_is_asked_before_each_and_obeyed(quadruped: Robot):
    asked: list[tuple[int, int, int, float]] = []
    given, events = random_controllers(quadruped, 3), []

    def choose(loop: RecoveryLoop) -> Controller:
        draw = loop.rng.random()
        asked.append((loop.trials_left, len(loop.diagnoses), len(loop.trials) - 1, draw))
        return given[len(asked) - 1]

    outcome = recovery(quadruped, on_event=events.append, next_trial=choose)

    assert [trial.plan.controller for trial in outcome.trials[2:]] == given
    assert [now[:3] for now in asked] == [(3, 1, 1), (2, 2, 2), (1, 3, 3)]
    assert len({now[3] for now in asked}) == 3
    assert len([e for e in events if isinstance(e, SearchBegins) and e.kind == "repair"]) == 1


def test_a_comparator_that_refuses_the_healthy_trial_ends_the_recovery_before_the_failure(
    quadruped: Robot,
):
    events: list[Event] = []

    def refuse(_robot: Robot, _trials: Sequence[Trial]) -> ChosenComparator:
        raise InputError("no position")

    with pytest.raises(InputError, match="no position"):
        recovery(
            quadruped,
            choose_comparator=refuse,
            on_event=events.append,
            calibrate=lambda _trials: pytest.fail("calibrated"),
            gait=random_controllers(quadruped, 1)[0],
        )
    assert [event.plan.stage for event in events if isinstance(event, Trial)] == ["before"]


class StubRepair:
    """A repair that returns the same candidates every time, and notes what it received."""

    evaluations, adapts_gait = 7, False
    scores = np.array([-9.0, -7.0])

    def __init__(self, candidates: Sequence[Controller]) -> None:
        self._candidates = candidates
        self.hypotheses: list[tuple[str, ...]] = []
        self.uncertainties: list[DomainDistribution] = []

    def __call__(
        self,
        hypotheses: Sequence[Hypothesis],
        uncertainty: Callable[[], DomainDistribution],
        *_rest: object,
    ) -> tuple[CandidateController, ...]:
        """Returns the candidates, with a fitness that is no score of one simulation."""
        self.hypotheses.append(tuple(map(str, hypotheses)))
        self.uncertainties.append(uncertainty())
        return tuple(CandidateController(one, self.scores) for one in self._candidates)


def test_controllers_that_were_evolved_at_a_finer_time_step_are_one_warning(quadruped: Robot):
    events: list[Event] = []

    class Flattered(StubRepair):
        scores = np.array([90.0, 70.0])

        def __call__(self, *given: object) -> tuple[CandidateController, ...]:
            found = super().__call__(*given)
            return tuple(dataclasses.replace(each, parts=4) for each in found)

    repair = Flattered(random_controllers(quadruped, 3))
    outcome = recovery(
        quadruped,
        settings=dataclasses.replace(TINY, trials=1),
        on_event=events.append,
        make_repair=lambda *_given: repair,
    )

    found = [text for text in outcome.warnings if "the self-model flatters" in text]
    assert ["intact" in text for text in found] == [True], "once, and not of the next repair"
    step = quadruped.model.opt.timestep / 4
    assert f"timestep={step:g}, or armature" in found[0]
    runs = [(INTACT, outcome.trials[0].plan.controller)]
    finer = Simulator(quadruped.finer(4), 1).run(runs, TINY.steps, ["base_position"]).trajectory
    assert (
        outcome.predicted[0] == finer["base_position"][0, -1, 0] - finer["base_position"][0, 0, 0]
    )
    assert {*found} <= {event.text for event in events if isinstance(event, SelfModelWarning)}
    assert found[0] in repr(outcome)
    assert outcome.to_dict()["warnings"] == list(outcome.warnings)


@pytest.fixture
def stubbed(quadruped: Robot, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A recovery with a stub repair and a stub diagnosis, and what each of them received."""
    repair = StubRepair(random_controllers(quadruped, 3))
    scored: list[str] = []
    weighted: list[tuple[int, str]] = []
    best, alike = (parse(text, quadruped.anatomy) for text in (TRUTH, ALIKE))

    class StubDiagnosis:
        evaluations = distinct_hypotheses = 0

        def __call__(self, *_rest: object) -> Diagnosis:
            ranked = (Candidate(best, 0.1), Candidate(alike, 0.1))
            return Diagnosis(ranked, 1, 1.0, (alike,), "ambiguous", "stub")

    class Posterior(module.Posterior):
        def after(self, trials: Sequence[Trial], hypothesis: Hypothesis) -> DomainDistribution:
            weighted.append((len(trials), str(hypothesis)))
            return super().after(trials, hypothesis)

    def score(_robot: Robot, hypothesis: Hypothesis, trajectory: Trajectory) -> np.ndarray:
        scored.append(str(hypothesis))
        return trajectory["base_position"][:, -1, 0]

    monkeypatch.setattr(module, "DiagnosticSearch", lambda *_rest, **_options: StubDiagnosis())
    monkeypatch.setattr(module, "Posterior", Posterior)
    outcome = recovery(
        quadruped,
        settings=dataclasses.replace(TINY, trials=2),
        score=Score("end", ("base_position",), score),
        make_repair=lambda *_given: repair,
    )
    return SimpleNamespace(recovery=outcome, repair=repair, weighted=weighted, scored=scored)


def test_a_repair_is_for_the_diagnosed_robot_and_its_candidates_are_tried_in_turn(
    stubbed: SimpleNamespace,
):
    assert stubbed.repair.hypotheses == [("intact",), (TRUTH, ALIKE), (TRUTH, ALIKE)]
    assert len(stubbed.repair.uncertainties[0].delays) > 1, "the first one is assumed"
    assert stubbed.weighted == [(2, TRUTH), (3, TRUTH)]
    controllers = [trial.plan.controller for trial in stubbed.recovery.trials]
    assert controllers[0] == controllers[1]
    assert len(set(controllers[1:])) == 3
    # Without a gap and with the right diagnosis, a prediction is exact.
    before, after, *later = stubbed.recovery.predicted
    assert [before, *later] == [one for k, one in enumerate(stubbed.recovery.scores) if k != 1]
    assert math.isnan(after)
    np.testing.assert_equal(stubbed.recovery.robust_means, (-8.0, math.nan, -8.0, -8.0))
    # A prediction and a score of each trial, each computed once; none was predicted of the second.
    assert stubbed.scored == ["intact", "intact", TRUTH, *[TRUTH, TRUTH] * 2]


@pytest.mark.parametrize(
    ("scores", "falls"),
    [
        ((3.0, 2.0), (5, 12)),
        ((2.0, 3.0), (None, 12)),  # upright, and not the largest score
        ((2.0, math.nan), (None, 12)),
        ((2.0, math.nan), (7, None)),
    ],
)
def test_the_best_trial_is_one_without_a_fall_unless_the_robot_fell_in_all(
    stubbed: SimpleNamespace, scores: tuple[float, float], falls: tuple[int | None, int | None]
):
    fell = falls[0] is not None
    best = max(scores) if fell else 2.0
    ends = zip(stubbed.recovery.scored, (9.0, 9.0, *scores), (None, None, *falls), strict=True)
    scored = [dataclasses.replace(one, value=value, fall=fall) for one, value, fall in ends]
    outcome = dataclasses.replace(stubbed.recovery, scored=tuple(scored))
    assert outcome.fell == fell
    assert outcome.best_score == best
    assert fell == (outcome.recovery is None), "a robot that fell is not recovered"
    assert outcome.recovered == outcome.trials[2 + scores.index(best)].displacement


@pytest.mark.search
@pytest.mark.parametrize(("kind", "next_trial"), [("network", "separates"), ("cpg", "repair")])
def test_a_recovery_has_one_design_though_a_fitted_model_is_rounded(
    monkeypatch: pytest.MonkeyPatch, quadruped: Robot, kind: str, next_trial: str
):
    # Command ranges of more digits than a model is written with.
    ranges = "-0.7853981633974483 0.7853981633974483", "-0.71234567891 0.6543210987"
    robot = dataclasses.replace(quadruped, mjcf=quadruped.mjcf.replace(*ranges))
    fitted = with_parameters(robot, dataclasses.replace(nominal(robot), friction=1.1))

    calibrated, refits = SimpleNamespace(robot=fitted, summary=None), []
    monkeypatch.setattr("selfmodel.recovery.recover.Refit", lambda *given: refits.append(given))

    def separating(loop: RecoveryLoop) -> Controller:
        rest = loop.simulator, loop.settings, loop.rng
        return discriminating_controller(loop.diagnoses[-1], loop.controllers, *rest)

    outcome = recovery(
        robot,
        settings=dataclasses.replace(TINY, trials=2),
        design=DESIGNS[kind](robot, None),
        calibrate=lambda _trials: calibrated,
        next_trial=by_repair if next_trial == "repair" else separating,
    )
    designs = {trial.plan.controller.design for trial in outcome.trials}

    assert designs == {DESIGNS[kind](robot, None)}
    assert designs != {DESIGNS[kind](with_parameters(robot, nominal(robot)), None)}
    ((*given, _),) = refits
    assert given == [robot, calibrated, 2], "of the robot before its calibration"


def trials_of(robot: Robot, count: int) -> list[Trial]:
    """Trials of a damaged robot, each with another controller."""
    run, damaged = in_memory(robot), SimulatedRobot(robot, parse(TRUTH, robot.anatomy))
    drivers = random_controllers(robot, count, seed=2)
    plans = [TrialPlan(str(k), "single", one, TINY.steps, 0) for k, one in enumerate(drivers)]
    return [run(damaged, plan) for plan in plans]


def test_logged_trials_are_diagnosed_in_turn_and_each_diagnosis_seeds_the_next(quadruped: Robot):
    trials, events = trials_of(quadruped, 3), []

    def search(threads: int) -> DiagnosticSearch:
        return DiagnosticSearch(
            Simulator(quadruped, threads), FORWARD_DISPLACEMENT, TINY, (BROKEN, JAMMED)
        )

    last = diagnose_trials(trials, search(2), 4, events.append)
    diagnoses = [event for event in events if isinstance(event, Diagnosis)]
    begins = [event.kind for event in events if isinstance(event, SearchBegins)]

    assert begins == ["diagnostic"] * 3
    assert [diagnosis.trials for diagnosis in diagnoses] == [1, 2, 3]
    assert diagnoses[-1] == last
    assert diagnose_trials(trials[:2], search(1), 4, lambda _: None) == diagnoses[1]


def test_a_trial_that_other_software_drove_is_explained_by_its_commands(quadruped: Robot):
    (trial,) = trials_of(quadruped, 1)
    playback = Playback(quadruped.anatomy.motors, trial.trajectory["commands"])
    plan = dataclasses.replace(trial.plan, controller=playback)
    search = DiagnosticSearch(Simulator(quadruped, 2), FORWARD_DISPLACEMENT, TINY, KINDS)
    hypotheses = [parse(text, quadruped.anatomy) for text in (TRUTH, "intact")]
    exact, other = search.losses.distances(hypotheses, [dataclasses.replace(trial, plan=plan)])

    assert exact == 0 < other


def test_a_surrogate_that_cannot_judge_a_trial_is_replaced_by_the_comparator(quadruped: Robot):
    run = gait()
    # Seen at four of the moments that are looked at closely, none of which the screen looks at.
    seen = np.zeros(run.steps, dtype=bool)
    starts = np.linspace(0, run.steps - 1 - SEGMENT_PREDICTION.horizon, 80).round().astype(int)
    seen[starts[[1, 2, 4, 5]]] = True
    angles = np.where(seen[:, np.newaxis], run["joint_positions"], np.nan)
    trial = logged(changed(run, joint_positions=angles))
    evidence = LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION)
    whole = logged(run)

    assert evidence.surrogate([whole])[0] is not evidence
    assert evidence.surrogate([trial])[0] is evidence


def test_a_limit_too_small_for_one_hypothesis_is_refused_before_the_first_trial(quadruped: Robot):
    def run_trial(*_: object) -> Trial:
        raise AssertionError("a trial was run")

    few = dataclasses.replace(TINY, max_simulated_steps=TINY.steps + 1)
    choose = comparator_choice("noisy-transfer")
    with pytest.raises(InputError, match="as noisy-transfer simulates for one hypothesis"):
        recovery(quadruped, settings=few, choose_comparator=choose, run_trial=run_trial)
