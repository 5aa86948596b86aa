"""Promises of disagreement: it tells hypotheses apart, and no robot is made to fall."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.controllers.controller import Controller
from selfmodel.controllers.network import Network
from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery import next_trial as disagreement
from selfmodel.recovery.next_trial import EARLY_STEPS, Disagreement, disagreements
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation.outcome import SimulationResult
from selfmodel.simulation.simulator import Run, Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import DISAGREEMENT_SCALES, Names, Signal
from tests.helpers.drivers import random_controllers

NAMES = Names(sensors=("touch",), motors=("motor",), hinges=("hinge",))
UP = np.array([0.0, 0.0, 1.0])
HEIGHT = 0.3


@dataclass(frozen=True)
class Fate:
    """What is predicted of a controller.

    Attributes:
        spread: How far the joint's positions under the two hypotheses are apart, rad.
        falls: The step at which the robot falls under the second hypothesis, if it does.
        diverges: Whether the simulation of the second hypothesis does.
        late: Whether they part only after what is read off.
    """

    spread: float
    falls: int | None = None
    diverges: bool = False
    late: bool = False


class Oracle:
    """A simulator that knows the fate of each controller."""

    robot = SimpleNamespace(standing_height=HEIGHT)

    def __init__(self, fates: Sequence[Fate]) -> None:
        network = Network(NAMES.sensors, NAMES.motors)
        weights = np.arange(len(fates)) / 100
        self.controllers = [
            Controller(network, np.full(network.weights, weight)) for weight in weights
        ]
        self._fates = dict(zip(self.controllers, fates, strict=True))

    def run(self, runs: Sequence[Run], steps: int, record: Sequence[Signal]) -> SimulationResult:
        """Predicts what the fates say; only the second hypothesis is not uneventful."""
        known = dict(enumerate(self.controllers))
        shapes = {signal: (len(runs), steps, NAMES.width(signal)) for signal in record}
        signals = {signal: np.zeros(shape) for signal, shape in shapes.items()}
        signals["base_position"][..., 2] = HEIGHT
        signals["base_orientation"][..., 0] = 1
        diverged = np.zeros(len(runs), dtype=bool)
        for row, (hypothesis, driver) in enumerate(runs):
            # What a controller commands is its number.
            controller = known[driver.commands[0, 0]] if isinstance(driver, Playback) else driver
            signals["commands"][row] = self.controllers.index(controller)
            fate = self._fates[controller]
            if hypothesis == INTACT:
                continue
            signals["joint_positions"][row, EARLY_STEPS if fate.late else 0 :] = fate.spread
            if fate.falls is not None:
                signals["base_position"][row, fate.falls :, 2] = 0.4 * HEIGHT
            if fate.diverges:
                diverged[row] = True
                signals["joint_positions"][row, -1] = np.nan
        time = np.arange(steps) * 0.01
        return SimulationResult(Behaviour(NAMES, time, signals), diverged)


def chosen(quadruped: Robot, fates: Sequence[Fate], steps: int = 400) -> int:
    """Which of the controllers with these fates is chosen."""
    oracle = Oracle(fates)
    hypotheses = [INTACT, parse("break:front_left_knee", quadruped.anatomy)]
    with pytest.MonkeyPatch.context() as patch:
        level = SimpleNamespace(normal=UP)
        patch.setattr(disagreement, "build", lambda _robot, _hypothesis: level)
        one = Disagreement(hypotheses, oracle, steps).most_discriminative(oracle.controllers)
    return oracle.controllers.index(one)


def moving(robot: Robot, motor: str) -> Controller:
    """A controller that turns one joint and leaves the others where they are."""
    network, genome = network_for(robot), np.zeros(network_for(robot).weights)
    to_motors = genome[-len(network.motors) * (network.hidden + 1) :]
    to_motors.reshape(len(network.motors), -1)[network.motors.index(motor), -1] = 1.0
    return Controller(network, genome)


def test_the_controller_that_makes_two_hypotheses_differ_is_chosen(quadruped: Robot):
    hypotheses = [INTACT, parse("jam:front_left_knee", quadruped.anatomy)]
    motors = ("back_left_knee", "back_right_knee", "front_left_knee", "front_right_knee")
    pool = [moving(quadruped, motor) for motor in motors]

    one = Disagreement(hypotheses, Simulator(quadruped, 2), 120).most_discriminative(pool)
    assert one == moving(quadruped, "front_left_knee")


def test_a_dead_sensor_is_asked_for_where_it_would_read_most(quadruped: Robot):
    # What the controllers would make of the reading, another motion, is not evidence.
    simulator = Simulator(quadruped, 2)
    hypotheses = [INTACT, parse("sensor:front_left_touch", quadruped.anatomy)]
    pool = random_controllers(quadruped, 12)
    touch = [sensor.name for sensor in quadruped.anatomy.sensors].index("front_left_touch")
    runs = simulator.run([(INTACT, one) for one in pool], EARLY_STEPS, ("sensors",))
    touches = runs.behaviour["sensors"][..., touch].mean(axis=1)

    assert len(set(touches)) > 4
    assert (
        Disagreement(hypotheses, simulator, EARLY_STEPS).most_discriminative(pool)
        == pool[int(np.argmax(touches))]
    )


def test_what_differs_most_is_chosen_and_of_equals_the_first(quadruped: Robot):
    assert chosen(quadruped, [Fate(0.1), Fate(0.2), Fate(0.2), Fate(0.15)]) == 1


def test_what_differs_only_later_counts_for_nothing(quadruped: Robot):
    assert chosen(quadruped, [Fate(0.01), Fate(0.3, late=True)]) == 0


@pytest.mark.parametrize("step", [0, EARLY_STEPS - 1, EARLY_STEPS, 380])
def test_a_controller_with_which_the_robot_falls_at_any_time_is_out(quadruped: Robot, step: int):
    assert chosen(quadruped, [Fate(0.05), Fate(0.2, falls=step), Fate(0.1)]) == 2


def test_a_controller_whose_simulation_diverges_is_out(quadruped: Robot):
    assert chosen(quadruped, [Fate(0.2, diverges=True), Fate(0.1)]) == 1


@pytest.mark.parametrize("steps", [(5, 50, 30), (150, 399, 200), (20, 300, 7)])
def test_where_the_robot_always_falls_the_latest_fall_is_chosen(
    quadruped: Robot, steps: tuple[int, ...]
):
    fates = [Fate(0.3 - 0.1 * k, falls=step) for k, step in enumerate(steps)]

    assert chosen(quadruped, [Fate(0.3, diverges=True), *fates]) == 2


@settings(deadline=None)
@given(seed=st.integers(0, 2**32), hypotheses=st.integers(1, 4), size=st.floats(0, 10))
def test_disagreement_is_a_part_of_one_and_knows_no_order_of_the_hypotheses(
    seed: int, hypotheses: int, size: float
):
    rng = np.random.default_rng(seed)
    shape = (2, hypotheses, 7)
    signals = {
        signal: size * rng.normal(size=(*shape, NAMES.width(signal)))
        for signal in DISAGREEMENT_SCALES
    }
    turned = Rotation.from_rotvec(size * rng.normal(size=(np.prod(shape), 3)))
    signals["base_orientation"] = turned.as_quat(scalar_first=True).reshape(*shape, 4)
    order = rng.permutation(hypotheses)
    time = np.arange(7) * 0.01
    found = disagreements(Behaviour(NAMES, time, signals))
    shuffled = {signal: values[:, order] for signal, values in signals.items()}

    assert np.all((found >= 0) & (found <= 1))
    assert disagreements(Behaviour(NAMES, time, shuffled)) == pytest.approx(found, abs=1e-12)
    if hypotheses == 1 or size == 0:
        assert np.all(found == 0)
