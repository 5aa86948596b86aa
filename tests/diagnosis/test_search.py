"""Promises of the search on synthetic losses, without physics and without the EA.

Each fault has an effect on every piece, and the effects of a hypothesis add up. The loss is the
squared difference from the effects of the truth, so the truth has a loss of 0.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.diagnosis.losses import LossFunction as Losses
from selfmodel.diagnosis.search import LocalSearch, with_fitted_severities, with_mean_severities
from selfmodel.diagnosis.significance import MIN_Z_OF_STEP, is_better
from selfmodel.faults import FRICTION, WIND, FaultKind
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import KINDS, PAPER_KINDS
from selfmodel.tasks import ROBOTS
from tests.diagnosis.synthetic import Synthetic

ANATOMY = ROBOTS["quadruped"].robot().anatomy
SPACE = HypothesisSpace(ANATOMY, PAPER_KINDS)
FAULTS = tuple(fault for kind in PAPER_KINDS for fault in kind.candidates(ANATOMY))
PIECES = 400
MOST = 4


def said(text: str) -> Hypothesis:
    return parse(text, ANATOMY)


def effects(seed: int = 0) -> Mapping[Fault, np.ndarray]:
    """Independent effects of each fault, ``(segments,)``."""
    rng = np.random.default_rng(seed)
    return {fault: rng.normal(size=PIECES) for fault in FAULTS}


def additive(truth: Hypothesis, floor: float = 0.01, seed: int = 0) -> Losses:
    """Losses of additive effects of faults."""
    effect = effects(seed)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = []
        for hypothesis in hypotheses:
            left = sum((effect[fault] for fault in truth.faults), np.zeros(PIECES))
            for fault in hypothesis.faults:
                left = left - effect[fault]
            rows.append(floor + left**2)
        return np.array(rows)

    return losses


def counted(table: Mapping[str, float], otherwise: float) -> Losses:
    """Losses from a table, equal in all segments but for a ripple."""
    known = {said(text): loss for text, loss in table.items()}
    ripple = np.linspace(-0.01, 0.01, PIECES)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        return np.array([known.get(one, otherwise) * (1 + ripple) for one in hypotheses])

    return losses


@dataclass(frozen=True)
class Proposing(HypothesisSpace):
    """A space with given candidates in a given order."""

    faults: tuple[Fault, ...] = ()

    @property
    def coarse_candidates(self) -> tuple[Fault, ...]:
        """The candidates of the test."""
        return self.faults


def find(
    losses: Losses,
    *known: Hypothesis,
    faults: Sequence[Fault] = FAULTS,
    most: int = MOST,
    before: Losses | None = None,
) -> Hypothesis:
    space = Proposing(ANATOMY, PAPER_KINDS, faults=tuple(faults))
    return LocalSearch(Synthetic(space, losses, most=most, before=before)).refined(known)


@pytest.mark.parametrize(
    "text",
    [
        "intact",
        "jam:back_left_knee",
        "break:front_left_knee+sensor:front_right_touch",
        "break:front_left_shoulder+jam:back_left_shoulder+sensor:back_right_angle",
        "jam:back_left_knee+jam:front_left_knee+jam:front_right_knee+sensor:back_right_angle",
    ],
)
def test_a_compound_is_found_from_nothing_but_single_faults(text: str):
    assert str(find(additive(said(text)))) == text


def test_a_needle_is_found_where_only_one_of_its_faults_shows_by_itself():
    # Alone, the sensor fault increases the loss, as every other fault does.
    needle = "break:back_left_knee+sensor:front_left_angle"
    losses = counted({"intact": 1.0, "break:back_left_knee": 0.9, needle: 0.1}, otherwise=1.5)

    assert find(losses) == said(needle)


def test_a_fault_that_alone_is_far_worse_than_none_is_not_tried_beside_another():
    truth, hopeless = said("jam:back_left_knee"), said("break:front_left_knee")
    asked = set[Hypothesis]()
    given = counted({"intact": 1.0, str(truth): 0.1, str(hopeless): 3.5}, otherwise=1.5)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        asked.update(hypotheses)
        return given(hypotheses)

    assert find(losses) == truth
    beside = {one for one in asked if len(one) > 1}
    assert beside
    assert not any(set(hopeless.faults) & set(one.faults) for one in beside)


def test_the_severity_of_a_long_trial_is_fitted_by_the_surrogate_alone():
    space, ripple = HypothesisSpace(ANATOMY, (FRICTION,)), np.linspace(-0.01, 0.01, PIECES)
    found, compared = [], []

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        compared[-1].update(hypotheses)
        return coarse(hypotheses)

    def coarse(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        severities = [one.faults[0].severity if len(one) else 1.5 for one in hypotheses]
        return np.array([(0.1 + abs(one - 0.53)) * (1 + ripple) for one in severities])

    for is_long in (False, True):
        compared.append(set[Hypothesis]())
        problem = Synthetic(space, losses, coarse=coarse)
        problem.is_long = is_long
        found.append(LocalSearch(problem).refined([]).faults[0].severity)

    assert found == pytest.approx([0.53, 0.53], abs=0.005)
    assert len(compared[1]) < len(compared[0])


def helped(swing: float) -> Losses:
    """Losses with a broken knee as the truth; a failed sensor lowers them by a noisy gain."""
    knee, helper = said("break:front_left_knee"), said("sensor:front_right_touch").faults[0]
    of = additive(knee, floor=1.0)
    help_ = np.resize([swing, -swing], PIECES) - 0.2

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        without = [Hypothesis(tuple(f for f in one.faults if f != helper)) for one in hypotheses]
        helps = np.array([helper in one.faults for one in hypotheses])
        return of(without) + helps[:, np.newaxis] * help_

    return losses


@pytest.mark.parametrize(
    ("swing", "found"),
    [(0.1, "break:front_left_knee+sensor:front_right_touch"), (3.0, "break:front_left_knee")],
    ids=["of use", "by chance"],
)
def test_a_fault_is_kept_where_it_is_of_use_and_dropped_where_chance_would_do_as_well(
    swing: float, found: str
):
    losses = helped(swing)
    more, less = (
        said("break:front_left_knee+sensor:front_right_touch"),
        said("break:front_left_knee"),
    )

    assert losses([more]).sum() < losses([less]).sum()
    assert is_better(*losses([more, less])) == (len(said(found)) == 2)
    assert str(find(losses)) == str(find(losses, more)) == str(find(losses, less)) == found


@pytest.mark.parametrize("most", [1, 2, 3])
def test_there_are_never_more_faults_than_allowed(most: int):
    truth = said("jam:front_left_knee+jam:front_right_knee+jam:back_left_knee+jam:back_right_knee")
    asked: set[Hypothesis] = set()
    of = additive(truth)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        asked.update(hypotheses)
        return of(hypotheses)

    found = find(losses, most=most)
    assert 1 <= len(found) <= most
    assert max(map(len, asked)) == most
    assert set(found.faults) <= set(truth.faults)


def test_a_hypothesis_that_diverges_is_never_chosen():
    truth = said("jam:front_left_knee")
    of = additive(truth)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = of(hypotheses)
        rows[[one not in (INTACT, truth) for one in hypotheses]] = np.inf
        return rows

    assert find(losses) == truth
    assert find(losses, said("break:back_left_knee")) == truth


SMALL_WORLD = FAULTS[::4]
"""A subset of the faults for tests with many searches."""

NOISY, CLEAR = st.floats(0.01, 2), st.just(1e-6)


def worlds(spread: st.SearchStrategy[float]) -> st.SearchStrategy[Losses]:
    """Loss functions with random losses per hypothesis and noise per segment."""
    return st.builds(_random_world, st.integers(0, 2**32 - 1), spread, st.integers(5, 12))


def _random_world(seed: int, spread: float, pieces: int) -> Losses:
    """Random losses, a function of the hypothesis."""

    def row(hypothesis: Hypothesis) -> np.ndarray:
        place = [FAULTS.index(fault) for fault in hypothesis.faults]
        rng = np.random.default_rng([seed, len(place), *place])
        if rng.random() < 0.05:
            return np.full(pieces, np.inf)
        return np.maximum(rng.gamma(2) + spread * rng.normal(size=pieces), 0.0)

    return lambda hypotheses: np.array([row(one) for one in hypotheses])


known_ones = st.lists(
    st.lists(st.sampled_from(SMALL_WORLD), max_size=2).map(
        lambda faults: canonical(faults, ANATOMY)
    ),
    max_size=3,
)


@settings(max_examples=10)
@given(worlds(CLEAR), known_ones)
def test_where_a_test_tells_any_two_apart_no_start_is_better_than_what_is_found(
    losses: Losses, known: list[Hypothesis]
):
    found = find(losses, *known, faults=SMALL_WORLD, most=2)
    singles = [canonical([fault], ANATOMY) for fault in SMALL_WORLD]

    for start in (*known, *singles, INTACT):
        assert not is_better(*losses([start, found]))


@settings(max_examples=8)
@given(worlds(NOISY), known_ones, st.permutations(SMALL_WORLD))
def test_the_order_of_the_faults_and_of_what_is_known_does_not_matter(
    losses: Losses, known: list[Hypothesis], order: list[Fault]
):
    straight = find(losses, *known, faults=SMALL_WORLD, most=2)

    assert find(losses, *reversed(known), faults=order, most=2) == straight


@settings(max_examples=8)
@given(st.lists(st.sampled_from(FAULTS), max_size=3), st.integers(0, 1000))
def test_every_truth_of_effects_that_add_up_is_found(faults: list[Fault], seed: int):
    truth = canonical(faults, ANATOMY)

    assert find(additive(truth, seed=seed), most=3) == truth


def test_the_screen_says_what_is_looked_at_and_the_losses_what_is_found():
    truth = said("break:front_left_knee+sensor:front_right_touch")
    of = additive(truth)
    looked_at: set[Hypothesis] = set()

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        looked_at.update(hypotheses)
        return of(hypotheses)

    def screen(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        return of(hypotheses)[:, ::3] + 1.0

    search = LocalSearch(Synthetic(SPACE, losses, coarse=screen))
    assert search.refined([]) == truth
    assert looked_at == search.compared
    few = len(looked_at)
    looked_at.clear()
    assert LocalSearch(Synthetic(SPACE, losses)).refined([]) == truth
    assert few < len(looked_at) / 2


def test_a_fault_that_would_have_helped_as_much_before_only_mends_the_model():
    truth, is_model_error = said("break:back_left_knee"), said("jam:front_left_knee")
    both = canonical((*truth.faults, *is_model_error.faults), ANATOMY)
    after = additive(both)

    assert find(after, before=additive(truth)) == is_model_error
    assert find(after, before=additive(INTACT)) == both
    assert find(after, before=additive(is_model_error)) == truth


FEW = FAULTS[-5:]
"""Sensors, whose faults do not absorb each other."""


def step_of(z: float) -> tuple[Hypothesis, Losses]:
    """A pair of faults, and losses in which the second is better by z standard errors.

    With a third fault, the loss is smaller by far: a descent that takes the step reaches it, and no
    other descent does, because two decoys are better single faults.
    """
    first, second, third, *decoys = FEW
    one = canonical([first], ANATOMY)
    two, end = canonical([first, second], ANATOMY), canonical([first, third, second], ANATOMY)
    swing = np.resize([1.0, -1.0], PIECES)
    gain = 0.001 * (z + swing * np.sqrt(PIECES - 1))
    known = {one: np.full(PIECES, 0.5), two: 0.5 - gain, end: np.full(PIECES, 0.01)}
    known |= {canonical([decoy], ANATOMY): np.full(PIECES, 0.6) for decoy in decoys}

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        otherwise = np.full(PIECES, 0.9)
        return np.array(
            [
                known.get(each, otherwise + 0.01 * len(each) * (1 + 0.1 * swing))
                for each in hypotheses
            ]
        )

    return end, losses


@pytest.mark.parametrize(("z", "continues"), [(1.01, True), (0.99, False)])
def test_a_descent_continues_with_a_further_fault_only_from_two_standard_errors_on(
    z: float, *, continues: bool
):
    end, losses = step_of(z * MIN_Z_OF_STEP)
    found = find(losses, faults=FEW)

    assert (found == end) == continues


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


def of_friction(mean: Callable[[float], float], noise: float) -> Losses:
    """Losses of frictions: a mean per severity, with noise per segment and severity."""

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = []
        for severity in map(degree_of, hypotheses):
            ripple = np.random.default_rng(round(severity * 1e4)).normal(size=PIECES)
            rows.append(mean(severity) + noise * (ripple - ripple.mean()))
        return np.array(rows)

    return losses


def friction(severity: float) -> Hypothesis:
    return Hypothesis((Fault(FRICTION, ENVIRONMENT, severity),))


def degree_of(hypothesis: Hypothesis) -> float:
    (fault,) = hypothesis.faults
    return fault.severity


def test_a_lucky_degree_does_not_win_where_its_neighbours_cannot_be_told_from_it():
    losses = of_friction(lambda one: 5 + (one - 0.4) ** 2 - 0.03 * (one == 0.32), noise=0.3)
    fitted = with_fitted_severities(friction(0.6), losses, SPACE)
    mean = with_mean_severities(fitted, losses, SPACE)

    assert degree_of(fitted) == 0.32
    assert degree_of(mean) == pytest.approx(0.4, abs=0.04)


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


@pytest.mark.parametrize(
    ("best", "errors", "is_dead"),
    [(0.02, 0.9, True), (0.02, 1.1, False), (0.09, 0.9, True), (0.3, 0.9, False)],
)
def test_a_motor_below_its_levels_is_dead_unless_torque_is_a_standard_error_better(
    best: float, errors: float, *, is_dead: bool
):
    ripple = np.random.default_rng(0).normal(size=PIECES)
    ripple -= ripple.mean()
    without = errors * ripple.std(ddof=1) / np.sqrt(PIECES) + ripple

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        left = np.array([[sum(of.severity for of in one.faults) or not one] for one in hypotheses])
        return 5 + np.where(left == 0, without, np.abs(left - best) * (1 + 30 * ripple))

    fitted = parse(f"motor:front_left_knee={best}", ANATOMY)
    found = with_mean_severities(fitted, losses, space_of(WEAK_MOTOR))

    assert is_dead == (degree_of(found) == 0)
    alone = Hypothesis((replace(fitted.faults[0], kind=replace(WEAK_MOTOR, levels=(0.0,))),))
    assert degree_of(with_mean_severities(alone, losses, space_of(WEAK_MOTOR))) > 0


def test_a_mean_is_not_taken_across_what_predicts_worse():
    valleys = of_friction(lambda one: 2 + min(abs(one - 0.2), abs(one - 1.2)), noise=0.2)
    mean = with_mean_severities(friction(0.2), valleys, SPACE)

    assert degree_of(mean) == pytest.approx(0.2, abs=0.05)


@pytest.mark.parametrize("healthy_loss", [0.01, 1e3])
@pytest.mark.parametrize(
    "truth", ["jam:front_left_knee", "jam:front_left_knee+sensor:back_left_touch"]
)
def test_a_search_from_standing_joints_finds_what_is_beside_them(truth: str, healthy_loss: float):
    problem = Synthetic(SPACE, additive(said(truth)))
    problem.standing = frozenset(["front_left_knee"])
    problem.reference = np.full(PIECES, healthy_loss)
    search = LocalSearch(problem)

    assert search.refined([said("jam:front_left_knee")]) == said(truth)


def test_a_fault_that_stops_a_joint_gives_way_to_one_that_predicts_better():
    problem = Synthetic(SPACE, additive(said("break:front_left_knee"), floor=1e-3))
    problem.standing = frozenset(["front_left_shoulder"])
    problem.reference = np.full(PIECES, 1e3)  # any hypothesis predicts as well
    search = LocalSearch(problem)
    search.pruned = lambda hypothesis: hypothesis

    assert search.refined([said("break:front_left_shoulder")]) == said("break:front_left_knee")
