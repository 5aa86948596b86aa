"""Tests of the verdict: intact, explained, ambiguous, unexplained, not judged.

There is no reality gap but where a test makes one, so an unexplained trial is due to the searched
hypotheses.
"""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np
import pytest

from selfmodel import plugins
from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.adequacy import MIN_SEGMENTED, is_too_high
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis, Fit
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.problem import Problem
from selfmodel.diagnosis.significance import FAULTY_RATIO, LOSS_RATIO, TEST
from selfmodel.diagnosis.text import summary, verdict_sentences
from selfmodel.diagnosis.verdict import (
    WINDOW,
    diagnosis_of,
    verdict_of,
)
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import KINDS, PAPER_KINDS
from selfmodel.physical.simulated import draw_gap
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trial import Trial
from tests.diagnosis.synthetic import problem_of
from tests.helpers.comparators import Prepared
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.memory import trial_of

SMALL = dataclasses.replace(Settings().scaled(6), generations=1, steps=150, genes=2)
CASES = ROBOTS["quadruped"].cases
GAIT = 4
"""Index of a random controller under which every failure below is detectable."""


DEAD = "motor:front_left_knee=0.0"

trial = partial(trial_of, steps=SMALL.steps)


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
    return [trial(quadruped, "intact", gait, stage="before")]


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


@pytest.mark.search
@pytest.mark.parametrize("case", [3, 9])
def test_a_failure_of_table_one_is_found_and_explained(
    quadruped: Robot, gait: Controller, before: list[Trial], case: int
):
    found = diagnosed(quadruped, [trial(quadruped, CASES[case], gait)], before)

    assert str(found.best) == CASES[case]
    assert found.verdict == ("explained" if found.best else "intact")
    assert found.indistinguishable == ()
    assert found.test == TEST
    assert found.change is None
    assert found.ranked[0].distance < 1e-9
    assert (found.intact_distance > 1e-4) == (case != 9)


@pytest.mark.search
def test_the_seed_of_the_search_does_not_change_the_verdict(
    quadruped: Robot, gait: Controller, before: list[Trial]
):
    search = DiagnosticSearch(
        Simulator(quadruped, 1), SEGMENT_PREDICTION, SMALL, PAPER_KINDS, healthy_trials=before
    )
    trials = [trial(quadruped, CASES[8], gait)]
    seeds = map(np.random.default_rng, range(10))
    first, *others = (search(trials, [], rng, lambda _: None) for rng in seeds)

    for one in others:
        assert dataclasses.replace(one, ranked=first.ranked, cost=first.cost) == first


@pytest.mark.search
def test_a_hidden_neuron_is_unexplained(quadruped: Robot, gait: Controller, before: list[Trial]):
    found = diagnosed(quadruped, [trial(quadruped, CASES[10], gait, steps=120)], before)

    assert found.verdict == "unexplained"


@pytest.mark.parametrize(
    ("gap", "order"), [(0.0, 1), pytest.param(0.05, -1, marks=pytest.mark.search)]
)
def test_logs_of_a_healthy_and_of_a_damaged_robot_contradict_each_other(
    quadruped: Robot, gait: Controller, gap: float, order: int
):
    walk = random_cpgs(quadruped, 1)[0] if gap else gait  # with it and no gap, a change is found
    real = draw_gap(quadruped, gap, np.random.default_rng(0)) if gap else None
    healthy, damaged = (
        trial(quadruped, truth, walk, name=name, gap=real)
        for truth, name in (("intact", "first"), (DEAD, "last"))
    )
    found = diagnosed(quadruped, [healthy, damaged][::order], kinds=(KINDS["motor"],))

    assert found.verdict == "not judged"
    what, action = summary(found)
    dead = parse(DEAD, quadruped.anatomy).words
    assert f"contradict each other: no fault shows in 'first'; in 'last', {dead}." in what
    assert "if the robot was healthy in 'first', name that with --healthy FILE" in action
    assert verdict_sentences(found).endswith("no hypothesis predicts all of them.")


def test_a_log_of_another_fault_is_not_called_healthy(quadruped: Robot):
    first, last = random_cpgs(quadruped, 2)[0], random_controllers(quadruped, 5)[4]
    winds = (("wind=-16", first, "first"), ("wind=16", last, "last"))
    trials = [trial(quadruped, text, driver, name=name) for text, driver, name in winds]
    found = diagnosed(quadruped, trials, kinds=(KINDS["wind"], KINDS["motor"]))

    assert found.verdict == "not judged"
    what, action = summary(found)
    assert "no fault" not in what
    assert "--healthy" not in action
    assert all(f"'{name}' alone" in action for name in ("first", "last"))


@pytest.mark.parametrize("gap", [0.0, pytest.param(0.05, marks=pytest.mark.search)])
def test_a_fault_that_one_of_two_gaits_hardly_shows_is_no_contradiction(
    quadruped: Robot, gait: Controller, gap: float
):
    real = draw_gap(quadruped, gap, np.random.default_rng(0)) if gap else None
    still = dataclasses.replace(gait, genome=0.05 * gait.genome)
    trials = [
        trial(quadruped, DEAD, driver, name=name, gap=real)
        for driver, name in ((still, "first"), (gait, "last"))
    ]
    found = diagnosed(quadruped, trials, kinds=(KINDS["motor"],))

    assert found.doubt is None
    assert str(found.best) == DEAD or gap


WHOLE = sorted(name for name in COMPARATORS if not name.startswith("segment-prediction"))


@pytest.mark.parametrize(
    ("name", "truth"),
    [(FORWARD_DISPLACEMENT.name, "intact"), *((name, "break:front_left_knee") for name in WHOLE)],
)
def test_whole_trials_that_no_hypothesis_reproduces_are_not_judged(
    quadruped: Robot, gait: Controller, name: str, truth: str
):
    gap = draw_gap(quadruped, 0.1, np.random.default_rng(0))
    healthy, damaged = (
        trial(quadruped, text, gait, steps=60, gap=gap) for text in ("intact", truth)
    )
    comparator, kinds = plugins.comparator(name), (KINDS["break"], KINDS["sensor"])
    found = diagnosed(quadruped, [damaged], [healthy], comparator=comparator, kinds=kinds)

    assert found.verdict == "not judged"
    assert found.probability == {}
    assert "segment-prediction" in summary(found)[1]
    assert "record trials" not in summary(found)[1]


def test_trials_that_are_too_short_for_segments_are_to_be_recorded_for_longer(
    quadruped: Robot, gait: Controller
):
    gap = draw_gap(quadruped, 0.1, np.random.default_rng(0))
    short = trial(quadruped, "intact", gait, steps=MIN_SEGMENTED - 1, gap=gap)
    found = diagnosed(
        quadruped, [short], comparator=COMPARATORS["sensor-series"], kinds=(KINDS["break"],)
    )

    assert f"record trials of {MIN_SEGMENTED} control steps or more" in summary(found)[1]
    with pytest.raises(InputError, match=f"needs {MIN_SEGMENTED} steps or more"):
        SEGMENT_PREDICTION.prepare(short)


@pytest.mark.parametrize("name", [one for one in WHOLE if one != "noisy-transfer"])
def test_whole_trials_that_a_hypothesis_reproduces_are_judged(
    quadruped: Robot, gait: Controller, name: str
):
    truth = parse("break:front_left_knee", quadruped.anatomy)
    damaged = trial(quadruped, str(truth), gait, steps=60)
    found = diagnosed(quadruped, [damaged], comparator=plugins.comparator(name), seeds=[truth])

    assert (found.best, found.doubt) == (truth, None)


class OfJams:
    """A comparator of which any joint that stands explains the trial."""

    name = "of-jams"

    def prepare(self, _trial: Trial) -> Prepared:
        """Prepares nothing of the trial."""
        return Prepared(
            ClosedLoop(record=("joint_positions",)),
            lambda run: 1.0 * (np.ptp(run["joint_positions"], axis=1).min(axis=1) > 1e-6),
        )


def test_hypotheses_that_no_trial_tells_apart_are_rivals(quadruped: Robot, gait: Controller):
    one, other = (
        parse(f"jam:{leg}_knee", quadruped.anatomy) for leg in ("back_left", "back_right")
    )
    truth = trial(quadruped, str(one), gait, steps=20)
    found = diagnosed(quadruped, [truth], comparator=OfJams(), seeds=[other, one])
    distances = {candidate.hypothesis: candidate.distance for candidate in found.ranked}

    assert found.verdict == "ambiguous"
    assert found.best not in found.indistinguishable
    assert found.indistinguishable
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
    assert is_too_high(Fit(loss, 9.0, 1.0, excess, 5.0, has_faults)) == unexplained


@pytest.mark.parametrize("joints", [{}, {"front_left_knee": 4.1}])
def test_a_robot_with_a_joint_that_moves_otherwise_is_not_intact(joints: dict[str, float]):
    fit = Fit(1.0, 1.0, 1.0, 0.0, 3.5, has_faults=False, joints=joints)

    assert verdict_of(INTACT, fit, [], None) == ("unexplained" if joints else "intact")


KNEE, SHOULDER = "front_left_knee", "back_right_shoulder"
LAME = f"motor:{KNEE}=0.2"
OF_ONE_SET = (
    (LAME, f"motor:{KNEE}=0.21", f"motor:{KNEE}=0.9"),
    (f"motor:{SHOULDER}=0.5", f"motor:{SHOULDER}=0.6", f"motor:{SHOULDER}=0.0"),
    (f"jam:{SHOULDER}", f"jam:{SHOULDER}=0.4"),
    (f"break:{SHOULDER}+{LAME}", f"break:{SHOULDER}+motor:{KNEE}=0.3"),
    ("intact",),
)
"""Hypotheses that differ in severities alone, or not at all; the first set is the truth's."""


def logged(robot: Robot, truth: str, path: str) -> Trial:
    """A trial of a damaged robot with the plan of an import, and a log of its own."""
    (gait,) = random_controllers(robot, 1)
    run = trial_of(robot, truth, gait, steps=200, name="imported")
    return dataclasses.replace(run, path=path)


def with_healthy(robot: Robot, *trials: Trial) -> Problem:
    """The problem of some trials, with a trial of the healthy robot."""
    healthy = logged(robot, "intact", "healthy.mcap")
    table = LossTable(Simulator(robot, 1), SEGMENT_PREDICTION)
    return problem_of(table, robot, trials, [healthy], PAPER_KINDS)


@pytest.fixture(scope="module")
def lame(quadruped: Robot) -> Problem:
    """The problem of one trial with a weak motor; its losses are kept from test to test."""
    return with_healthy(quadruped, logged(quadruped, LAME, "lame.mcap"))


def parsed(robot: Robot) -> list[list[Hypothesis]]:
    return [[parse(one, robot.anatomy) for one in some] for some in OF_ONE_SET]


def nearest(sets: Iterable[list[Hypothesis]], problem: Problem) -> set[Hypothesis]:
    """The hypothesis of each set with the smallest distance."""
    distances = partial(problem.table.distances, trials=problem.trials)
    return {some[int(np.argmin(distances(some)))] for some in sets}


@pytest.mark.parametrize("best", [None, LAME])
def test_the_ranking_has_each_set_of_faults_once_with_its_best_severities(
    quadruped: Robot, lame: Problem, best: str | None
):
    problem, sets = lame, parsed(quadruped)
    compared = [one for some in sets for one in some]
    found = diagnosis_of(problem, compared, best and parse(best, quadruped.anatomy))
    ranked = [candidate.hypothesis for candidate in found.ranked]

    assert str(found.best) == LAME
    assert len(ranked) == len(sets)
    assert set(ranked) == nearest(sets, problem)
    distances = [candidate.distance for candidate in found.ranked]
    assert distances == sorted(distances)


def test_the_verdict_does_not_depend_on_what_the_search_compared(quadruped: Robot, lame: Problem):
    best = parse(LAME, quadruped.anatomy)
    compared = ([best, INTACT], [INTACT, *(one for some in parsed(quadruped) for one in some)])

    first, second = (diagnosis_of(lame, some, best) for some in compared)

    assert first.ranked != second.ranked
    alike = dataclasses.replace(second, ranked=first.ranked)
    assert alike == first


def test_each_hypothesis_that_is_said_to_be_alike_has_a_probability(
    quadruped: Robot, lame: Problem, monkeypatch: pytest.MonkeyPatch
):
    levels = (parse(f"friction={level}", quadruped.anatomy) for level in (0.4, 0.5, 0.6))
    best, (one, other, far) = parse(LAME, quadruped.anatomy), levels
    # The one with the smallest loss need not have the smallest lead.
    leads = {one: 2.5, other: 1.5, far: 9.0, INTACT: math.inf}
    monkeypatch.setattr("selfmodel.diagnosis.verdict.leads_of", lambda *_: leads)
    found = diagnosis_of(lame, [best], best)

    assert found.indistinguishable == (one,)
    assert set(found.probability) == {LAME, str(one), "intact"}
    alone = dataclasses.replace(lame, healthy_trials=())
    assert diagnosis_of(alone, [best], best).probability == {}, "nothing tells what is right"


@pytest.mark.parametrize(("truth", "verdict"), [("intact", "not judged"), (LAME, "unexplained")])
def test_a_fault_that_few_pieces_show_takes_the_place_of_intact_and_of_nothing_else(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch, truth: str, verdict: str
):
    fault = parse(LAME, quadruped.anatomy)
    monkeypatch.setattr("selfmodel.diagnosis.verdict.passed_over", lambda *_: fault)
    problem = with_healthy(quadruped, logged(quadruped, truth, "monday.mcap"))
    found = diagnosis_of(problem, [INTACT, fault], INTACT)

    assert found.verdict == verdict
    if truth == "intact":
        assert found.indistinguishable == (fault,)
        assert found.probability == {}
        what, action = summary(found)
        assert f"perhaps {fault.words}" in what
        assert f"check whether {fault.words}" in action
        assert LAME in verdict_sentences(found)


def test_the_worst_time_of_an_unexplained_diagnosis_names_the_file_of_its_trial(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    # The alternatives to the best hypothesis cost most of the time.
    monkeypatch.setattr("selfmodel.diagnosis.verdict.unsearched_fault", lambda *_: None)
    for alternatives in ("indistinguishable", "undetectable", "detectable_severities"):
        monkeypatch.setattr(f"selfmodel.diagnosis.verdict.{alternatives}", lambda *_: [])
    names = {"monday.mcap": "intact", "tuesday.mcap": LAME}
    trials = [logged(quadruped, truth, path) for path, truth in names.items()]
    found = diagnosis_of(with_healthy(quadruped, *trials), [INTACT], INTACT)

    assert found.verdict == "unexplained"
    assert found.residual is not None
    assert found.residual.trial == "tuesday"
    signals = found.residual.signals
    assert 1 <= len(signals) <= 3
    assert list(signals.values()) == sorted(signals.values(), reverse=True)
    assert 0 < found.residual.end - found.residual.begin <= WINDOW * 0.13
