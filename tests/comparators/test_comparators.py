"""The contract of every registered comparator: add one, and it is tested."""

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from selfmodel.arrays import FloatArray
from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT, SEGMENT_PREDICTION
from selfmodel.comparators.paper import MIN_ERROR, READINGS, RELATIVE_ERROR, PaperSensors
from selfmodel.comparators.sensor_series import geman_mcclure
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.diagnosis.losses import simulate
from selfmodel.diagnosis.significance import NEGLIGIBLE_LOSS
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.testing import check_comparator, shown
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory, forward_displacement
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.comparators import Prepared, PreparedPieces, distances_of
from tests.helpers.drivers import random_controllers
from tests.helpers.gaits import batch, changed, gait, logged

Both = tuple[Trial, Trajectory]


def hypotheses_about(robot: Robot) -> list[str]:
    """The damage of the trial, and others."""
    joints = [joint.name for joint in robot.anatomy.joints]
    return [f"break:{joints[0]}", "intact", f"jam:{joints[1]}", f"break:{joints[2]}"]


@pytest.fixture(scope="module")
def logged_and_simulated(quadruped: Robot) -> Both:
    return both_of(quadruped)


def both_of(robot: Robot) -> Both:
    """A trial of a damaged robot, and runs of its controller: with the same damage, and others."""
    # No joint oscillates at every step: such joints are taken for noisy, and averaged.
    controller = random_controllers(robot, 5)[4]
    runs = [(parse(text, robot.anatomy), controller) for text in hypotheses_about(robot)]
    simulated = Simulator(robot, 2).run(runs, 300, SIGNALS).trajectory
    plan = TrialPlan("00-after", "after", controller, 300, 0)
    return Trial(plan, robot.name, simulated.run(0), "nowhere.mcap"), simulated


def with_the_perfect_one(outcome: Trajectory, perfect: Trajectory) -> Trajectory:
    """The simulations with another one before them."""
    signals = {
        signal: np.concatenate([perfect[signal], values])
        for signal, values in outcome.signals.items()
    }
    return Trajectory(outcome.names, outcome.time, signals, **with_none_fixed(outcome))


def with_none_fixed(outcome: Trajectory) -> dict[str, np.ndarray | None]:
    """The hinges that the hypotheses fix, with those of the healthy robot before them."""
    return {
        name: None if mask is None else np.concatenate([np.zeros_like(mask[:1]), mask])
        for name, mask in (("welded", outcome.welded), ("detached", outcome.detached))
    }


@pytest.mark.parametrize("name", COMPARATORS)
def test_a_comparator_keeps_its_contract(name: str, quadruped: Robot, logged_and_simulated: Both):
    keeps_its_contract(name, quadruped, logged_and_simulated[0])


@pytest.mark.parametrize("name", COMPARATORS)
def test_a_comparator_is_a_value_equal_to_its_copy_and_a_key(name: str):
    comparator = COMPARATORS[name]
    assert {comparator: name}[copy.deepcopy(comparator)] == name


def test_the_contract_is_kept_for_joints_of_several_hinges():
    robot = ROBOTS["hexapod"].robot()
    keeps_its_contract(SEGMENT_PREDICTION.name, robot, both_of(robot)[0])


def keeps_its_contract(name: str, robot: Robot, trial: Trial) -> None:
    """Raises an error for a comparator that breaks its contract on a trial of a robot."""
    comparator = COMPARATORS[name]
    prepared = comparator.prepare(trial)
    request = prepared.request
    hypotheses = [parse(text, robot.anatomy) for text in hypotheses_about(robot)]
    outcome = simulate(Simulator(robot, 2), request, trial, hypotheses).trajectory

    check_comparator(comparator, trial, with_the_perfect_one(outcome, shown(request, trial)))
    distances = distances_of(prepared, outcome)
    assert np.all(distances[1:] > distances[0]), "other damage is as close as the truth"
    if isinstance(request, ClosedLoop):
        assert distances[0] == 0
    # No member of an ensemble is the robot, and a base that is carried on drifts.
    elif isinstance(request, Segments) and "base_position" in request.states:
        assert distances[0] < NEGLIGIBLE_LOSS
    assert comparator.name == name
    assert isinstance(comparator, Comparator)


def test_the_displacement_has_a_fifth_of_the_distance_of_all_that_the_papers_robots_measure(
    logged_and_simulated: Both,
):
    trial, simulated = logged_and_simulated
    windows = READINGS.prepare(trial).losses(simulated)
    losses = PaperSensors().prepare(trial).losses(simulated)
    far = np.abs(forward_displacement(simulated) - trial.displacement)
    end = geman_mcclure(far / max(RELATIVE_ERROR * abs(trial.displacement), MIN_ERROR))

    assert end.max() > 0.1
    assert losses.shape == (len(windows), windows.shape[1] + 1)
    assert np.allclose(losses.mean(axis=1), 0.8 * windows.mean(axis=1) + 0.2 * end)


def test_forward_displacement_is_the_difference_of_the_ways(logged_and_simulated: Both):
    trial, simulated = logged_and_simulated
    x = simulated["base_position"][:, :, 0]
    ways = x[:, -1] - x[:, 0]

    np.testing.assert_array_equal(
        distances_of(FORWARD_DISPLACEMENT.prepare(trial), simulated), np.abs(ways - ways[0])
    )


@pytest.mark.parametrize(
    ("name", "least"),
    # A lag compares neighbours of unobserved values.
    [("sensor-series", 0.01), ("paper-sensors", 0.01), ("gait-pattern", 0), ("noisy-transfer", 0)],
)
def test_what_was_not_observed_is_not_compared(name: str, least: float):
    walking = gait()
    hidden = {signal: walking[signal].copy() for signal in ("sensors", "joint_positions")}
    for values, column, rows in zip(hidden.values(), (2, 1), ((0, 120), (300, 350)), strict=True):
        values[:, column] = values[slice(*rows)] = np.nan
    trial = logged(changed(walking, **hidden))
    prepared = COMPARATORS[name].prepare(trial)
    strange, lost = (
        changed(
            walking,
            **{each: np.where(np.isnan(hidden[each]), value, walking[each]) for each in hidden},
        )
        for value in (7.0, 5.0 if least else np.nan)
    )
    readings = walking["sensors"].copy()
    readings[200:260, 0] = 1 - readings[200:260, 0]
    runs = batch(walking, strange, lost, changed(walking, sensors=readings))
    if isinstance(prepared.request, Ensemble):
        each = {
            signal: np.repeat(values[:, np.newaxis], prepared.request.members, axis=1)
            for signal, values in runs.signals.items()
        }
        runs = Trajectory(runs.names, runs.time, each)

    check_comparator(COMPARATORS[name], trial, runs)
    distances = distances_of(prepared, runs)
    assert np.all(distances[:3] <= least * distances[3])
    assert distances[3] > 0


class Broken:
    """A comparator with distances or losses that can break its contract in one way."""

    name = "broken"

    def __init__(self, way: str, made: Callable[..., object]) -> None:
        self.way, self.made = way, made
        self.calls = self.prepared = 0

    def prepare(self, trial: Trial) -> object:
        """Prepares as forward displacement, spoilt."""
        self.prepared += 1
        sound, time = FORWARD_DISPLACEMENT.prepare(trial), self.prepared
        if self.way == "nothing":
            return None
        if self.way == "trial":
            trial.trajectory["base_position"][0] = 0

        def compared(simulated: Trajectory) -> FloatArray:
            self.calls += 1
            right = sound.distances(simulated)
            if self.made is PreparedPieces:
                right = np.stack([right, right], axis=1)
            if self.way == "simulated":
                simulated["base_position"][:, 1] = 0
            return {
                "shape": right[..., np.newaxis],
                "none": right[..., :0],
                "sign": -right,
                "nan": np.where(right > 0, np.nan, right),
                "offset": right + 1,
                "impure": right * (1 + 1e-15 * self.calls),
                "crowd": right * (1 + 1e-15 * len(right)),
                "again": right * time,
            }.get(self.way, right)

        record: tuple[Signal, ...] = () if self.way == "request" else ("base_position",)
        if self.way == "unsteady" and time > 1:
            record = ("base_position", "sensors")
        if self.way == "sections":
            return SimpleNamespace(
                request=ClosedLoop(record), distances=compared, sections=("without piece_steps",)
            )
        return self.made(ClosedLoop(record), compared)


@pytest.mark.parametrize(
    ("way", "made", "message"),
    [
        (
            *("nothing", Prepared),
            "prepare must return an object with request and losses or distances, got None",
        ),
        ("request", Prepared, "a request of ClosedLoop must record some of"),
        ("unsteady", Prepared, "the same trial must be prepared with the same request"),
        ("sections", Prepared, "the sections of a trial must have its piece_steps"),
        ("shape", Prepared, "distances must have shape .* with n = 4"),
        ("shape", PreparedPieces, "losses must have shape"),
        ("none", PreparedPieces, "losses must have shape"),
        ("sign", Prepared, "distances must be finite and at least 0"),
        ("sign", PreparedPieces, "losses must be finite and at least 0"),
        ("nan", Prepared, "must be finite and at least 0"),
        ("offset", Prepared, "must be 0, got 1"),
        ("impure", Prepared, "must give the same distances"),
        ("impure", PreparedPieces, "must give the same losses"),
        ("crowd", Prepared, "must not depend on the other runs"),
        ("crowd", PreparedPieces, "the losses of run 1 must not depend on the other runs"),
        ("again", Prepared, "the same trial and arguments must give the same distances"),
        ("simulated", Prepared, "a comparator must not change its arguments"),
        ("trial", Prepared, "a comparator must not change the trial"),
    ],
)
def test_the_contract_kit_sees_each_way_to_break_it(
    way: str, made: Callable[..., object], message: str, logged_and_simulated: Both
):
    trial, simulated = logged_and_simulated
    own = replace(trial, trajectory=copied(trial.trajectory))
    with pytest.raises(ValueError, match=message):
        check_comparator(Broken(way, made), own, copied(simulated))


def copied(trajectory: Trajectory) -> Trajectory:
    signals = {signal: values.copy() for signal, values in trajectory.signals.items()}
    return Trajectory(trajectory.names, trajectory.time, signals)


@dataclass(frozen=True)
class Asking:
    """A comparator of any request."""

    asks: object
    name: str = "asking"

    def prepare(self, _trial: Trial) -> PreparedPieces:
        """Requests what it was made with."""
        return PreparedPieces(self.asks, lambda simulated: simulated["joint_positions"])


def runs_of_shape(trial: Trial, *lengths: int) -> Trajectory:
    """Two runs of joints that stand still."""
    names = trial.trajectory.names
    values = np.zeros((2, *lengths, len(names.hinges)))
    return Trajectory(names, np.arange(lengths[-1]) * 0.01, {"joint_positions": values})


def segments(trial: Trial, horizon: int = 25) -> Segments:
    """Three segments of a trial."""
    names = trial.trajectory.names
    return Segments(
        states={"joint_positions": np.zeros((3, len(names.hinges)))},
        commands=np.zeros((trial.trajectory.steps, len(names.motors))),
        starts=np.array([0, 10, 20]),
        horizon=horizon,
        record=("joint_positions",),
    )


ENSEMBLE = Ensemble(("joint_positions",), members=4, level=0.05)


def test_the_contract_kit_wants_what_was_requested(logged_and_simulated: Both):
    trial, _ = logged_and_simulated

    with pytest.raises(ValueError, match=r"for a request of Segments, .* \(n, 3, 26, width\)"):
        check_comparator(Asking(segments(trial)), trial, runs_of_shape(trial, 300))
    with pytest.raises(ValueError, match=r"a request of Ensemble, .* \(n, 4, 300, width\)"):
        check_comparator(Asking(ENSEMBLE), trial, runs_of_shape(trial, 300))


def test_the_contract_kit_sees_a_request_that_cannot_be_met(logged_and_simulated: Both):
    trial, simulated = logged_and_simulated
    unknown = segments(trial)
    unknown.commands[0] = np.nan
    narrow = replace(segments(trial), commands=np.zeros((300, 1)))
    late = replace(segments(trial), starts=np.array([0, 10, 275]))
    fewer = replace(segments(trial), states={"joint_positions": np.zeros((2, 1))})
    broken: list[tuple[object, str]] = [
        ("joint_positions", "must be a ClosedLoop, Segments or an Ensemble"),
        (replace(ENSEMBLE, members=0), "at least one member"),
        (segments(trial, horizon=0), "a horizon of at least 1 step"),
        (late, "from 0 to 274"),
        (unknown, "must be finite"),
        (narrow, "the commands of segments must be those of the trial"),
        (fewer, "the states of joint_positions must have shape"),
        (replace(segments(trial), record=("commands",)), "Segments must record some of"),
    ]
    for asks, message in broken:
        with pytest.raises(ValueError, match=message):
            check_comparator(Asking(asks), trial, simulated)


def test_what_a_trial_shows_is_cut_where_its_segments_begin(logged_and_simulated: Both):
    trial, _ = logged_and_simulated
    rows, signals = np.array([7, 40, 41]), ("joint_positions", "joint_velocities")
    logged = trial.trajectory
    asks = Segments(
        states={signal: logged[signal][rows] for signal in signals},
        commands=logged["commands"],
        starts=rows,
        horizon=10,
        record=("base_position", "sensors"),
    )
    perfect = shown(asks, trial)

    assert perfect["sensors"].shape == (1, 3, 11, len(logged.names.sensors))
    for segment, row in enumerate(rows):
        np.testing.assert_array_equal(
            perfect["base_position"][0, segment], logged["base_position"][row : row + 11]
        )
