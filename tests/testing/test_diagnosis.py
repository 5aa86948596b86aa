"""Promises of the check of a comparator: what breaks the contract is named."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import selfmodel
from selfmodel.comparators import SENSOR_SERIES
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.faults import JAMMED
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation import ClosedLoop
from selfmodel.testing import check_comparator
from selfmodel.trials.trial import Trial


def reading(signal: str, compared: object = None) -> object:
    """A comparator that reads a signal of the trial, and compares by a function."""

    class Reading:
        name = "reading"
        request = ClosedLoop(record=("sensors",))

        def prepare(self, trial: Trial) -> object:
            trial.trajectory[signal]
            return self

        distances = compared or (lambda _self, runs: np.zeros(len(runs["sensors"])))

    return Reading()


@pytest.mark.parametrize(
    ("compared", "breach"),
    [
        (lambda _self: 0, r"^distances raised TypeError: .*takes 1 positional argument but 2"),
        (lambda _self, _runs: {}["of mine"], "^distances raised KeyError: 'of mine'"),
    ],
)
def test_an_error_of_a_comparator_is_a_breach_that_names_its_method(compared: object, breach: str):
    with pytest.raises(selfmodel.ContractError, match=breach):
        check_comparator(reading("sensors", compared))


@pytest.mark.parametrize("name", ["quadruped", "mine"])
def test_a_comparator_is_checked_on_the_trial_of_a_log(name: str, quadruped: Robot, tmp_path: Path):
    robot = Robot(name, quadruped.mjcf, quadruped.control_timestep)
    walk = Controller(network_for(robot), np.linspace(-1, 1, network_for(robot).weights))
    physical = selfmodel.simulated_robot(robot)
    selfmodel.run_trial(physical, walk, tmp_path / "walk.mcap", robot=robot, steps=60)
    trial = selfmodel.read_log(tmp_path / "walk.mcap").trial

    check_comparator(SENSOR_SERIES, trial)
    told = "unknown recorded signal 'joint_angles': did you mean .*joint_positions"
    with pytest.raises(InputError, match=told):
        check_comparator(reading("joint_angles"), trial)
    with pytest.raises(InputError, match=told):
        selfmodel.diagnose(trial, robot=robot, comparator=reading("joint_angles"))


@pytest.mark.parametrize(
    ("given", "lacks"),
    [
        (SimpleNamespace(prepare=SENSOR_SERIES.prepare), "'SimpleNamespace' .* one without name: "),
        (JAMMED, "'Jammed' is no comparator: .* got one without prepare: "),
        (
            type(SENSOR_SERIES),
            "is no comparator: expected an object, not a class, .* got a class: ",
        ),
    ],
)
def test_an_object_that_is_no_comparator_is_told_what_it_lacks(given: object, lacks: str):
    with pytest.raises(InputError, match=lacks):
        check_comparator(given)


def test_a_comparator_that_depends_on_the_batch_fails_the_check_of_one_argument():
    class Uneven:
        """Distances of the sensor series, less their smallest: the others change each."""

        name = "uneven"

        def prepare(self, trial: Trial) -> object:
            prepared = SENSOR_SERIES.prepare(trial)

            class Ours:
                request = prepared.request

                def distances(self, simulated: selfmodel.Trajectory) -> np.ndarray:
                    found = prepared.losses(simulated)
                    total = getattr(found, "total", found).mean(axis=1)
                    return total * len(total)

            return Ours()

    with pytest.raises(ValueError, match=r"other runs, .* differ by up to 0\.\d+. It may"):
        check_comparator(Uneven())
