"""Promises of the losses: simulated once, kept by trial and hypothesis, infinite if diverged."""

import dataclasses
import itertools
from collections import Counter
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.comparators import (
    FORWARD_DISPLACEMENT,
    SEGMENT_PREDICTION,
    SEGMENT_PREDICTION_ONBOARD,
    SENSOR_SERIES,
    segment_prediction,
)
from selfmodel.diagnosis.comparator import Comparator, Losses, PreparedTrial
from selfmodel.diagnosis.direct_evidence import observed_faults
from selfmodel.diagnosis.losses import LossTable, contradiction_losses, simulate
from selfmodel.diagnosis.significance import CONTRADICTION
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.joints import SERVO_GAIN
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.simulation import requests, rollout
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request
from selfmodel.simulation.rollout import SimulationResult, hypothesis_bytes
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPart
from tests.diagnosis.synthetic import problem_of
from tests.helpers.comparators import Prepared, PreparedPieces
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import changed
from tests.helpers.hostile import exploding
from tests.helpers.memory import trial_of
from tests.helpers.robots.arms import arm_mjcf, robot_of

STEPS = 60
KNEE = "front_left_knee"
CLOSED_LOOP = ClosedLoop(("base_position",))


Batches = list[list[tuple[object, Hypothesis]]]


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> Batches:
    """The trials, by their content, and the hypotheses of each simulation."""
    batches: Batches = []

    def recorded(
        simulator: Simulator, request: Request, trial: Trial, hypotheses: Sequence[Hypothesis]
    ) -> SimulationResult:
        batches.append([(trial.content, one) for one in hypotheses])
        return simulate(simulator, request, trial, hypotheses)

    monkeypatch.setattr("selfmodel.diagnosis.losses.simulate", recorded)
    return batches


@dataclasses.dataclass(frozen=True)
class Plain:
    """A comparator with a given request, and given distances or losses."""

    asks: Request = CLOSED_LOOP
    gives: Callable[[int], object] = np.ones
    has_pieces: bool = False
    name: str = "plain"

    def prepare(self, _trial: Trial) -> Prepared | PreparedPieces:
        """Prepares with both."""
        return (PreparedPieces if self.has_pieces else Prepared)(self.asks, self._given)

    def _given(self, simulated: Trajectory) -> object:
        return self.gives(len(next(iter(simulated.signals.values()))))


def in_pieces(gives: Callable[[int], object]) -> Plain:
    return Plain(gives=gives, has_pieces=True)


def jammed(robot: Robot, *steps: int) -> list[Trial]:
    """Trials of a jammed robot, each with a controller of its own."""
    gaits = random_controllers(robot, 1 + len(steps))[1:]
    return [
        trial_of(robot, f"jam:{KNEE}", gait, steps=count, name=f"{k}")
        for k, (gait, count) in enumerate(zip(gaits, steps, strict=True))
    ]


@pytest.fixture(scope="module")
def trials(quadruped: Robot) -> list[Trial]:
    return jammed(quadruped, STEPS, STEPS)


@pytest.fixture(scope="module")
def long(quadruped: Robot) -> list[Trial]:
    return jammed(quadruped, 240, 180)


@pytest.fixture(scope="module")
def table(quadruped: Robot) -> LossTable:
    return LossTable(Simulator(quadruped, 1), SEGMENT_PREDICTION)


@pytest.fixture(scope="module")
def three(quadruped: Robot) -> list[Hypothesis]:
    texts = ("intact", "break:back_left_knee", f"jam:{KNEE}")
    return [parse(text, quadruped.anatomy) for text in texts]


REQUESTS = [
    pytest.param(FORWARD_DISPLACEMENT, id="closed loop"),
    pytest.param(SENSOR_SERIES, id="closed loop in pieces"),
    pytest.param(SEGMENT_PREDICTION, id="segments"),
    pytest.param(Plain(Ensemble(("base_position",), members=2, level=0.05)), id="ensemble"),
]


@pytest.mark.parametrize("comparator", REQUESTS)
def test_losses_are_the_same_in_small_batches_and_nothing_is_simulated_twice(
    comparator: Comparator,
    quadruped: Robot,
    trials: list[Trial],
    three: list[Hypothesis],
    simulated: Batches,
):
    whole = LossTable(Simulator(quadruped, 1), comparator)
    losses = [whole.losses(three, [trial]) for trial in trials]
    needed = hypothesis_bytes(quadruped, comparator.prepare(trials[0]).request, STEPS)
    simulated.clear()
    batched = LossTable(Simulator(quadruped, 1), comparator)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rollout, "batch_bytes", lambda: 2 * needed)
        assert np.array_equal(batched.losses(three, trials), np.concatenate(losses, axis=1))
    assert [len(batch) for batch in simulated] == [2, 1] * len(trials)
    distances = batched.distances([*three[::-1], three[0]], trials)
    assert np.array_equal(distances[2::-1], sum(one.mean(axis=1) for one in losses))
    batched.by_hinge(three, trials)
    batched.by_signal(INTACT, trials)
    assert len(set(itertools.chain(*simulated))) == len(three) * len(trials)
    assert len(simulated) == 2 * len(trials), "nothing is simulated twice"


def test_a_trial_is_known_by_its_content_and_prepared_once(
    quadruped: Robot,
    trials: list[Trial],
    three: list[Hypothesis],
    simulated: Batches,
):
    times: Counter = Counter()

    class Counting:
        name = "counting"

        def prepare(self, trial: Trial) -> PreparedTrial:
            times[trial.trajectory.steps] += 1
            return SENSOR_SERIES.prepare(trial)

    trial, table = trials[0], LossTable(Simulator(quadruped, 1), Counting())
    opening = dataclasses.replace(trial, trajectory=trial.trajectory.first(STEPS // 2))
    position = trial.trajectory["base_position"] + np.linspace(0, 5, STEPS)[:, np.newaxis]
    elsewhere = dataclasses.replace(
        trial, trajectory=changed(trial.trajectory, base_position=position)
    )
    first = table.losses(three, [trial])

    assert np.array_equal(table.losses(three, [dataclasses.replace(trial, path="copy")]), first)
    assert table.losses(three, [opening]).shape[1] < first.shape[1]
    assert len(simulated) == 2, "the opening is another trial"
    assert times == {STEPS: 1, STEPS // 2: 1}
    assert not np.array_equal(table.losses([INTACT], [elsewhere])[0], first[0])


@pytest.mark.parametrize("comparator", [FORWARD_DISPLACEMENT, SEGMENT_PREDICTION, SENSOR_SERIES])
def test_a_hypothesis_that_diverges_is_infinitely_far_and_harms_no_other(
    comparator: Comparator, quadruped: Robot, trials: list[Trial]
):
    alone = LossTable(Simulator(quadruped, 1), comparator).losses([INTACT], trials)
    simulator = Simulator(quadruped, 1)
    bad = exploding(simulator, f"jam:{KNEE}")
    table = LossTable(simulator, comparator)
    losses, hinges = table.losses([bad, INTACT], trials), table.by_hinge([bad, INTACT], trials)

    assert simulator.stats.diverged == len(trials)
    assert np.all(np.isinf(losses[0]))
    assert np.array_equal(losses[1:], alone)
    assert table.distances([bad], trials) == np.inf
    assert table.by_signal(bad, trials) == {}
    assert (hinges is None) == (comparator is not SEGMENT_PREDICTION)
    assert hinges is None or (np.isinf(hinges[0]).all() and np.isfinite(hinges[1]).all())


@pytest.mark.parametrize(
    ("comparator", "message"),
    [
        (Plain(gives=lambda _: 1.0), r"returned losses \(1,\) for 2 simulations"),
        (Plain(gives=lambda n: np.full(n, -1.0)), "not a number of at least 0"),
        (Plain(gives=lambda n: np.full(n, np.nan)), "not a number of at least 0"),
        (in_pieces(lambda n: Losses(np.ones((n, 3)), {}, np.ones((n, 3)))), "losses of hinges"),
        (in_pieces(np.ones), r"returned losses \(2,\) for 2 simulations"),
        (in_pieces(lambda n: np.ones((n + 1, 3))), r"returned losses \(3, 3\) for 2"),
        (in_pieces(lambda n: np.ones((n, 0))), r"returned losses \(2, 0\) for 2"),
        (in_pieces(lambda n: np.full((n, 3), np.nan)), "not a number of at least 0"),
        (Plain(asks=ClosedLoop(())), r"requested the signals \(\), of sensors, commands"),
        (Plain(asks=ClosedLoop(("smell",))), r"requested the signals \('smell',\), of sensors"),
    ],
)
def test_a_comparator_that_breaks_its_contract_is_named_with_what_it_did(
    comparator: Plain, message: str, quadruped: Robot, trials: list[Trial], three: list[Hypothesis]
):
    table = LossTable(Simulator(quadruped, 1), comparator)

    with pytest.raises(InputError, match=f"the comparator 'plain' .*{message}.*check_comparator"):
        table.distances(three[:2], trials)


@settings(max_examples=10)
@given(times=st.tuples(st.floats(-1, 3), st.floats(-1, 3)))
def test_losses_of_a_part_are_the_columns_of_the_whole_within_its_bounds(
    table: LossTable, long: list[Trial], three: list[Hypothesis], times: tuple[float, float]
):
    begin, end = sorted(times)
    trial, other = long
    timeline = table.timeline([trial])
    assert timeline is not None
    inside = (timeline.begin >= begin) & (timeline.end <= end)
    part = TrialPart(trial, begin, end)
    whole, losses = table.losses(three, long), table.losses(three, [part, other])

    pieces = len(timeline.begin)
    np.testing.assert_array_equal(losses[:, : inside.sum()], whole[:, :pieces][:, inside])
    np.testing.assert_array_equal(losses[:, inside.sum() :], whole[:, pieces:])
    hinges = table.by_hinge(three, [part, other])
    np.testing.assert_array_equal(hinges[:, inside.sum() :], table.by_hinge(three, [other]))
    if inside.any():
        expected = whole[:, :pieces][:, inside].mean(axis=1)
        np.testing.assert_allclose(table.distances(three, [part]), expected)


def test_of_a_part_of_a_long_trial_only_its_sections_are_simulated(
    quadruped: Robot,
    long: list[Trial],
    three: list[Hypothesis],
    monkeypatch: pytest.MonkeyPatch,
):
    for module in (requests, segment_prediction):
        monkeypatch.setattr(module, "MAX_CHAIN", 1.0)
    comparator, trial = SEGMENT_PREDICTION_ONBOARD, long[0]
    prepared, simulators = comparator.prepare(trial), [Simulator(quadruped, 1) for _ in range(3)]
    hypotheses = three[::2]  # a detached limb rests where it is at the end of a section
    together = simulate(simulators[0], prepared.request, trial, hypotheses)
    expected = prepared.losses(together.trajectory).total

    whole, part = (LossTable(simulator, comparator) for simulator in simulators[1:])
    np.testing.assert_array_equal(whole.losses(hypotheses, [trial]), expected)
    inside = trial.trajectory.time[prepared.piece_steps[:, 0]] >= 1.5
    after = part.losses(hypotheses, [TrialPart(trial, begin=1.5)])
    np.testing.assert_array_equal(after, expected[:, inside])
    steps = [simulator.stats.steps for simulator in simulators]
    assert steps[2] < 0.6 * steps[1] <= 0.6 * steps[0]


def test_the_timeline_has_the_times_of_the_columns_of_the_losses(
    table: LossTable, long: list[Trial]
):
    timeline = table.timeline(long)
    assert timeline is not None
    counts = [table.losses([INTACT], [trial]).shape[1] for trial in long]

    assert timeline.trial.tolist() == [0] * counts[0] + [1] * counts[1]
    np.testing.assert_allclose(timeline.end - timeline.begin, SEGMENT_PREDICTION.horizon * 0.01)
    for index, trial in enumerate(long):
        inside = timeline.trial == index
        assert timeline.begin[inside][0] == trial.trajectory.time[0]
        assert timeline.end[inside][-1] == trial.trajectory.time[-1]
        assert (np.diff(timeline.begin[inside]) > 0).all()


def test_an_error_within_a_piece_is_in_the_column_of_its_time(
    table: LossTable, long: list[Trial], three: list[Hypothesis]
):
    trial = long[0]
    orientation = trial.trajectory["base_orientation"].copy()
    orientation[100:103] = [0, 1, 0, 0]
    wrong = dataclasses.replace(
        trial, trajectory=changed(trial.trajectory, base_orientation=orientation)
    )
    timeline = table.timeline([wrong])
    assert timeline is not None
    more = table.losses(three[2:], [wrong])[0] > table.losses(three[2:], [trial])[0] + 0.1

    assert more.any()
    assert not more[~((timeline.begin <= 1.02) & (timeline.end >= 1.0))].any()


def test_a_comparator_without_times_has_no_timeline_and_no_signals(
    quadruped: Robot, long: list[Trial], three: list[Hypothesis]
):
    table = LossTable(Simulator(quadruped, 1), FORWARD_DISPLACEMENT)

    assert table.timeline(long) is None
    assert table.by_signal(INTACT, long) == {}
    part = TrialPart(long[0], 1.0, 2.0)
    np.testing.assert_array_equal(table.losses(three, [part]), table.losses(three, long[:1]))


@pytest.mark.parametrize("comparator", [SEGMENT_PREDICTION, SEGMENT_PREDICTION_ONBOARD])
def test_the_losses_of_the_signals_sum_to_the_mean_loss(
    quadruped: Robot, long: list[Trial], comparator: Comparator
):
    table = LossTable(Simulator(quadruped, 1), comparator)
    parts = [TrialPart(long[0], 0.5, 1.7), long[1]]
    losses = table.by_signal(INTACT, parts)

    assert {"commands", "joint_positions", "sensors", "encoder motion"} <= set(losses)
    assert sum(losses.values()).mean() == pytest.approx(table.losses([INTACT], parts).mean())


def test_a_jam_shows_in_its_hinge_and_a_detached_hinge_has_no_losses(
    table: LossTable, long: list[Trial], three: list[Hypothesis]
):
    intact, broken, jam = table.by_hinge(three, long)
    hinges = long[0].trajectory.names.hinges

    assert hinges[int(np.argmax(intact.mean(axis=0)))] == KNEE
    unknown = np.isnan(broken).all(axis=0)
    assert [hinges[column] for column in np.flatnonzero(unknown)] == ["back_left_knee"]
    assert jam.max() < 1e-6, "a jam at the angle of an exact encoder has losses"


PIECES = np.array([[0, 12], [12, 24], [60, 72], [107, 119]])


@pytest.mark.parametrize(
    ("fault", "contradicted"),
    [
        ("", [True, True, True, False]),
        ("=gain0.2", [True, True, True, False]),
        ("=bias0.3", [True, True, True, True]),
    ],
)
def test_a_reading_contradicts_a_fault_of_its_sensor_in_every_piece_with_its_step(
    quadruped: Robot, fault: str, contradicted: list[bool]
):
    sensor = "front_left_touch"
    sensors = np.zeros((120, len(quadruped.anatomy.sensors)))
    sensors[[12, 65], quadruped.anatomy.names.sensors.index(sensor)] = 1.0
    positions = np.zeros((120, len(quadruped.anatomy.hinges)))
    commands = np.zeros((120, len(quadruped.anatomy.motors)))
    trajectory = Trial.from_arrays(quadruped, positions, commands, sensors=sensors).trajectory
    hypothesis = parse(f"sensor:{sensor}{fault}+break:back_left_knee", quadruped.anatomy)

    losses = contradiction_losses([INTACT, hypothesis], trajectory, PIECES)

    assert losses.tolist() == [[0] * 4, [CONTRADICTION * one for one in contradicted]]


def jam_of(robot: Robot, *knees: np.ndarray) -> float | None:
    """The observed jam of a knee with these angles in some trials; other joints stand at 0."""
    trials = []
    for angles in knees:
        positions = np.zeros((90, len(robot.anatomy.hinges)))
        positions[:, robot.anatomy.hinges.index(KNEE)] = angles
        trials.append(
            Trial.from_arrays(robot, positions, np.zeros((90, len(robot.anatomy.motors))))
        )
    jams = {jam.part: jam.severity for jam in observed_faults(trials, robot.anatomy, ())}
    assert jams.keys() - {KNEE} == {joint.name for joint in robot.anatomy.joints} - {KNEE}
    return jams.get(KNEE)


def test_a_jam_is_at_the_median_angle_of_the_last_third_of_the_last_trial(quadruped: Robot):
    moved = np.where(np.arange(90) < 60, np.linspace(-0.4, 0.4, 90), 0.25)
    limit = quadruped.anatomy.joint(KNEE).limits[0][1]

    assert jam_of(quadruped, moved) == 0.25
    assert jam_of(quadruped, moved, np.full(90, -0.1)) == -0.1
    assert jam_of(quadruped, np.full(90, limit + 0.5)) == limit
    assert jam_of(quadruped, np.where(np.arange(90) < 60, 0.2, np.nan)) is None


@pytest.mark.parametrize(
    ("reached", "mixed"),
    [((), ""), (("joint2", "joint3"), ""), (("joint3",), "joint2")],
    ids=["beyond", "reached", "mixed"],
)
def test_the_gain_of_a_servo_is_asked_where_a_limit_tells_it_from_a_weak_motor(
    reached: tuple[str, ...], mixed: str
):
    """Elsewhere the two are equal, and no trial could decide; or not all motors are servos."""
    arm = robot_of(arm_mjcf())
    spec = arm.specification()
    for motor in spec.actuators:
        is_reached = f"joint{motor.name[-1]}" in reached
        motor.forcerange = [-3.0, 3.0] if is_reached else [-1e4, 1e4]
    if mixed:
        spec.add_actuator(name="torque", target=mixed, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    robot = dataclasses.replace(arm, mjcf=spec.to_xml())
    motion = 0.3 * np.sin(np.arange(200)[:, np.newaxis] / 9 + np.arange(7))
    trial = Trial.from_arrays(robot, motion[:, :6], motion[:, : len(robot.anatomy.motors)])
    table = LossTable(Simulator(robot, 1), SEGMENT_PREDICTION)
    problem = problem_of(table, robot, [trial], [], DEFAULT_KINDS)

    asked = {fault.part for fault in problem.space.coarse_candidates if fault.kind == SERVO_GAIN}
    assert asked == set(reached)
    assert (SERVO_GAIN in problem.space.kinds) == bool(reached)
