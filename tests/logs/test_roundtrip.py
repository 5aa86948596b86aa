import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from selfmodel.errors import InputError
from selfmodel.logs import read_log, read_truth
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import TrialWriter, write_trial
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.behaviour import Behaviour, Sample, collect
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import TrialPlan
from tests.logs.conftest import STEPS, made_up, plan_of

ANYTHING = st.floats(allow_nan=True, allow_infinity=True, width=64)


def write_and_read(path: Path, robot: Robot, samples: list[Sample]):
    path.unlink(missing_ok=True)
    write_trial(path, robot, plan_of(robot, len(samples)), samples, TrialHeader(Settings()))
    return read_log(path).trial.behaviour


def assert_same_bits(behaviour: Behaviour, expected: Behaviour):
    assert behaviour.names == expected.names
    assert behaviour.time.tobytes() == expected.time.tobytes()
    assert set(behaviour.signals) == set(SIGNALS)
    for signal in SIGNALS:
        assert behaviour[signal].tobytes() == expected[signal].tobytes(), signal


@settings(max_examples=30, deadline=None)
@given(data=st.data(), steps=st.integers(1, 60))
def test_every_signal_comes_back_to_the_bit_whatever_it_says(
    biped: Robot, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, steps: int
):
    names = biped.anatomy.names
    series = {
        signal: data.draw(arrays(np.float64, (steps, names.width(signal)), elements=ANYTHING))
        for signal in SIGNALS
    }
    samples = [
        Sample(k * biped.control_timestep, {signal: series[signal][k] for signal in SIGNALS})
        for k in range(steps)
    ]
    with np.errstate(invalid="ignore"):  # infinity minus infinity, a displacement of nowhere
        behaviour = write_and_read(tmp_path_factory.mktemp("logs") / "a.mcap", biped, samples)
    assert_same_bits(behaviour, collect(names, samples))


def test_a_simulated_trial_of_every_robot_comes_back_to_the_bit(robot: Robot, tmp_path: Path):
    samples = list(SimulatedRobot(robot).run(plan_of(robot, 101).controller, 101))
    behaviour = write_and_read(tmp_path / "a.mcap", robot, samples)
    assert_same_bits(behaviour, collect(robot.anatomy.names, samples))


@pytest.mark.parametrize("timestep", [0.01, 0.005, 1 / 30, 0.1])
def test_times_come_back_to_the_bit(biped: Robot, tmp_path: Path, timestep: float):
    robot = Robot(
        "biped", biped.mjcf.replace('timestep="0.005"', f'timestep="{timestep!r}"'), timestep
    )
    samples = list(made_up(robot, 333))
    behaviour = write_and_read(tmp_path / "a.mcap", robot, samples)
    assert behaviour.time.tolist() == [sample.time for sample in samples]


def test_a_log_says_what_was_planned_and_with_what(log: Path, biped: Robot, plan: TrialPlan):
    read = read_log(log)
    assert read.trial.plan == plan
    assert read.trial.robot == "biped"
    assert read.mjcf == biped.mjcf
    assert read.control_timestep == biped.control_timestep
    assert read.settings == Settings()
    assert set(read.software) == {"selfmodel", "mujoco", "numpy", "python", "mcap"}
    assert read.status == "finished"
    way = [float(sample.values["base_position"][0]) for sample in made_up(biped, STEPS)]
    assert read.trial.displacement == way[-1] - way[0]
    assert read.trial.path == str(log)


def test_the_same_trial_gives_the_same_bytes(
    log: Path, biped: Robot, plan: TrialPlan, tmp_path: Path
):
    again = tmp_path / "again.mcap"
    samples = made_up(biped, STEPS)
    write_trial(again, biped, plan, samples, TrialHeader(Settings(), hidden="intact"))
    assert again.read_bytes() == log.read_bytes()


def test_the_truth_is_read_only_by_who_asks_for_it(
    log: Path, biped: Robot, plan: TrialPlan, tmp_path: Path
):
    paths = {None: tmp_path / "none" / "trial.mcap", "neuron:0": tmp_path / "other" / "trial.mcap"}
    logs = {"intact": read_log(log)}
    for hidden, path in paths.items():
        path.parent.mkdir()
        samples = made_up(biped, STEPS)
        write_trial(path, biped, plan, samples, TrialHeader(Settings(), hidden=hidden))
        logs[hidden] = read_log(path)
        assert read_truth(path) == hidden
    assert read_truth(log) == "intact"
    descriptions = {json.dumps(visible(read), sort_keys=True) for read in logs.values()}
    assert len(descriptions) == 1


def visible(value: object) -> object:
    """Everything that can be reached from a value, but the folder of its file, as JSON."""
    if isinstance(value, np.ndarray):
        return [value.shape, value.tobytes().hex()]
    if hasattr(value, "items"):
        return {key: visible(item) for key, item in value.items()}
    if hasattr(value, "__dict__"):
        return {key: visible(item) for key, item in vars(value).items() if key != "path"}
    return [visible(item) for item in value] if isinstance(value, tuple) else repr(value)


def test_a_writer_asks_for_no_more_samples_than_planned(biped: Robot, tmp_path: Path):
    asked = []

    def watched() -> Iterator[Sample]:
        for sample in made_up(biped, 100):
            asked.append(sample)
            yield sample

    write_trial(tmp_path / "a.mcap", biped, plan_of(biped, 3), watched(), TrialHeader(Settings()))
    assert len(asked) == 3


@pytest.mark.parametrize(
    ("spoil", "match"),
    [
        (lambda s: Sample(s.time + 1e-12, s.values), r"step 1 of 3 is due at 0\.01 s"),
        (lambda s: Sample(s.time, {}), "must have sensors of shape .* got nothing"),
        (
            lambda s: Sample(s.time, {**s.values, "commands": np.zeros(1)}),
            r"must have commands of shape \(4,\), got \(1,\)",
        ),
    ],
)
def test_a_sample_that_does_not_fit_is_refused(
    biped: Robot, tmp_path: Path, spoil: Callable[[Sample], Sample], match: str
):
    first, second = made_up(biped, 2)
    samples = [first, spoil(second)]
    with pytest.raises(InputError, match=match):
        write_trial(tmp_path / "a.mcap", biped, plan_of(biped, 3), samples, TrialHeader(Settings()))
    assert not (tmp_path / "a.mcap").exists()


def test_a_controller_of_another_robot_is_refused(biped: Robot, quadruped: Robot, tmp_path: Path):
    with pytest.raises(InputError, match="expected a controller for quadruped"):
        TrialWriter(tmp_path / "a.mcap", quadruped, plan_of(biped, 3), TrialHeader(Settings()))


@pytest.mark.parametrize("name", ["", "../evil", "a/b", "a.b", "ä", "x" * 101, "a\n"])
def test_a_name_that_cannot_name_a_file_is_refused(biped: Robot, tmp_path: Path, name: str):
    with pytest.raises(InputError, match="letters, digits and '-'"):
        TrialWriter(tmp_path / "a.mcap", biped, plan_of(biped, 3, name), TrialHeader(Settings()))
