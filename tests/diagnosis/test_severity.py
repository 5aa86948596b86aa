"""Tests of fitted severities: between the levels, never worse, without nominal severities."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from selfmodel.diagnosis.problem import LossFunction as Losses
from selfmodel.diagnosis.search import LocalSearch
from selfmodel.diagnosis.severity import with_fitted_severities, with_mean_severities
from selfmodel.faults import FRICTION, WIND, FaultKind
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import COARSE_LEVELS, HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import KINDS, PAPER_KINDS
from tests.diagnosis.synthetic import Synthetic
from tests.diagnosis.test_search import ANATOMY, FAULTS, PIECES, SPACE, find

WEAK_MOTOR = KINDS["motor"]


def bowl(truth: Mapping[str, float], floor: float = 0.01) -> Losses:
    """Losses that grow with the distance to true severities of a motor and of the ground.

    Args:
        truth: True severity by term.
        floor: Loss at the truth.
    """
    ripple = np.linspace(0.9, 1.1, PIECES)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = []
        for hypothesis in hypotheses:
            said_ = {f"{f.kind.name} {f.part}": f.severity for f in hypothesis.faults}
            off = sum(
                (said_.get(term, 1.0) - truth.get(term, 1.0)) ** 2 for term in {*said_, *truth}
            )
            rows.append((floor + off) * ripple)
        return np.array(rows)

    return losses


def space_of(*kinds: FaultKind) -> HypothesisSpace:
    return HypothesisSpace(ANATOMY, kinds)


DEGREES = space_of(WEAK_MOTOR, FRICTION).coarse_candidates
BOTH = {"motor front_left_knee": 0.37, "friction ": 0.62}


def test_degrees_are_found_between_those_that_are_proposed():
    found = find(bowl(BOTH, floor=1e-4), faults=DEGREES, most=2)
    severities = {f"{fault.kind.name} {fault.part}": fault.severity for fault in found.faults}

    assert severities == pytest.approx(BOTH, abs=0.02)
    assert not set(severities.values()) & {fault.severity for fault in DEGREES}


def test_every_part_is_proposed_at_few_degrees_of_the_whole_range():
    proposed = {fault.severity for fault in DEGREES if fault.part == "front_left_knee"}
    levels = WEAK_MOTOR.levels_at(ANATOMY, "front_left_knee")

    assert len(proposed) <= COARSE_LEVELS
    assert {min(levels), max(levels)} <= proposed <= set(levels)
    assert space_of(*PAPER_KINDS).coarse_candidates == FAULTS


def test_a_fit_of_degrees_never_makes_it_worse_and_a_degree_that_is_nothing_goes():
    losses = bowl({"friction ": 0.62})
    useless = Hypothesis(
        (Fault(FRICTION, ENVIRONMENT, 0.9), Fault(WEAK_MOTOR, "back_left_knee", 0.9))
    )
    fitted = with_fitted_severities(useless, losses, SPACE)

    assert losses([fitted]).sum() < losses([useless]).sum()
    assert find(losses, useless, faults=DEGREES) == find(losses, faults=DEGREES)
    assert [fault.kind for fault in find(losses, useless, faults=DEGREES).faults] == [FRICTION]


def rugged(truth: float, noise: float, lucky: float) -> Losses:
    """Losses of frictions: a bowl with noise per severity, and one lucky severity.

    Args:
        truth: Position of the minimum.
        noise: Standard deviation of the noise per segment and severity.
        lucky: A severity with a lower loss than the truth.
    """

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = []
        for hypothesis in hypotheses:
            severity = hypothesis.faults[0].severity if hypothesis.faults else 1.5
            rng = np.random.default_rng(round(severity * 1e4))
            ripple = rng.normal(size=PIECES)
            ripple -= ripple.mean()
            luck = 1.0 if severity == lucky else 0.0
            rows.append(5 + (severity - truth) ** 2 - luck * LUCK + noise * ripple)
        return np.array(rows)

    return losses


LUCK = 0.03


def friction(severity: float) -> Hypothesis:
    return Hypothesis((Fault(FRICTION, ENVIRONMENT, severity),))


def degree_of(hypothesis: Hypothesis) -> float:
    (fault,) = hypothesis.faults
    return fault.severity


def test_a_lucky_degree_does_not_win_where_its_neighbours_cannot_be_told_from_it():
    losses = rugged(truth=0.4, noise=0.3, lucky=0.32)
    fitted = with_fitted_severities(friction(0.6), losses, SPACE)
    mean = with_mean_severities(fitted, losses, SPACE)

    assert degree_of(fitted) == 0.32
    assert degree_of(mean) == pytest.approx(0.4, abs=0.04)


def test_a_degree_that_is_told_from_its_neighbours_stays():
    losses = rugged(truth=0.4, noise=1e-6, lucky=0.4)

    assert with_mean_severities(friction(0.4), losses, SPACE) == friction(0.4)


def valleys(*bottoms: float, noise: float, pieces: int = PIECES) -> Losses:
    """Losses of frictions with several minima and noise per severity."""

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = []
        for hypothesis in hypotheses:
            severity = degree_of(hypothesis)
            ripple = np.random.default_rng(round(severity * 1e4)).normal(size=pieces)
            depth = min(abs(severity - bottom) for bottom in bottoms)
            rows.append(2 + depth + noise * (ripple - ripple.mean()))
        return np.array(rows)

    return losses


def test_a_mean_is_not_taken_across_what_predicts_worse():
    mean = with_mean_severities(friction(0.2), valleys(0.2, 1.2, noise=0.2), SPACE)

    assert degree_of(mean) == pytest.approx(0.2, abs=0.05)


def test_without_pieces_to_compare_the_best_degree_stays():
    losses = valleys(0.4, noise=0.0, pieces=1)

    assert with_mean_severities(friction(0.4), losses, SPACE) == friction(0.4)


def test_where_nothing_can_be_told_the_mean_is_that_of_all_degrees():
    means = [
        degree_of(
            with_mean_severities(friction(start), lambda asked: np.ones((len(asked), 9)), SPACE)
        )
        for start in (0.2, 0.5, 0.9)
    ]
    levels = FRICTION.levels_at(ANATOMY, ENVIRONMENT)

    assert means == pytest.approx([(levels[0] + levels[-1]) / 2] * 3, abs=1e-3)


def test_classes_of_what_reshapes_the_model_have_no_mean():
    rough = Hypothesis((Fault(KINDS["roughness"], ENVIRONMENT, 0.02),))
    flat = with_mean_severities(rough, lambda asked: np.ones((len(asked), PIECES)), SPACE)

    assert flat == rough


def test_a_degree_that_is_not_needed_becomes_the_fault_without_one():
    """A gain close to 0 is indistinguishable from a failed sensor."""
    dead, faint = (parse(f"sensor:front_left_touch{of}", ANATOMY) for of in ("", "=gain0.1"))
    gains = space_of(KINDS["sensor-gain"])
    ripple = np.linspace(0.95, 1.05, PIECES)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        known = {dead: 0.1 * ripple, faint: 0.1 * ripple[::-1] - 0.0003}
        return np.array([known.get(one, 1 + ripple) for one in hypotheses])

    assert LocalSearch(Synthetic(gains, losses, most=1)).refined([faint]) == dead


def test_a_mean_that_no_longer_needs_the_fault_leaves_the_best_degree_as_it_is():
    """One wind is better than none, and no other wind is significantly worse than that wind."""
    rng = np.random.default_rng(0)
    noise = rng.normal(size=PIECES)
    noise -= noise.mean()

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = {"intact": np.full(PIECES, 1.0), "wind=8.0": np.linspace(0.85, 0.95, PIECES)}
        return np.array([rows.get(str(one), 1.0 + noise) for one in hypotheses])

    winds = space_of(WIND)
    wind = parse("wind=8", ANATOMY)
    mean = with_mean_severities(wind, losses, SPACE)

    assert mean not in (wind, INTACT)
    assert LocalSearch(Synthetic(winds, losses, most=1)).refined([wind]) == wind
