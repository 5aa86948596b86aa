"""Promises of the losses: simulated once, kept by trial and hypothesis, infinite if diverged."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from selfmodel.comparators import FORWARD_DISPLACEMENT, SEGMENT_PREDICTION, SENSOR_SERIES
from selfmodel.controllers.controller import CommandSource
from selfmodel.diagnosis.comparator import Comparator, Losses, PreparedTrial
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.losses import LossTable
from selfmodel.errors import InputError
from selfmodel.faults import BROKEN
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation import rollout
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments
from selfmodel.simulation.rollout import SimulationResult, hypothesis_bytes
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.comparators import Prepared, PreparedPieces
from tests.helpers.drivers import random_controllers
from tests.helpers.hostile import exploding
from tests.helpers.memory import in_memory

STEPS = 60
SMALL = dataclasses.replace(Settings().scaled(12), generations=2, steps=600)
TINY = dataclasses.replace(Settings().scaled(12), generations=2, steps=STEPS)
TEXTS = ("intact", "jam:back_left_knee", "break:front_left_knee")

CLOSED_LOOP = ClosedLoop(("base_position",))


class CountingSimulator(Simulator):
    """Counts how often each hypothesis is simulated for each driver or each set of segments."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, threads=1)
        self.times: Counter = Counter()
        self.calls = 0

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        """Simulates as ever."""
        self.calls += 1
        self.times.update(runs)
        return super().run(runs, steps, record)

    def predict(
        self,
        hypotheses: Sequence[Hypothesis],
        segments: Segments,
        observed: Behaviour | None = None,
    ) -> SimulationResult:
        """Predicts as ever."""
        self.calls += 1
        self.times.update((one, segments.commands.tobytes()) for one in hypotheses)
        return super().predict(hypotheses, segments, observed)

    def run_ensemble(
        self,
        hypotheses: Sequence[Hypothesis],
        driver: CommandSource,
        steps: int,
        ensemble: Ensemble,
    ) -> SimulationResult:
        """Simulates as ever."""
        self.calls += 1
        self.times.update((one, driver) for one in hypotheses)
        return super().run_ensemble(hypotheses, driver, steps, ensemble)


@dataclasses.dataclass(frozen=True)
class Plain:
    """A comparator with a given request and given distances."""

    asks: Request = CLOSED_LOOP
    gives: Callable[[int], object] = np.ones
    name: str = "plain"

    def prepare(self, _trial: Trial) -> Prepared:
        """Prepares with both."""
        return Prepared(self.asks, self._given)

    def _given(self, simulated: Behaviour) -> object:
        return self.gives(len(next(iter(simulated.signals.values()))))


@dataclasses.dataclass(frozen=True)
class InPieces(Plain):
    """The same, with losses."""

    def prepare(self, _trial: Trial) -> PreparedPieces:
        """Prepares with both."""
        return PreparedPieces(self.asks, self._given)


@pytest.fixture(scope="module")
def trials(quadruped: Robot) -> list[Trial]:
    """Two trials, each with a controller of its own."""
    damaged = SimulatedRobot(quadruped, parse("break:front_left_knee", quadruped.anatomy))
    return [
        in_memory(quadruped)(damaged, TrialPlan(f"{k}", "after", controller, STEPS, 0))
        for k, controller in enumerate(random_controllers(quadruped, 3)[1:])
    ]


@pytest.fixture(scope="module")
def three(quadruped: Robot) -> list[Hypothesis]:
    return [parse(text, quadruped.anatomy) for text in TEXTS]


REQUESTS = [
    pytest.param(FORWARD_DISPLACEMENT, id="closed loop"),
    pytest.param(SENSOR_SERIES, id="closed loop in pieces"),
    pytest.param(SEGMENT_PREDICTION, id="segments"),
    pytest.param(Plain(Ensemble(("base_position",), members=2, level=0.05)), id="ensemble"),
]


@pytest.mark.parametrize("comparator", REQUESTS)
def test_losses_are_the_same_in_small_batches(
    comparator: Comparator,
    quadruped: Robot,
    trials: list[Trial],
    three: list[Hypothesis],
    monkeypatch: pytest.MonkeyPatch,
):
    whole = LossTable(Simulator(quadruped, 1), comparator).losses(three, trials)
    request = comparator.prepare(trials[0]).request
    needed = hypothesis_bytes(quadruped, request, STEPS)
    monkeypatch.setattr(rollout, "batch_bytes", lambda: 2 * needed)
    small = CountingSimulator(quadruped)
    batched = LossTable(small, comparator).losses(three, trials)

    assert small.calls == 2 * len(trials)
    assert np.array_equal(whole, batched)


@pytest.mark.parametrize("comparator", REQUESTS)
def test_nothing_is_simulated_twice(
    comparator: Comparator, quadruped: Robot, trials: list[Trial], three: list[Hypothesis]
):
    simulator = CountingSimulator(quadruped)
    evidence = LossTable(simulator, comparator)
    evidence.distances([*three[:2], three[0]], trials[:1])
    evidence.losses(three, trials)
    evidence.distances(three[::-1], trials[::-1])

    assert set(simulator.times.values()) == {1}
    assert len(simulator.times) == len(three) * len(trials)
    assert {hypothesis for hypothesis, _ in simulator.times} == set(three)


@pytest.mark.parametrize("comparator", [FORWARD_DISPLACEMENT, SENSOR_SERIES, SEGMENT_PREDICTION])
def test_a_hypothesis_that_was_only_probed_is_not_simulated_again_and_not_ranked(
    comparator: Comparator, quadruped: Robot, trials: list[Trial]
):
    # The truth with a failed sensor, of a kind that is not searched: nearly as close as the truth.
    probed = parse("break:front_left_knee+sensor:back_left_touch", quadruped.anatomy)
    simulator = CountingSimulator(quadruped)
    search = DiagnosticSearch(simulator, comparator, TINY, [BROKEN])
    search.losses.losses([probed], trials)
    found = search(trials, [], np.random.default_rng(0), lambda _: None)

    assert [n for (one, _), n in simulator.times.items() if one == probed] == [1] * len(trials)
    assert probed not in {candidate.hypothesis for candidate in found.ranked}
    assert probed not in found.indistinguishable
    assert (
        found.ranked
        == DiagnosticSearch(Simulator(quadruped, 1), comparator, TINY, [BROKEN])(
            trials, [], np.random.default_rng(0), lambda _: None
        ).ranked
    )


def test_a_trial_is_prepared_once_and_its_opening_is_another_trial(
    quadruped: Robot, trials: list[Trial], three: list[Hypothesis]
):
    times: Counter = Counter()

    class Counting:
        name = "counting"

        def prepare(self, trial: Trial) -> PreparedTrial:
            times[trial.path, trial.behaviour.steps] += 1
            return SENSOR_SERIES.prepare(trial)

    opening = dataclasses.replace(trials[0], behaviour=trials[0].behaviour.first(STEPS // 2))
    evidence = LossTable(Simulator(quadruped, 1), Counting())
    whole, part = evidence.losses(three, trials[:1]), evidence.losses(three, [opening])
    evidence.check(trials)
    evidence.losses(three, [*trials, opening])

    assert whole.shape[1] > part.shape[1]
    assert times == {
        (trials[0].path, STEPS): 1,
        (trials[1].path, STEPS): 1,
        (trials[0].path, STEPS // 2): 1,
    }


@pytest.mark.parametrize("comparator", REQUESTS)
def test_the_distance_is_the_sum_over_the_trials_of_the_mean_over_the_pieces(
    comparator: Comparator, quadruped: Robot, trials: list[Trial], three: list[Hypothesis]
):
    evidence = LossTable(Simulator(quadruped, 1), comparator)
    losses = [evidence.losses(three, [trial]) for trial in trials]
    together = evidence.losses(three, trials)

    assert np.array_equal(together, np.concatenate(losses, axis=1))
    assert np.array_equal(
        evidence.distances(three, trials), sum(one.mean(axis=1) for one in losses)
    )
    assert not np.array_equal(losses[0], losses[1]) or isinstance(comparator, Plain)


@pytest.mark.search
def test_a_diagnosis_simulates_nothing_twice_and_ranks_nothing_that_is_not_considered(
    quadruped: Robot,
):
    gait = random_controllers(quadruped, 6)[5]
    after, before = (
        in_memory(quadruped)(
            SimulatedRobot(quadruped, parse(truth, quadruped.anatomy)),
            TrialPlan(stage, stage, gait, SMALL.steps, 0),
        )
        for truth, stage in (("friction=0.3", "after"), ("intact", "before"))
    )
    simulator = CountingSimulator(quadruped)
    search = DiagnosticSearch(
        simulator, SEGMENT_PREDICTION, SMALL, PAPER_KINDS, healthy_trials=[before]
    )
    found = search([after], [], np.random.default_rng(0), lambda _: None)

    assert found.unsearched is not None
    assert found.unsearched.kind == "friction"
    assert max(simulator.times.values()) == 1
    simulated = {hypothesis for hypothesis, _ in simulator.times}
    considered = {
        one for one in simulated if {fault.kind for fault in one.faults} <= {*PAPER_KINDS}
    }
    assert search.distinct_hypotheses <= len(considered) < len(simulated)


def test_a_trial_is_known_by_its_content_and_not_by_its_path(
    quadruped: Robot, trials: list[Trial], three: list[Hypothesis]
):
    simulator = CountingSimulator(quadruped)
    table = LossTable(simulator, FORWARD_DISPLACEMENT)
    first = table.losses(three, trials[:1])
    signals = dict(trials[0].behaviour.signals)
    signals["base_position"] = signals["base_position"] + np.linspace(0, 5, STEPS)[:, np.newaxis]
    moved = dataclasses.replace(trials[0].behaviour, signals=signals)

    renamed = dataclasses.replace(trials[0], path="elsewhere")
    assert np.array_equal(table.losses(three, [renamed]), first)
    assert set(simulator.times.values()) == {1}
    elsewhere = table.losses([INTACT], [dataclasses.replace(trials[0], behaviour=moved)])
    assert elsewhere[0, 0] != first[0, 0]


@pytest.mark.parametrize("comparator", [FORWARD_DISPLACEMENT, SEGMENT_PREDICTION, SENSOR_SERIES])
def test_a_hypothesis_that_diverges_is_infinitely_far_and_harms_no_other(
    comparator: Comparator, quadruped: Robot, trials: list[Trial]
):
    alone = LossTable(Simulator(quadruped, 1), comparator).losses([INTACT], trials)
    simulator = Simulator(quadruped, 1)
    bad = exploding(simulator, "jam:front_left_knee")
    evidence = LossTable(simulator, comparator)
    losses = evidence.losses([bad, INTACT], trials)

    assert simulator.stats.diverged == len(trials)
    assert np.all(np.isinf(losses[0]))
    assert np.array_equal(losses[1:], alone)
    assert evidence.distances([bad], trials) == np.inf


def test_what_is_prepared_must_be_a_prepared_trial(quadruped: Robot, trials: list[Trial]):
    class Preparing:
        name = "nothing"

        def prepare(self, _trial: Trial) -> None:
            """Prepares nothing."""

    with pytest.raises(InputError, match="'nothing' prepared None, which has no request"):
        LossTable(Simulator(quadruped, 1), Preparing()).check(trials)


@pytest.mark.parametrize(
    ("comparator", "message"),
    [
        (Plain(gives=lambda _: 1.0), r"returned losses \(1,\) for 2 simulations"),
        (Plain(gives=lambda n: np.ones((n, 1))), r"returned losses \(2, 1, 1\) for 2"),
        (Plain(gives=lambda n: np.full(n, -1.0)), "not a number of at least 0"),
        (Plain(gives=lambda n: np.full(n, np.nan)), "not a number of at least 0"),
        (
            InPieces(gives=lambda n: Losses(np.ones((n, 3)), {}, np.ones((n, 3)))),
            "losses of hinges",
        ),
        (InPieces(gives=np.ones), r"returned losses \(2,\) for 2 simulations"),
        (InPieces(gives=lambda n: np.ones((n + 1, 3))), r"returned losses \(3, 3\) for 2"),
        (InPieces(gives=lambda n: np.ones((n, 0))), r"returned losses \(2, 0\) for 2"),
        (InPieces(gives=lambda n: np.full((n, 3), -1.0)), "not a number of at least 0"),
        (InPieces(gives=lambda n: np.full((n, 3), np.nan)), "not a number of at least 0"),
        (Plain(asks=ClosedLoop(())), r"requested the signals \(\), of sensors, commands"),
        (Plain(asks=ClosedLoop(("smell",))), r"requested the signals \('smell',\), of sensors"),
    ],
)
def test_a_comparator_that_breaks_its_contract_is_named_with_what_it_did(
    comparator: Plain, message: str, quadruped: Robot, trials: list[Trial], three: list[Hypothesis]
):
    evidence = LossTable(Simulator(quadruped, 1), comparator)

    with pytest.raises(InputError, match=f"the comparator 'plain' .*{message}.*check_comparator"):
        evidence.distances(three[:2], trials)


def test_all_trials_that_cannot_be_judged_are_named_at_once(quadruped: Robot, trials: list[Trial]):
    first, second = (
        dataclasses.replace(trial, behaviour=_blind(trial.behaviour), path=f"{k}.mcap")
        for k, trial in enumerate(trials)
    )
    evidence = LossTable(Simulator(quadruped, 1), FORWARD_DISPLACEMENT)
    evidence.check(trials)

    with pytest.raises(InputError, match=r"0\.mcap: .* needs .*; 1\.mcap: .* needs "):
        evidence.check([first, trials[0], second])


def _blind(behaviour: Behaviour) -> Behaviour:
    nothing = {signal: np.full_like(rows, np.nan) for signal, rows in behaviour.signals.items()}
    return Behaviour(behaviour.names, behaviour.time, nothing)
