"""The contract of every registered comparator: add one, and it is tested."""

import numpy as np
import pytest

from selfmodel.arrays import FloatArray
from selfmodel.behaviour import SIGNALS, Behaviour
from selfmodel.comparator import ClosedLoop, Comparator
from selfmodel.comparators import COMPARATORS, FORWARD_DISPLACEMENT
from selfmodel.contract import check_comparator
from selfmodel.notation import parse
from selfmodel.robot import Robot
from selfmodel.simulator import Simulator
from selfmodel.trial import Plan, Trial
from tests.conftest import random_controllers

Both = tuple[Trial, Behaviour]


@pytest.fixture(scope="module")
def logged_and_simulated(robot: Robot) -> Both:
    """A trial of a damaged robot, and runs of its controller: with the same damage, and others."""
    joints = [joint.name for joint in robot.anatomy.joints]
    texts = [f"break:{joints[0]}", "intact", f"jam:{joints[1]}", f"break:{joints[2]}"]
    (controller,) = random_controllers(robot, 1)
    runs = [(parse(text, robot.anatomy), controller) for text in texts]
    simulated = Simulator(robot, 2).run(runs, 300, SIGNALS).behaviour
    observed = Behaviour(
        simulated.names, simulated.time, {signal: simulated[signal][0] for signal in SIGNALS}
    )
    plan = Plan("00-after", "after", controller, 300, 0)
    return Trial(plan, robot.name, observed, "nowhere.mcap"), simulated


@pytest.mark.parametrize("name", COMPARATORS)
def test_a_comparator_keeps_its_contract(name: str, logged_and_simulated: Both):
    trial, simulated = logged_and_simulated

    check_comparator(COMPARATORS[name], trial, simulated)
    assert COMPARATORS[name].name == name
    assert isinstance(COMPARATORS[name], Comparator)


@pytest.mark.parametrize("name", COMPARATORS)
def test_a_comparator_tells_some_damage_from_others(name: str, logged_and_simulated: Both):
    trial, simulated = logged_and_simulated

    assert np.all(COMPARATORS[name].distances(simulated, trial)[1:] > 0)


def test_forward_displacement_is_the_difference_of_the_ways(logged_and_simulated: Both):
    trial, simulated = logged_and_simulated
    x = simulated["base_position"][:, :, 0]
    ways = x[:, -1] - x[:, 0]

    np.testing.assert_array_equal(
        FORWARD_DISPLACEMENT.distances(simulated, trial), np.abs(ways - ways[0])
    )


class Broken:
    """A comparator that can break its contract in one way."""

    name = "broken"

    def __init__(self, way: str) -> None:
        self.way = way
        self.calls = 0

    def request(self, _trial: Trial) -> ClosedLoop:
        """Asks for nothing in one way, for what it needs in all others."""
        return ClosedLoop(record=() if self.way == "request" else ("base_position",))

    def distances(self, simulated: Behaviour, trial: Trial) -> FloatArray:
        """Is forward displacement, spoilt."""
        self.calls += 1
        right = FORWARD_DISPLACEMENT.distances(simulated, trial)
        return {
            "shape": right[:, np.newaxis],
            "sign": -right,
            "nan": np.where(right > 0, np.nan, right),
            "offset": right + 1,
            "impure": right * self.calls,
            "crowd": right * len(right),
        }[self.way]


@pytest.mark.parametrize(
    ("way", "said"),
    [
        ("request", "a request must record some of"),
        ("shape", "expected a distance for each of 4 runs"),
        ("sign", "must be finite and at least 0"),
        ("nan", "must be finite and at least 0"),
        ("offset", "must be at 0, got 1"),
        ("impure", "the same arguments must give the same distances"),
        ("crowd", "must not depend on the other runs"),
    ],
)
def test_the_contract_kit_sees_each_way_to_break_it(
    way: str, said: str, logged_and_simulated: Both
):
    with pytest.raises(ValueError, match=said):
        check_comparator(Broken(way), *logged_and_simulated)
