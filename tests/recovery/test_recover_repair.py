"""Promises of the loop about its repair: what it receives, and what becomes of its candidates."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery import recover as module
from selfmodel.recovery.next_trial import discriminating_controller
from selfmodel.recovery.recover import RecoveryLoop, by_repair
from selfmodel.recovery.repair import CandidateController, RepairSearch
from selfmodel.recovery.result import Recovery
from selfmodel.recovery.scores import Score
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.domain import DomainDistribution
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import MemoryJournal, in_memory

BEST, ALIKE = "jam:front_left_knee", "break:front_left_knee"


class StubRepair:
    """A repair that returns the same candidates every time, and notes what it received."""

    evaluations = 7

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
        """Returns the candidates; each prediction is the number of the call."""
        self.hypotheses.append(tuple(map(str, hypotheses)))
        self.uncertainties.append(uncertainty())
        predicted = np.array([float(len(self.hypotheses))])
        return tuple(CandidateController(one, predicted) for one in self._candidates)


@pytest.fixture
def found(quadruped: Robot, monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """A recovery with a stub repair and a stub diagnosis, and what each of them received."""
    stub = StubRepair(random_controllers(quadruped, 3))
    judged: list[Hypothesis] = []
    asked: list[tuple[int, str]] = []
    best, alike = (parse(text, quadruped.anatomy) for text in (BEST, ALIKE))

    class StubDiagnosis:
        evaluations = distinct_hypotheses = 0

        def __call__(self, *_rest: object) -> Diagnosis:
            ranked = (Candidate(best, 0.1), Candidate(alike, 0.1))
            return Diagnosis(ranked, 1, 1.0, (alike,), "ambiguous", "stub")

    class Watched(module.Posterior):
        def after(self, trials: Sequence[Trial], hypothesis: Hypothesis) -> DomainDistribution:
            asked.append((len(trials), str(hypothesis)))
            return super().after(trials, hypothesis)

    def judge(_robot: Robot, hypothesis: Hypothesis, behaviour: Behaviour) -> np.ndarray:
        judged.append(hypothesis)
        return behaviour["base_position"][:, -1, 0]

    monkeypatch.setattr(module, "DiagnosticSearch", lambda *_rest, **_options: StubDiagnosis())
    monkeypatch.setattr(module, "Posterior", Watched)
    recovery = RecoveryLoop(
        simulator=Simulator(quadruped, 1),
        choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
        run_trial=in_memory(quadruped),
        journal=MemoryJournal(),
        settings=dataclasses.replace(Settings().scaled(4), generations=1, steps=40, trials=2),
        seed=0,
        on_event=lambda _event: None,
        score=Score("end", ("base_position",), judge),
        make_repair=lambda *_given: stub,
    ).run(SimulatedRobot(quadruped), SimulatedRobot(quadruped, best))
    return {"recovery": recovery, "repair": stub, "asked": asked, "judged": judged}


def test_a_repair_is_for_the_best_hypothesis_and_those_like_it(found: dict):
    assert found["repair"].hypotheses == [("intact",), (BEST, ALIKE), (BEST, ALIKE)]


def test_the_uncertainty_is_assumed_first_and_then_that_after_all_trials(found: dict):
    assumed, *_ = found["repair"].uncertainties
    assert len(assumed.delays) > 1
    assert found["asked"] == [(2, BEST), (3, BEST)]


def test_no_controller_is_tried_twice_while_a_candidate_is_untried(found: dict):
    controllers = [trial.plan.controller for trial in found["recovery"].trials]
    assert controllers[0] == controllers[1]
    assert len(set(controllers[1:])) == 3


def test_each_trial_keeps_the_prediction_with_which_it_was_chosen(found: dict):
    before, after, *later = found["recovery"].predicted
    assert (before, later) == (1.0, [2.0, 3.0])
    assert math.isnan(after)


def test_a_trial_is_judged_under_the_faults_of_its_time(found: dict):
    assert list(map(str, found["judged"])) == ["intact", *[BEST] * 3]
    assert found["judged"][0] == INTACT


@pytest.mark.parametrize(("scores", "fell"), [((0.0, 2.0), True), ((2.0, 0.0), False)])
def test_a_recovery_fell_if_the_robot_fell_in_its_best_trial(
    found: dict, scores: tuple[float, float], *, fell: bool
):
    recovery = dataclasses.replace(
        found["recovery"], scores=(9.0, 9.0, *scores), falls=(None, None, None, 12)
    )
    assert recovery.fell == fell
    best = recovery.trials[2 + scores.index(max(scores))]
    assert recovery.recovered == best.displacement


FEW = dataclasses.replace(Settings(generations=2, steps=60, trials=2).scaled(8), kept=4)


def evolved(robot: Robot, kind: str, next_trial: str = "repair") -> Recovery:
    """A small recovery whose self-model was fitted, and written with fewer digits by that."""
    fitted = with_parameters(robot, dataclasses.replace(nominal(robot), friction=1.1))

    def choose(loop: RecoveryLoop) -> Controller:
        if next_trial == "repair":
            return by_repair(loop)
        known = loop.known
        rest = (loop.simulator, loop.settings, loop.rng)
        return discriminating_controller(known.diagnoses[-1], known.controllers, *rest)

    return RecoveryLoop(
        simulator=Simulator(robot, 1),
        choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
        run_trial=in_memory(robot),
        journal=MemoryJournal(),
        settings=FEW,
        seed=0,
        on_event=lambda _event: None,
        design=DESIGNS[kind](robot, None),
        calibrate=lambda _trials: SimpleNamespace(robot=fitted, summary=None),
        next_trial=choose,
        make_repair=RepairSearch,
    ).run(
        SimulatedRobot(robot), SimulatedRobot(robot, parse("break:back_left_knee", robot.anatomy))
    )


@pytest.fixture(scope="module")
def asymmetric(quadruped: Robot) -> Robot:
    """The quadruped, with command ranges of more digits than a model is written with."""
    ours = "-0.7853981633974483 0.7853981633974483"
    mjcf = quadruped.mjcf.replace(ours, "-0.71234567891 0.6543210987")
    return dataclasses.replace(quadruped, mjcf=mjcf)


@pytest.mark.search
@pytest.mark.parametrize("kind", ["network", "cpg"])
@pytest.mark.parametrize("next_trial", ["repair", "disagreement"])
def test_a_recovery_has_one_design_though_a_fitted_model_is_rounded(
    asymmetric: Robot, kind: str, next_trial: str
):
    trials = evolved(asymmetric, kind, next_trial).trials
    designs = {trial.plan.controller.design for trial in trials}

    assert designs == {DESIGNS[kind](asymmetric, None)}
    assert designs != {DESIGNS[kind](with_parameters(asymmetric, nominal(asymmetric)), None)}
