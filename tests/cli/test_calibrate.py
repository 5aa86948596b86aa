"""``selfmodel calibrate``: the model that it writes, and the inputs that it refuses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selfmodel.controllers.playback import played_back
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.tasks import ROBOTS
from selfmodel.trials.signals import Signal
from selfmodel.trials.trajectory import Sample
from selfmodel.trials.trial import Stage, TrialPlan
from tests.helpers.command import printed, refused, succeeds
from tests.helpers.drivers import random_motion

STEPS = 150
SETTINGS = Settings(generations=2).scaled(8)


def write(
    path: Path,
    robot: Robot,
    *,
    stage: Stage = "single",
    level: float = 0.0,
    lost: tuple[Signal, ...] = (),
    physical: Robot | None = None,
) -> Path:
    """Logs a trial in which every joint moves; the physical robot is as its model by default."""
    driver = played_back(robot.anatomy.motors, random_motion(robot, STEPS))
    gap = draw_gap(robot, level, np.random.default_rng(2))
    samples = (
        Sample(
            sample.time,
            {
                signal: np.full_like(row, np.nan) if signal in lost else row
                for signal, row in sample.values.items()
            },
        )
        for sample in SimulatedRobot(physical or robot, gap=gap).run(driver, STEPS)
    )
    return write_trial(
        path, robot, TrialPlan(path.stem, stage, driver, STEPS, 0), samples, TrialHeader(SETTINGS)
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with logs: across a gap, some unseen, one without velocities, of another robot."""
    made = tmp_path_factory.mktemp("calibrate")
    quadruped = ROBOTS["quadruped"].robot()
    write(made / "intact.mcap", quadruped, stage="before", level=0.1)
    write(made / "after.mcap", quadruped, stage="after", level=0.1)
    write(made / "numb.mcap", quadruped, stage="before", lost=("joint_velocities",))
    write(made / "exact.mcap", quadruped)
    contacts = replace(nominal(quadruped), contact_stiffness=2.0, contact_damping=0.25)
    write(made / "hard.mcap", quadruped, physical=with_parameters(quadruped, contacts))
    write(made / "other.mcap", ROBOTS["hexapod"].robot())
    (made / "taken.xml").write_text("mine", encoding="utf-8")
    return made


@pytest.mark.search
def test_a_calibrated_model_is_one_for_replay_and_diagnose(folder: Path):
    found = printed("calibrate", "intact.mcap", "-o", "fit.xml", "--json", cwd=folder)

    assert found["error"] < found["error_before"]
    assert not found["as_it_was"]
    assert len(found["parameters"]) == 4 + 8
    assert all(0 < one["deviation"] <= 0.3 for one in found["parameters"])
    assert {"set", "held_out_gain", "suspicion"} <= set(found)
    assert not (folder / "fit.xml.part").exists()
    fitted = printed("replay", "intact.mcap", "--robot", "fit.xml", "--json", cwd=folder)
    plain = printed("replay", "intact.mcap", "--json", cwd=folder)
    assert fitted["model"] == "fit.xml"
    assert fitted["rms"]["joint_positions"] != plain["rms"]["joint_positions"]
    diagnose = ("diagnose", "after.mcap", "--comparator", "forward-displacement")
    succeeds(*diagnose, "--kinds", "break", "--robot", "fit.xml", cwd=folder)


def test_a_table_says_each_factor_and_how_sure_it_is(folder: Path):
    done = succeeds("calibrate", "exact.mcap", "-o", "same.xml", cwd=folder)

    assert "motor front_left_shoulder" in done.stdout
    assert "not determined by these trials" in done.stdout
    assert "delay, control steps: 0 (0 before)" in done.stdout
    assert "it is written unchanged" in done.stdout


@pytest.mark.search
def test_contacts_that_were_changed_are_printed_and_in_the_model(folder: Path):
    done = succeeds("calibrate", "hard.mcap", "-o", "hard.xml", cwd=folder)

    assert "contacts: stiffness x 2, damping x 0.25" in done.stdout
    assert 'solref="-10000 -75"' in (folder / "hard.xml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["intact.mcap", "-o", "fit.txt"], "--out needs a name that ends in .xml"),
        (["intact.mcap", "-o", "taken.xml"], "taken.xml exists, and is not overwritten"),
        (["intact.mcap", "-o", "no/fit.xml"], "there is no folder no"),
        (["intact.mcap", "other.mcap", "-o", "a.xml"], "the logs are of different robots"),
        (["intact.mcap", "--robot", "hexapod", "-o", "a.xml"], "hexapod is another robot"),
        (["none.mcap", "-o", "a.xml"], "none.mcap"),
        (
            ["intact.mcap", "numb.mcap", "-o", "a.xml"],
            "numb.mcap: calibration needs segments of 16 steps or more, without late steps, with ",
        ),
        (["numb.mcap", "-o", "a.xml"], "the log never has joint_velocities: leave"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_sentence(
    folder: Path, arguments: list[str], sentence: str
):
    refused("calibrate", *arguments, said=sentence, cwd=folder)
    assert not (folder / "a.xml").exists()
    assert (folder / "taken.xml").read_text(encoding="utf-8") == "mine"


def test_a_diagnosis_that_cannot_calibrate_says_how_to_do_without(folder: Path):
    said = "numb.mcap: calibration needs"
    done = refused("diagnose", "numb.mcap", "after.mcap", said=said, cwd=folder)
    assert "leave this log out, or leave the calibration out (--no-calibrate" in done.stderr


def test_a_model_that_names_files_is_refused(tmp_path: Path):
    quadruped = ROBOTS["quadruped"].robot()
    text = with_parameters(quadruped, nominal(quadruped)).mjcf
    points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    asset = '<mesh name="shell" file="shell.obj"/>'
    text = text.replace("<worldbody>", f"<asset>{asset}</asset><worldbody>", 1)
    text = text.replace(
        "</worldbody>", '<geom type="mesh" mesh="shell" pos="50 0 0"/></worldbody>', 1
    )
    robot = Robot("quadruped", text, 0.01, {"shell.obj": points.encode()})
    write(tmp_path / "a.mcap", robot)
    said = "its model names other files (shell.obj)"
    refused("calibrate", "a.mcap", "-o", "fit.xml", said=said, cwd=tmp_path)
    assert not (tmp_path / "fit.xml").exists()
