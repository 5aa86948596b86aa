"""The diagnostic search: rank of the truth, of diverged models and of ties, and refusals."""

import dataclasses
from functools import partial

import numpy as np
import pytest

from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.diagnosis import verdict
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import diagnosis_from_dict
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.text import verdict_sentences
from selfmodel.errors import InputError
from selfmodel.faults.joints import BROKEN
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import DEFAULT_KINDS, PAPER_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.requests import ClosedLoop
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.helpers.comparators import Prepared
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.hostile import unstable, with_value
from tests.helpers.memory import trial_of
from tests.helpers.robots.arms import arm
from tests.logs.conftest import MJCF

SMALL = dataclasses.replace(Settings().scaled(6), generations=2, genes=2)


logged = partial(trial_of, steps=60)


@pytest.mark.parametrize(
    "truth", ["break:front_left_knee", pytest.param("intact", marks=pytest.mark.search)]
)
def test_the_truth_is_at_distance_zero_and_ranks_first(quadruped: Robot, truth: str):
    trials = [logged(quadruped, truth, c) for c in random_controllers(quadruped, 2)]
    diagnose = DiagnosticSearch(Simulator(quadruped, 2), FORWARD_DISPLACEMENT, SMALL, PAPER_KINDS)
    seeds = [parse(truth, quadruped.anatomy), parse("jam:front_right_knee", quadruped.anatomy)]
    diagnosis = diagnose(trials, seeds, np.random.default_rng(0), lambda _: None)

    assert str(diagnosis.best) == truth
    assert diagnosis.ranked[0].distance == 0
    distances = [candidate.distance for candidate in diagnosis.ranked]
    assert len(distances) > 1
    assert distances == sorted(distances)


@pytest.mark.parametrize("truth", ["leg:front_left=locked0.2/-0.3", "break:front_left_shoulder"])
def test_a_leg_that_stands_is_locked_or_lost_by_the_loss_and_needs_no_evolution(
    quadruped: Robot, truth: str
):
    (controller,) = random_cpgs(quadruped, 1)
    trials = [logged(quadruped, truth, controller)]
    diagnose = DiagnosticSearch(Simulator(quadruped, 2), SEGMENT_PREDICTION, SMALL, DEFAULT_KINDS)
    diagnosis = diagnose(trials, [], np.random.default_rng(0), lambda _: None)

    assert (str(diagnosis.best), diagnosis.verdict) == (truth, "explained")
    assert diagnose.evaluations == 0


class Indifferent:
    """A comparator to which every hypothesis is as good as any other."""

    name = "indifferent"

    def prepare(self, _trial: Trial) -> Prepared:
        """Prepares nothing of the trial."""
        return Prepared(
            ClosedLoop(record=("base_position",)),
            lambda simulated: np.zeros(len(simulated["base_position"])),
        )


def test_of_hypotheses_that_explain_as_well_the_one_with_fewer_faults_ranks_first(quadruped: Robot):
    (controller,) = random_controllers(quadruped, 1)
    trial = logged(quadruped, "break:front_left_knee", controller)
    diagnose = DiagnosticSearch(Simulator(quadruped, 2), Indifferent(), SMALL, PAPER_KINDS)
    ranked = diagnose([trial], [], np.random.default_rng(0), lambda _: None).ranked
    faults = [len(candidate.hypothesis) for candidate in ranked]

    assert faults == sorted(faults)
    assert faults[0] < faults[-1]


@pytest.mark.parametrize(
    ("comparator", "healthy"), [(FORWARD_DISPLACEMENT, False), (SEGMENT_PREDICTION, True)]
)
def test_what_no_simulation_survives_is_unexplained_and_says_why(
    quadruped: Robot, comparator: Comparator, *, healthy: bool
):
    (controller,) = random_controllers(quadruped, 1)
    trial = logged(quadruped, "intact", controller)
    simulator = Simulator(unstable(quadruped), 2)
    few = dataclasses.replace(Settings().scaled(4), generations=1)
    diagnose = DiagnosticSearch(
        simulator, comparator, few, (BROKEN,), healthy_trials=[trial] if healthy else []
    )
    found = diagnose([trial], [], np.random.default_rng(0), lambda _: None)

    assert simulator.stats.diverged == simulator.stats.runs
    assert found.verdict == "unexplained"
    assert "no simulation of the trials remained finite: check the model" in found.reason
    assert trial.path in found.reason
    assert not found.indistinguishable
    assert found.unsearched is None
    assert found.to_dict()["reason"] == found.reason
    again = diagnosis_from_dict(found.to_dict(), lambda text: parse(text, quadruped.anatomy))
    assert again == found
    assert verdict_sentences(found) == f"Unexplained: {found.reason}."


@pytest.mark.parametrize("name", sorted(COMPARATORS))
def test_an_absurd_number_is_refused_without_a_warning_of_numpy(quadruped: Robot, name: str):
    (controller,) = random_controllers(quadruped, 1)
    trial = logged(quadruped, "intact", controller)
    for signal in ("base_position", "joint_positions", "sensors"):
        trial = with_value(trial, signal, 7, 1, 1e300)
    evidence = LossTable(Simulator(quadruped, 1), COMPARATORS[name])

    with pytest.raises(InputError, match=r"is 1e\+300 at step 7, expected at"):
        evidence.is_piecewise([trial])


def test_what_a_refit_explains_is_left_out_before_the_verdict(monkeypatch: pytest.MonkeyPatch):
    robot = Robot("biped", MJCF, 0.01)
    (controller,) = random_cpgs(robot, 1, 6)
    trials = [logged(robot, one, controller) for one in ("intact", "jam:left_hip+jam:right_hip")]
    one = parse("jam:left_hip", robot.anatomy)
    monkeypatch.setattr(
        *(verdict, "supported"), lambda best, problem: (one if len(best) > 1 else best, problem)
    )
    search = DiagnosticSearch(
        Simulator(robot, 1),
        SEGMENT_PREDICTION,
        dataclasses.replace(Settings().scaled(4), generations=1),
        healthy_trials=trials[:1],
    )

    found = search(trials[1:], [], np.random.default_rng(0), lambda _: None)

    assert found.best == one
    assert one in [candidate.hypothesis for candidate in found.ranked]


@pytest.mark.parametrize(
    ("base", "kinds", "beside", "is_searched"),
    [
        ("floating", DEFAULT_KINDS, "", True),
        ("floating", DEFAULT_KINDS, "jam:left_hip", False),  # as many faults as genes
        ("floating", PAPER_KINDS, "", False),
        pytest.param("fixed", DEFAULT_KINDS, "", False, marks=pytest.mark.search),
    ],
)
def test_a_kind_that_is_named_as_better_is_searched_too_among_the_default_kinds_on_a_floating_base(
    base: str, kinds: tuple[FaultKind, ...], beside: str, *, is_searched: bool
):
    robot, seed, steps = (
        (Robot("biped", MJCF, 0.01), 6, 100) if base == "floating" else (arm(), 1, 80)
    )
    (controller,) = random_cpgs(robot, 1, seed)
    faults = "+".join(filter(None, (beside, "delay=2.8")))
    before, after = (logged(robot, one, controller, steps=steps) for one in ("intact", faults))
    diagnose = DiagnosticSearch(
        Simulator(robot, 1),
        SEGMENT_PREDICTION,
        dataclasses.replace(Settings().scaled(4), generations=1, genes=1 if beside else 4),
        kinds,
        healthy_trials=[before],
    )
    found = diagnose([after], [], np.random.default_rng(0), lambda _: None)

    if is_searched:
        assert (str(found.best), found.verdict) == ("delay=2.8", "explained")
        assert (found.unsearched, found.also_searched) == (None, ("delay",))
        assert (
            "Searched beyond the kinds asked for, to predict the trials better: delay."
            in verdict_sentences(found)
        )
        seeds = [candidate.hypothesis for candidate in found.ranked]
        again = diagnose([after], seeds, np.random.default_rng(1), lambda _: None)
        assert (again.best, again.also_searched) == (found.best, ("delay",))
    else:
        assert found.verdict == "unexplained"
        assert str(found.best) == (beside or "intact")
        assert found.unsearched is not None
        assert (found.unsearched.kind, found.also_searched) == ("delay", ())
