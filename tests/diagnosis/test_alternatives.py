"""Promises of the alternatives to a best hypothesis: functions of the losses and the space."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.arrays import FloatArray
from selfmodel.diagnosis import alternatives
from selfmodel.diagnosis.alternatives import (
    detectable_severities,
    indistinguishable,
    leads_of,
    passed_over,
    undetectable,
    unsearched_fault,
)
from selfmodel.diagnosis.diagnosis import DetectableSeverity, UnsearchedFault
from selfmodel.diagnosis.losses import LossFunction
from selfmodel.diagnosis.significance import NEGLIGIBLE_LOSS
from selfmodel.faults import BROKEN, FRICTION, ROUGHNESS
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import JAMMED, WEAK_MOTOR
from selfmodel.faults.kind import ENVIRONMENT, Fault
from selfmodel.faults.registry import ALL_KINDS, KINDS, PAPER_KINDS
from selfmodel.faults.world import PAYLOAD
from tests.diagnosis.synthetic import Synthetic
from tests.diagnosis.test_search import ANATOMY, SPACE as PAPER, said
from tests.helpers.robots.arms import arm

PIECES = 60
KNEE = "front_left_knee"
TOUCH, BREAK, JAM = "sensor:front_right_touch", "break:front_left_knee", "jam:back_left_knee"


def of(means: Mapping[str, float], otherwise: float = 1.0, scatter: float = 0.01) -> LossFunction:
    """Losses with scatter: a mean for each named hypothesis, another mean for the rest."""
    noise = scatter * np.random.default_rng(0).normal(size=PIECES)
    known = {said(text): mean for text, mean in means.items()}

    def losses(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        rows = [known.get(one, otherwise) for one in hypotheses]
        return np.array(
            [mean + noise * (1 + mean) if mean < np.inf else np.full(PIECES, mean) for mean in rows]
        )

    return losses


def named(found: Sequence[Hypothesis]) -> list[str]:
    return [str(one) for one in found]


def test_neighbours_that_predict_as_well_are_indistinguishable_and_others_are_not():
    best = f"{BREAK}+{TOUCH}"
    alike = {f"{BREAK}+{JAM}": 1 + 2e-7, f"{BREAK}+sensor:back_left_touch": 1 + 1e-7}
    far = "jam:back_right_knee+jam:front_right_knee"  # two faults differ
    larger = f"{best}+{JAM}"
    losses = of({best: 1.0, **alike, far: 1.0, larger: 0.99}, otherwise=2.0)

    found = indistinguishable(leads_of(said(best), Synthetic(PAPER, losses)))

    assert named(found) == [f"{BREAK}+sensor:back_left_touch", f"{BREAK}+{JAM}"]


def test_a_fault_that_stops_joints_has_rivals_of_its_limb_and_one_beside_it_any():
    best, beside = f"{BREAK}+{JAM}", f"{BREAK}+break:back_left_knee"
    same_limb, elsewhere = f"jam:front_left_knee+{JAM}", f"jam:back_right_knee+{JAM}"
    alike = {beside: 1 + 1e-7, same_limb: 1 + 2e-7, elsewhere: 1 + 3e-7}
    problem = Synthetic(PAPER, of({best: 1.0, **alike}, otherwise=2.0))

    every = [beside, same_limb, elsewhere]
    assert indistinguishable(leads_of(said(best), problem)) == [*map(said, every)]
    problem.standing, problem.reference = frozenset([KNEE]), np.full(PIECES, 1.0)
    assert indistinguishable(leads_of(said(best), problem)) == [*map(said, every[:2])]


def test_the_same_faults_at_another_severity_are_no_alternative_and_others_are_fitted():
    space = HypothesisSpace(ANATOMY, (WEAK_MOTOR, FRICTION))
    best = said("friction=0.4")

    def losses(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        rows = []
        for one in hypotheses:
            (fault,) = one.faults or (None,)
            weak = fault is not None and fault.part == "front_left_knee"
            mean = (
                1.0 + 5 * max(abs(fault.severity - 0.37) - 0.02, 0.0)
                if weak
                else 1.0
                if one == best
                else 2.0
            )
            rows.append(mean * np.linspace(0.99, 1.01, PIECES))
        return np.array(rows)

    (found,) = indistinguishable(leads_of(best, Synthetic(space, losses)))

    assert found.faults[0].part == "front_left_knee"
    assert found.faults[0].severity == pytest.approx(0.37, abs=0.021)


def test_an_alternative_that_corrects_model_error_or_misses_a_joint_is_none():
    best = said(f"motor:{KNEE}=0.4")
    space = HypothesisSpace(ANATOMY, (WEAK_MOTOR, FRICTION))
    levels = {f"friction={level}": 1.0 for level in FRICTION.levels}
    after = of({f"motor:{KNEE}=0.4": 1.0, **levels, "intact": 1.5}, otherwise=3.0)
    (found,) = indistinguishable(leads_of(best, Synthetic(space, after)))
    assert found.faults[0].kind == FRICTION

    slippery = of(dict.fromkeys(levels, 0.5))
    assert indistinguishable(leads_of(best, Synthetic(space, after, before=slippery))) == []

    def hinges(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        rows = np.full((len(hypotheses), PIECES, len(ANATOMY.hinges)), 0.1)
        rows[[one != best for one in hypotheses], :, ANATOMY.hinges.index(KNEE)] = 2.0
        return rows * np.linspace(0.9, 1.1, PIECES)[:, np.newaxis]

    assert indistinguishable(leads_of(best, Synthetic(space, after, hinges=hinges))) == []


def in_few_pieces(share: float, scale: float = 1.0, few: int = 4) -> LossFunction:
    """Losses of which a fault leaves a share, in few pieces; beside another one, a tenth less."""

    def losses(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        rows = np.full((len(hypotheses), PIECES), 0.0)
        rows[:, :few] = PIECES / few * np.linspace(0.5, 1.5, few)
        left = [
            share - 0.1 * (len(one) - 1) if said(BREAK).faults[0] in one.faults else 1.0
            for one in hypotheses
        ]
        return scale * rows * np.array(left)[:, np.newaxis]

    return losses


@pytest.mark.parametrize(
    ("losses", "before", "found"),
    [
        (in_few_pieces(0.49), None, BREAK),
        (in_few_pieces(0.55), None, f"{BREAK}+{TOUCH}"),
        (in_few_pieces(0.61), None, None),
        (in_few_pieces(0.49, few=40), None, None),  # a significant lead is the search's
        (in_few_pieces(0.49, scale=0.009), None, None),
        (in_few_pieces(0.49), in_few_pieces(0.49), None),  # healthy trials gain as much
    ],
)
def test_a_fault_that_halves_the_loss_is_passed_over_only_for_the_pieces_that_tell(
    losses: LossFunction, before: LossFunction | None, found: str | None
):
    compared = [INTACT, *map(said, [f"{BREAK}+{TOUCH}", TOUCH, BREAK])]

    assert passed_over(compared, Synthetic(PAPER, losses, before=before)) == (found and said(found))


def test_a_fault_that_makes_no_difference_is_undetectable_and_one_that_makes_one_is_not():
    losses = of({"intact": 1.0, TOUCH: 1.0, BREAK: 0.5}, otherwise=2.0)

    assert named(undetectable(INTACT, Synthetic(PAPER, losses))) == [TOUCH]


@pytest.mark.parametrize("means", [{"intact": 1.0}, {}])
def test_beside_a_diverged_simulation_nothing_is_undetectable(means: dict[str, float]):
    assert undetectable(INTACT, Synthetic(PAPER, of(means, otherwise=np.inf))) == []


def test_only_what_the_surrogate_does_not_tell_apart_is_simulated():
    asked: set[Hypothesis] = set()

    def losses(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        asked.update(hypotheses)
        return of({"intact": 1.0}, otherwise=2.0)(hypotheses)

    coarse = of({"intact": 1.0, TOUCH: 1.0}, otherwise=2.0)

    assert undetectable(INTACT, Synthetic(PAPER, losses, coarse=coarse)) == []
    assert {str(one) for one in asked} == {"intact", TOUCH}


def test_kinds_with_severities_are_never_undetectable():
    found = undetectable(INTACT, Synthetic(HypothesisSpace(ANATOMY, ALL_KINDS), of({})))

    without = {kind for kind in ALL_KINDS if kind.bounds is None}
    assert {fault.kind for one in found for fault in one.faults} == without


def test_an_unsearched_fault_that_explains_more_is_returned_with_the_other_kinds():
    after = of({"wind=12": 0.8, "crosswind=12": 0.9})
    found = unsearched_fault(INTACT, Synthetic(PAPER, after, before=of({})))

    assert found == UnsearchedFault(said("wind=12"), "wind", {"crosswind": said("crosswind=12")})


def test_severities_beyond_one_that_is_significantly_worse_are_not_simulated():
    mild, strong = "damping:front_left_knee=3.0", "damping:front_left_knee=10.0"
    helpful, asked = "damping:back_left_knee=30.0", set[Hypothesis]()
    after = of({"intact": 2.0, mild: 2.5, strong: 0.1, helpful: 1.0}, otherwise=2.0)

    def coarse(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        asked.update(hypotheses)
        return after(hypotheses)

    problem = Synthetic(PAPER, after, coarse=coarse, before=of({}))
    assert unsearched_fault(INTACT, problem) == UnsearchedFault(said(helpful), "damping", {})
    assert said(mild) in asked
    assert said(strong) not in asked


def test_an_unsearched_fault_that_helped_before_as_well_is_model_error():
    after, before = of({"wind=12": 0.8}), of({"wind=12": 0.79})

    assert unsearched_fault(INTACT, Synthetic(PAPER, after, before=before)) is None


@pytest.mark.parametrize(
    ("left", "is_error"), [(f"{JAM}+wind=12", False), ("wind=12", False), (JAM, True)]
)
def test_an_unsearched_fault_that_a_refit_explains_is_model_error(
    monkeypatch: pytest.MonkeyPatch, left: str, *, is_error: bool
):
    after = of({JAM: 0.9, f"{JAM}+wind=12": 0.8})
    problem = Synthetic(PAPER, after, before=of({}))
    monkeypatch.setattr(alternatives, "supported", lambda *_: (said(left), problem))

    assert (unsearched_fault(said(JAM), problem) is None) == is_error


def never(_: Sequence[Hypothesis]) -> FloatArray:
    raise AssertionError


@pytest.mark.parametrize("loss", [NEGLIGIBLE_LOSS, np.inf])
def test_beside_an_exact_or_diverged_hypothesis_no_unsearched_fault_is_simulated(loss: float):
    def losses(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        return np.full((len(hypotheses), PIECES), loss)

    problem = Synthetic(PAPER, losses, coarse=never, before=of({}))

    assert unsearched_fault(INTACT, problem) is None


def test_no_wind_and_no_ground_are_asked_about_on_a_bench():
    asked: set[str] = set()

    def losses(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        asked.update(fault.kind.name for one in hypotheses for fault in one.faults)
        return np.ones((len(hypotheses), PIECES)) + np.arange(PIECES) / 100

    space = HypothesisSpace.of(PAPER_KINDS, arm().anatomy)
    assert unsearched_fault(INTACT, Synthetic(space, losses, before=losses)) is None
    assert {"motor", "load"} <= asked
    assert asked.isdisjoint({"wind", "crosswind", "friction", "slope", "grip"})


def test_only_unsearched_kinds_are_asked_about_and_none_that_reshapes_the_model():
    asked: set[Hypothesis] = set()

    def coarse(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        asked.update(hypotheses)
        return of({})(hypotheses)

    best = said("sensor:back_left_angle")
    problem = Synthetic(PAPER, of({}), coarse=coarse, before=of({}))
    assert unsearched_fault(best, problem) is None

    kinds = {fault.kind for one in asked - {best} for fault in one.faults}
    assert kinds >= {kind for kind in ALL_KINDS if kind.base != "fixed"} - {*PAPER_KINDS, ROUGHNESS}
    assert ROUGHNESS not in kinds
    # A sensor gain replaces the failed sensor; all other faults are added to it.
    assert said("sensor:back_left_angle=gain0.5") in asked
    assert all(best.faults[0] in one.faults or len(one) == 1 for one in asked)


NOISE = np.random.default_rng(0).normal(0, 0.1, 40)
Effect = Callable[[Fault], float]


def with_effect(effect: Effect) -> Callable[[Sequence[Hypothesis]], np.ndarray]:
    """Losses of 1, plus the effect of each fault with a noise of a tenth."""

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        totals = [sum(effect(fault) for fault in one.faults) for one in hypotheses]
        return np.array([1 + total * (1 + NOISE) for total in totals])

    return losses


def shows(part: str, limit: float, nominal: float) -> Effect:
    """The effect of a fault of a part that shows from a distance to the nominal severity on."""
    return lambda fault: 1.0 * (fault.part == part and abs(fault.severity - nominal) >= limit)


def limits(effect: Effect, *kinds: object, best: Hypothesis = INTACT) -> list[DetectableSeverity]:
    return detectable_severities(best, HypothesisSpace.of(kinds, ANATOMY), with_effect(effect))


def test_the_largest_torque_that_shows_is_named_and_a_part_that_never_shows_has_no_limit():
    rows = {one.part: one for one in limits(shows(KNEE, 0.25, 1.0), WEAK_MOTOR)}

    assert rows[KNEE] == DetectableSeverity("motor", KNEE, below=0.7, above=None)
    assert {(one.below, one.above) for part, one in rows.items() if part != KNEE} == {(None, None)}
    assert len(rows) == 8


@settings(max_examples=15)
@given(limit=st.floats(0.01, 1.2))
def test_the_bisection_finds_the_same_severity_as_a_scan_of_the_levels(limit: float):
    levels = sorted(WEAK_MOTOR.levels_at(ANATOMY, KNEE), reverse=True)
    below = [level for level in levels if level < 1.0]
    scanned = [(1.0 + below[0]) / 2, *below]
    expected = next((level for level in scanned if 1.0 - level >= limit), None)
    (row,) = [one for one in limits(shows(KNEE, limit, 1.0), WEAK_MOTOR) if one.part == KNEE]

    assert row.below == expected


@pytest.mark.parametrize("true", [0.5, 0.8])
def test_the_nominal_friction_is_the_level_with_the_smallest_loss(true: float):
    """The model has its own friction, which no severity of the kind is nominal for."""
    levels = sorted(FRICTION.levels_at(ANATOMY, ENVIRONMENT))
    nominal = min(levels, key=lambda level: abs(level - true))

    def effect(fault: Fault) -> float:
        distance = abs(fault.severity - nominal)
        return 1e-7 * distance if distance < 0.19 else 1.0

    (row,) = limits(effect, FRICTION)

    assert row.below is None or row.below < nominal
    assert row.above is None or row.above > nominal
    assert row.below == max((one for one in levels if one <= nominal - 0.19), default=None)
    assert row.above == min((one for one in levels if one >= nominal + 0.19), default=None)


def test_kinds_without_a_severity_and_kinds_that_edit_the_specification_are_left_out():
    assert limits(shows(KNEE, 0.25, 1.0), JAMMED, BROKEN) == []
    assert limits(shows(KNEE, 0.25, 1.0), KINDS["roughness"]) == []
    parts = [(one.kind, one.part) for one in limits(shows(KNEE, 0.25, 1.0), JAMMED, PAYLOAD)]
    assert parts == [("payload", part) for part in PAYLOAD.parts(ANATOMY)]


def test_only_losses_clearly_worse_than_the_best_show():
    """A difference of four standard errors is better than nothing, and too little to be found."""
    swing = np.resize([1.0, -1.0], 40)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        rows = np.ones((len(hypotheses), 40))
        for row, one in zip(rows, hypotheses, strict=True):
            if one.faults:
                z = 6.0 if one.faults[0].part == KNEE else 4.0
                row += 0.01 * (z + swing * np.sqrt(39))  # noqa: PLW2901  # of an array, in place
        return rows

    space = HypothesisSpace.of([WEAK_MOTOR], ANATOMY)
    rows = {one.part: one.below for one in detectable_severities(INTACT, space, losses)}

    assert rows.pop(KNEE) is not None
    assert set(rows.values()) == {None}


def test_parts_with_a_fault_are_left_out():
    faulty = Hypothesis((Fault(WEAK_MOTOR, KNEE, 0.5),))
    parts = [one.part for one in limits(shows(KNEE, 0.25, 1.0), WEAK_MOTOR, best=faulty)]

    assert len(parts) == 7
    assert KNEE not in parts
