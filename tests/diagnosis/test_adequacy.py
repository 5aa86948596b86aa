"""A robot is accused only of what its healthy trials, or a refit of the self-model, exclude."""

import dataclasses
import re

import numpy as np
import pytest

from selfmodel import load_policy
from selfmodel.diagnosis.adequacy import (
    doubt_of,
    fit_of,
    refit_reason,
    share_left,
    sufficient_trials,
    supported,
)
from selfmodel.diagnosis.diagnosis import Fit
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.significance import LOSS_RATIO, is_better
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import model_with_parameters, nominal, with_model
from selfmodel.trials.trial import Trial, TrialPart
from tests.diagnosis.doubts import KNEE, WEAK, doubted, moved, problem_of, table_of, unlike

JAM, TOO = "jam:back_right_knee", "motor:back_left_shoulder=0.6"
DEAD = "sensor:front_right_touch"
BROKEN = f"break:{KNEE}"


@pytest.fixture(scope="module")
def real(quadruped: Robot) -> Robot:
    """The robot itself: other masses and damping than those of the self-model."""
    return unlike(quadruped)


@pytest.fixture(scope="module")
def weaker(quadruped: Robot) -> Robot:
    """The robot itself, with a weak motor."""
    return unlike(quadruped, 0.5)


@pytest.fixture(scope="module")
def healthy(real: Robot) -> list[Trial]:
    """Trials of the healthy robot with two gaits."""
    return [moved(real, "first"), moved(real, "second")]


@pytest.fixture(scope="module")
def covering(real: Robot, healthy: list[Trial]) -> list[Trial]:
    """The same, and faster ones."""
    return [*healthy, moved(real, "first", pace=3), moved(real, "second", pace=3)]


@pytest.fixture(scope="module")
def weak(real: Robot) -> Trial:
    """A trial of the robot with a weak motor in a third gait."""
    return moved(real, "third", truth=WEAK)


@pytest.fixture(scope="module")
def table(quadruped: Robot) -> LossTable:
    return table_of(quadruped)


def refused(*_: object) -> Robot:
    raise InputError("too short")


def test_what_a_refit_explains_without_a_fault_is_no_fault(
    table: LossTable, healthy: list[Trial], weak: Trial, weaker: Robot
):
    doubt = doubted(problem_of(table, weak, healthy, weaker), WEAK)

    assert doubt is not None
    assert WEAK in doubt.reason
    assert doubted(problem_of(table, weak, healthy), WEAK) is None


@pytest.mark.parametrize("is_long", [False, True])
@pytest.mark.parametrize(
    ("model", "robot", "truth", "best", "refit", "left"),
    [
        ("quadruped", "weaker", JAM, f"{JAM}+{WEAK}", "weaker", JAM),
        ("quadruped", "weaker", JAM, f"{JAM}+{WEAK}", "quadruped", f"{JAM}+{WEAK}"),
        ("real", "real", f"{JAM}+{WEAK}", f"{JAM}+{WEAK}", "weaker", f"{JAM}+{WEAK}"),
        ("quadruped", "weaker", f"{JAM}+{TOO}", f"{JAM}+{TOO}", "weaker", f"{JAM}+{TOO}"),
        ("quadruped", "weaker", JAM, f"{JAM}+{DEAD}", "weaker", f"{JAM}+{DEAD}"),
        ("quadruped", "weaker", "intact", WEAK, "weaker", WEAK),
    ],
    ids=["model error", "not in the fit", "fault", "and error", "sensor", "alone"],
)
def test_a_fault_beside_others_is_left_out_if_a_refit_explains_it(  # noqa: PLR0917  # of a case
    request: pytest.FixtureRequest,
    model: str,
    robot: str,
    truth: str,
    best: str,
    refit: str,
    left: str,
    *,
    is_long: bool,
):
    known, physical, fitted = map(request.getfixturevalue, (model, robot, refit))
    before = [moved(physical, gait) for gait in ("first", "second")]
    trials = [moved(physical, gait, truth=truth) for gait in ("first", "second")]
    table = table_of(known)

    hypothesis = parse(best, known.anatomy)

    problem, fits = problem_of(table, trials, before, fitted), []
    problem.is_long = is_long
    given = problem.refit
    problem.refit = lambda *each: fits.append(1) or given(*each)
    found, by_refit = supported(hypothesis, problem)

    assert str(found) == left
    assert len(fits) <= (1 if is_long and left == best else 2)  # a refit of a long trial is dear
    (losses,) = by_refit.losses([found])
    refitted = table_of(fitted).losses([found], trials)
    assert (losses == (refitted if left != best else table.losses([found], trials))).all()


@pytest.mark.search
def test_a_fault_is_left_out_by_what_the_refits_predict_with_it_and_without(
    quadruped: Robot, table: LossTable, weaker: Robot
):
    both = f"{JAM}+payload=0.2"
    before, trials = (
        [moved(weaker, gait, truth=truth) for gait in ("first", "second")]
        for truth in ("intact", both)
    )
    found = []
    for beside_both in (weaker, quadruped):
        problem = problem_of(table, trials, before)
        robots = {JAM: weaker, both: beside_both}
        problem.refit = lambda _, hypotheses, known=robots: known[str(hypotheses[-1])]
        found.append(str(supported(parse(both, quadruped.anatomy), problem)[0]))

    assert found == [both, JAM]


def test_one_healthy_gait_does_not_tell_how_well_another_is_predicted(
    table: LossTable, healthy: list[Trial], weak: Trial
):
    problem = problem_of(table, weak, healthy[:1])
    doubt = doubted(problem, WEAK, 1.5 * LOSS_RATIO)

    assert doubt is not None
    assert "one gait" in doubt.reason
    assert doubted(problem, WEAK, 1.5 * LOSS_RATIO**2) is None


@pytest.mark.parametrize(("faster", "doubts"), [(0.5, ["one gait"]), (1.0, [])])
def test_velocities_that_a_policy_is_asked_for_are_gaits_of_their_own(
    table: LossTable, healthy: list[Trial], weak: Trial, faster: float, doubts: list[str]
):
    names = iter(("slow", "other"))

    def asked_for(velocity: float) -> Trial:
        terms = [{"term": "gravity"}, {"term": "velocity"}]
        file = {"observation": terms, "velocity": [velocity, 0, 0]}
        driver = load_policy(file, "quadruped", lambda _: np.zeros(8))
        plan = dataclasses.replace(healthy[0].plan, controller=driver)
        return dataclasses.replace(healthy[0], plan=plan, path=f"{next(names)}.mcap")

    problem = problem_of(table, weak, [asked_for(0.5), asked_for(faster)])
    doubt = doubted(problem, WEAK, 1.5 * LOSS_RATIO)

    assert re.findall("one gait", doubt.reason if doubt else "") == doubts


@pytest.mark.parametrize(
    ("gait", "pace", "truth", "accused", "ratio", "reason"),
    [
        ("third", 1, WEAK, "motor:back_right_knee=0.9", 2.0, ".* explains less"),
        ("first", 2, "intact", "intact", 2.0, f".*{KNEE}"),
        ("first", 2, "intact", "intact", 2 * LOSS_RATIO, f".*{KNEE}"),
        ("first", 2, WEAK, WEAK, 2.0, f"the healthy trials do not cover {KNEE}"),
        ("first", 2, f"{BROKEN}+friction=0.3", BROKEN, 2.0, f".*{KNEE}"),
    ],
    ids=["leaves most", "faster", "faster and large", "joint", "limb"],
)
def test_what_leaves_most_of_the_loss_or_moves_faster_than_the_healthy_trials_is_doubted(  # noqa: PLR0917  # of a case
    table: LossTable,
    real: Robot,
    healthy: list[Trial],
    gait: str,
    pace: int,
    truth: str,
    accused: str,
    ratio: float,
    reason: str,
):
    doubt = doubted(
        problem_of(table, moved(real, gait, pace=pace, truth=truth), healthy), accused, ratio
    )

    assert doubt is not None
    assert re.match(reason, doubt.reason)
    assert (KNEE in doubt.remedy) == (pace > 1)


@pytest.mark.parametrize("accused", ["intact", WEAK])
def test_the_same_gait_as_that_of_a_healthy_trial_is_not_doubted(
    table: LossTable, real: Robot, healthy: list[Trial], accused: str
):
    same = moved(real, "first", truth=WEAK)

    assert doubted(problem_of(table, same, healthy, real), accused) is None


def test_a_loss_as_small_as_that_of_healthy_trials_has_to_beat_a_refit_in_any_gait(
    table: LossTable, real: Robot, healthy: list[Trial], weak: Trial, weaker: Robot
):
    same = moved(real, "first", truth=WEAK)
    harder = [*healthy, moved(real, "second", truth="motor:back_right_knee=0.5")]
    more = problem_of(table, weak, harder, weaker)
    more.trials = [*more.trials, TrialPart(same)]  # the accusation rests on the one of known gait
    for problem in (problem_of(table, same, harder, weaker), more):
        doubt = doubted(problem, WEAK, 9.0)
        assert doubt is not None
        assert "twice as long" in doubt.remedy, "the healthy trials have the gait"
    assert doubted(problem_of(table, same, harder), WEAK, 9.0) is None


def test_a_contrast_with_a_healthy_trial_of_the_same_movement_leaves_no_doubt(
    table: LossTable, real: Robot, healthy: list[Trial], weaker: Robot
):
    harder = [*healthy, moved(real, "second", truth="motor:back_right_knee=0.5")]
    problem = problem_of(table, moved(real, "first", truth=WEAK), harder, weaker)

    for z, is_doubted in ((4.9, True), (5.1, False)):
        problem.contrast = lambda _, z=z: z
        assert (doubted(problem, WEAK, 9.0) is not None) == is_doubted


@pytest.mark.parametrize("accused", ["intact", WEAK])
def test_a_loss_beyond_any_error_of_a_fitted_model_is_not_doubted(
    table: LossTable, covering: list[Trial], weak: Trial, weaker: Robot, accused: str
):
    problem = problem_of(table, weak, covering, weaker)

    small, large = (doubted(problem, accused, LOSS_RATIO * factor) for factor in (0.9, 1.5))

    assert small is not None
    assert large is None


def test_what_the_healthy_trials_do_not_exclude_was_there_before(table: LossTable, weaker: Robot):
    healthy = [moved(weaker, "first"), moved(weaker, "second")]
    doubt = doubted(problem_of(table, moved(weaker, "third"), healthy), WEAK)

    assert doubt is not None
    assert WEAK in doubt.reason


def test_the_motion_of_its_joint_excludes_a_fault_too(table: LossTable, quadruped: Robot):
    heavier = dataclasses.replace(nominal(quadruped), root_mass=1.3)
    robot = with_model(quadruped, model_with_parameters(quadruped, heavier), 0.0)
    weak = f"motor:{KNEE}=0.7"
    healthy = [moved(robot, "first"), moved(robot, "second")]
    problem = problem_of(table, moved(robot, "third", truth=weak), healthy, unlike(quadruped, 0.1))
    accused = parse(weak, problem.space.anatomy)

    assert not is_better(*table.losses([INTACT, accused], problem.healthy_trials))
    assert not refit_reason(accused, problem)


def test_a_self_model_that_is_given_as_it_is_makes_no_doubts(
    table: LossTable, healthy: list[Trial], weak: Trial, weaker: Robot
):
    problem = problem_of(table, weak, healthy, weaker)
    problem.refit = None

    assert doubted(problem, WEAK) is None


def test_no_refit_explains_a_dead_sensor(table: LossTable, real: Robot, healthy: list[Trial]):
    problem = problem_of(table, moved(real, "third", truth=DEAD), healthy, refit=real)
    dead, (trial,) = parse(DEAD, problem.space.anatomy), problem.trials
    ((by_fault,), (by_refit,)) = (
        table.losses([dead], [trial]),
        table_of(real).losses([INTACT], [trial]),
    )

    assert by_refit.mean() < by_fault.mean()  # the refit has the robot's motion
    assert doubted(problem, DEAD) is None
    assert doubted(problem, "sensor:back_right_touch") is not None


def test_the_refit_is_to_the_healthy_trials_and_those_to_explain(
    table: LossTable, healthy: list[Trial], weak: Trial, weaker: Robot
):
    fitted: list[Trial] = []
    problem = problem_of(table, weak, healthy, weaker)
    problem.refit = lambda every, _: fitted.extend(every) or weaker

    assert doubted(problem, WEAK) is not None
    assert [one.content for one in fitted] == [one.content for one in [*healthy, weak]]


def test_a_refit_that_spoils_the_healthy_trials_explains_nothing(
    table: LossTable, quadruped: Robot, real: Robot, healthy: list[Trial], weak: Trial
):
    exact = problem_of(table_of(real), weak, healthy)
    exact.refit = lambda *_: unlike(quadruped, 0.5)

    assert doubted(problem_of(table, weak, healthy, unlike(quadruped, 0.5)), WEAK) is not None
    assert doubted(exact, WEAK) is None


def test_trials_that_are_too_short_for_a_refit_are_not_judged(
    table: LossTable, healthy: list[Trial], weak: Trial
):
    problem = problem_of(table, weak, healthy)
    problem.refit = refused
    doubt = doubted(problem, WEAK)

    assert doubt is not None
    assert "too short" in doubt.reason


def test_another_gait_is_compared_with_the_healthy_trial_and_by_how_sensitive_it_is_beside_it(
    table: LossTable, real: Robot, healthy: list[Trial]
):
    third = moved(real, "third")
    losses = [table.losses([INTACT], [one]).mean() for one in healthy]
    ratios = [
        table.sensitivity([TrialPart(third)]) / table.sensitivity([TrialPart(one)])
        for one in healthy
    ]
    fit = fit_of(INTACT, problem_of(table, third, healthy))

    assert losses[0] != pytest.approx(losses[1], rel=0.1)
    assert max(ratios) > 1
    expected = max(loss * max(ratio, 1) for loss, ratio in zip(losses, ratios, strict=True))
    assert fit.healthy_loss == pytest.approx(expected)


def test_an_easier_gait_is_expected_to_be_predicted_as_badly_as_the_healthy_trials(
    table: LossTable, healthy: list[Trial], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(
        table, "sensitivity", lambda parts, *_: 1.0 + 9.0 * (parts[0].trial in healthy)
    )
    problem = problem_of(table, dataclasses.replace(healthy[0], path="easier"), healthy[1:])

    np.testing.assert_array_equal(problem.expected(INTACT), table.losses([INTACT], healthy[1:])[0])


def test_a_motion_with_faults_is_expected_to_be_as_sensitive_as_their_predictions(
    table: LossTable, healthy: list[Trial], weak: Trial, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(table, "sensitivity", lambda _, faults=INTACT: 2.0 + len(faults))
    problem, losses = problem_of(table, weak, healthy[:1]), table.losses([INTACT], healthy[:1])[0]

    faults = parse(WEAK, problem.space.anatomy)
    np.testing.assert_allclose(problem.expected(faults), 1.5 * losses)
    np.testing.assert_allclose(problem.expected(INTACT), losses)


def test_a_loss_that_is_expected_of_so_sensitive_a_gait_is_of_no_fault(
    table: LossTable, healthy: list[Trial], weak: Trial
):
    problem = problem_of(table, weak, healthy)
    worst = problem.hardest
    fit = Fit(4 * worst, 4 * worst, worst, None, 6.0, has_faults=False)

    assert doubt_of(INTACT, fit, problem) is None
    assert doubt_of(INTACT, dataclasses.replace(fit, healthy_loss=2 * worst), problem) is not None


def test_what_a_fault_leaves_is_beyond_the_healthy_trials_themselves(
    table: LossTable, healthy: list[Trial], weak: Trial
):
    problem = problem_of(table, weak, healthy)
    accused = parse(WEAK, problem.space.anatomy)
    shares = [
        share_left(
            accused, Fit(0.5, 1.0, times * problem.hardest, None, 6.0, has_faults=True), problem
        )
        for times in (1, 10)
    ]

    assert 0 < shares[0] == shares[1]


def test_the_known_gait_is_compared_with_all_healthy_trials(
    table: LossTable, real: Robot, healthy: list[Trial]
):
    fit = fit_of(INTACT, problem_of(table, moved(real, "first"), healthy))

    assert fit.healthy_loss == pytest.approx(table.losses([INTACT], healthy).mean())


def test_a_healthy_part_without_a_piece_is_no_reference(
    table: LossTable, weak: Trial, healthy: list[Trial]
):
    # A robot that fails between two trials.
    problem = problem_of(table, weak, [TrialPart(healthy[1], end=0.0), healthy[0]])

    (expected,) = table.losses([INTACT], healthy[:1])
    assert problem.hardest == expected.mean()
    np.testing.assert_array_equal(problem.reference, expected)


def test_each_fault_is_required_in_the_gait_of_a_healthy_trial(
    table: LossTable, real: Robot, healthy: list[Trial]
):
    same, more = moved(real, "first", truth=WEAK), f"{WEAK}+motor:back_right_knee=0.99"
    other = moved(real, "third")
    problem = problem_of(table, same, healthy)
    both = problem_of(table, other, healthy)
    both.trials = [*problem.trials, *both.trials]

    assert doubted(both, WEAK) is None
    assert doubted(both, more) is not None


def test_a_fault_that_explains_the_whole_loss_has_to_beat_a_refit_in_faster_motions_too(
    table: LossTable, real: Robot, healthy: list[Trial]
):
    problem = problem_of(table, moved(real, "first", pace=2, truth=BROKEN), healthy)

    assert doubted(problem, BROKEN) is None
    assert doubted(problem, BROKEN, 1.0) is not None  # no loss that a fault could explain
    problem = dataclasses.replace(problem, refit=refused)
    doubt = doubted(problem, BROKEN)
    assert doubt is not None
    assert "too short for a fit" in doubt.reason


def test_the_time_before_a_change_shows_its_gait_as_healthy(
    table: LossTable, real: Robot, healthy: list[Trial]
):
    trial = moved(real, "third", truth=WEAK)
    problem = problem_of(table, trial, healthy[:1])
    early, late = TrialPart(trial, end=2.0), TrialPart(trial, begin=2.0)
    later = problem.within(lambda _: [late], [early])

    assert later is not None
    assert sufficient_trials(INTACT, later) == later.trials
    assert not sufficient_trials(INTACT, problem)


def test_no_refit_is_made_where_the_gaits_decide(
    table: LossTable, healthy: list[Trial], weak: Trial
):
    def unexpected(*_: object) -> Robot:
        raise AssertionError("a refit takes seconds")

    problem = problem_of(table, weak, healthy[:1])
    problem.refit = unexpected

    assert doubted(problem, WEAK) is not None
