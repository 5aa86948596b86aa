"""A simulated trial, recorded as a driver would and imported again, still tells what is wrong."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.comparators import DEFAULT
from selfmodel.controllers.controller import Controller
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log, save_controller
from selfmodel.logs.recordings.importer import import_recording
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.logs.recordings.suggest import suggest
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import Trajectory, collect
from tests.helpers.command import printed, refused, succeeds
from tests.helpers.drivers import random_controllers
from tests.logs.recordings.driver import mapping, record

STEPS = 400
TRUTH = "break:front_left_knee"


@pytest.fixture(scope="module")
def gait(quadruped: Robot) -> Controller:
    return random_controllers(quadruped, 3, seed=5)[0]


@pytest.fixture(scope="module")
def truth(quadruped: Robot) -> Hypothesis:
    return parse(TRUTH, quadruped.anatomy)


@pytest.fixture(scope="module")
def simulated(quadruped: Robot, truth: Hypothesis, gait: Controller) -> Trajectory:
    """The trial as it was, and three more steps."""
    samples = SimulatedRobot(quadruped, truth).run(gait, STEPS + 3)
    return collect(quadruped.anatomy.names, samples)


@pytest.fixture(scope="module")
def driven(
    quadruped: Robot,
    simulated: Trajectory,
    gait: Controller,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """The trial as a driver recorded it, beside its mapping and its controller."""
    folder = tmp_path_factory.mktemp("driven")
    save_controller(folder / "gait.npz", gait)
    (folder / "map.toml").write_text(mapping(quadruped, STEPS, "gait.npz"))
    return record(folder / "bag", quadruped, simulated)


def test_what_is_imported_is_what_was_simulated(
    quadruped: Robot, driven: Path, simulated: Trajectory
):
    text = mapping(quadruped, STEPS, None)
    found = import_recording(driven, parse_mapping(text, "map.toml"), quadruped).trajectory
    assert found.steps == STEPS
    for signal, tolerance in (
        ("commands", 0),
        ("joint_positions", 2e-3),  # rad: a line between samples 5 ms apart
        ("base_position", 1e-9),  # m: a message at each step
        ("base_orientation", 1e-9),
    ):
        error = np.abs(found[signal] - simulated[signal][:STEPS])
        assert np.median(error) <= tolerance, signal
        assert np.max(error) <= 20 * tolerance, signal  # while a foot hits the ground
    touch = [k for k, name in enumerate(found.names.sensors) if name.endswith("touch")]
    assert np.array_equal(found["sensors"][:, touch], simulated["sensors"][:STEPS, touch])
    displacement = [
        b["base_position"][STEPS - 1, 0] - b["base_position"][0, 0] for b in (found, simulated)
    ]
    assert displacement[0] == pytest.approx(displacement[1], abs=1e-3)  # m


@pytest.mark.search
def test_the_right_fault_is_found_in_an_imported_trial(
    quadruped: Robot, driven: Path, truth: Hypothesis, tmp_path: Path
):
    log = tmp_path / "trial.mcap"
    mapped = ("--mapping", driven.parent / "map.toml")
    facts = printed("logs", "import", driven, *mapped, "-o", log, "--json", cwd=tmp_path)
    assert facts["valid"]["joint_positions"] == facts["valid"]["base_position"] == 1
    assert facts["topics"]["/odom"]["latency"] == pytest.approx(0.015)
    trial = read_log(log).trial
    diagnose = DiagnosticSearch(
        Simulator(quadruped, threads=2), DEFAULT, Settings(generations=12).scaled(50)
    )
    diagnosis = diagnose([trial], [], np.random.default_rng(0), lambda _: None)
    assert diagnosis.best == truth


def test_the_suggested_mapping_needs_only_what_is_marked(quadruped: Robot, driven: Path):
    text = suggest(driven, quadruped, "quadruped", with_timestep=False)
    assert "CHANGE must" in text
    assert text.count("CHANGE") == 1  # nothing else
    mapped = parse_mapping(text, "map.toml")
    right = parse_mapping(mapping(quadruped, STEPS, None), "map.toml")
    places = [
        {quantity: (place.topic, place.columns) for quantity, place in found.places.items()}
        for found in (mapped, right)
    ]
    assert places[0] == places[1]
    assert import_recording(driven, mapped, quadruped).trajectory.steps > STEPS


def test_the_command_suggests_imports_and_reports(driven: Path, tmp_path: Path):
    done = succeeds("logs", "import", driven, "--suggest", "--robot", "quadruped", cwd=tmp_path)
    (tmp_path / "map.toml").write_text(done.stdout)
    arguments = ("logs", "import", driven, "--mapping", "map.toml", "-o", "trial.mcap")
    done = succeeds(*arguments, cwd=tmp_path)
    assert max(map(len, done.stdout.partition("note:")[0].splitlines())) <= 80
    assert "start pose" in done.stdout  # the suggestion knows no offsets
    refused(*arguments, said="trial.mcap exists, and is not overwritten", cwd=tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('robot = "quadrupet"', "map.toml:1: unknown robot 'quadrupet': did you mean"),
        (
            'robot = "quadruped"\ncontrol_timestep = 0.01',
            "map.toml:2: quadruped has a control time step of its own",
        ),
        ('robot = "r.xml"', "map.toml:1: r.xml has no control time step"),
        (
            'robot = "r.xml"\ncontrol_timestep = 0.01',
            "map.toml:1: .*r.xml: the model has no actuators",
        ),
        ('robot = "quadruped"\ncontroller = "g.npz"', "map.toml:2: .*g.npz: expected a controller"),
    ],
)
def test_what_a_mapping_names_must_be_there(
    text: str, message: str, quadruped: Robot, driven: Path, tmp_path: Path
):
    (tmp_path / "r.xml").write_text("<mujoco/>")
    rest = mapping(quadruped, STEPS, None).partition("\n")[2]
    (tmp_path / "map.toml").write_text(f"{text}\n{rest}")
    arguments = ("logs", "import", driven, "--mapping", "map.toml", "-o", "t.mcap")
    done = refused(*arguments, said=message.partition(".*")[0], cwd=tmp_path)
    assert message.partition(".*")[2] in done.stderr
    assert not (tmp_path / "t.mcap").exists()
