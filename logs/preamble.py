"""What a log begins with, written before the robot moves."""

import platform

import mcap
import mujoco
import numpy as np

import selfmodel
from selfmodel.controllers.playback import Playback
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.logfile import LogFile
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    FORMAT,
    GAP,
    HIDDEN,
    IMPORT,
    MAPPING_FILE,
    MODEL_FILE,
    SETTINGS_FILE,
    SOFTWARE,
    TIMED_FORMAT,
    TRIAL,
    TRUTH,
    Imported,
    TrialRecord,
    settings_json,
    sha256,
)
from selfmodel.logs.topics import DESCRIPTION, DESCRIPTION_TYPE, description
from selfmodel.logs.urdf import urdf
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import TrialPlan


def write_preamble(
    log: LogFile,
    robot: Robot,
    plan: TrialPlan,
    *,
    timed: bool,
    settings: Settings,
    hidden: str | None,
    gap: str | None,
    imported: Imported | None,
) -> None:
    """Writes the records, attachments and description that precede the first step.

    Args:
        log: Where to.
        robot: The robot as its model describes it.
        plan: What is to be done.
        timed: Whether it is to be told when each step really happened.
        settings: The paper's numbers.
        hidden: What is wrong with a simulated robot, in notation.
        gap: How else it differs from its model, as JSON.
        imported: Where an imported trial comes from.

    Raises:
        LogWriteError: The disk is full, or failed.
    """
    driver = plan.controller
    controller = b"" if isinstance(driver, Playback) else controller_bytes(driver)
    model = robot.mjcf.encode()
    record = TrialRecord(
        format=TIMED_FORMAT if timed else FORMAT,
        name=plan.name,
        stage=plan.stage,
        robot=robot.name,
        root=robot.root,
        control_timestep=robot.control_timestep,
        steps=plan.steps,
        seed=plan.seed,
        controller_sha256=sha256(controller) if controller else "",
        model_sha256=sha256(model),
    )
    log.metadata(TRIAL, record.texts())
    log.metadata(SOFTWARE, _software())
    secrets = {TRUTH: hidden, GAP: gap}
    if known := {name: text for name, text in secrets.items() if text is not None}:
        log.metadata(HIDDEN, known)
    log.attach(MODEL_FILE, model)
    for name, data in robot.assets.items():
        log.attach(name, data)
    if controller:
        log.attach(CONTROLLER_FILE, controller)
    log.attach(SETTINGS_FILE, settings_json(settings))
    if imported is not None:
        log.metadata(IMPORT, imported.facts)
        log.attach(MAPPING_FILE, imported.mapping.encode())
    log.message(log.channel(DESCRIPTION, DESCRIPTION_TYPE), 0, description(urdf(robot)), 0)


def _software() -> dict[str, str]:
    return {
        "selfmodel": selfmodel.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "mcap": mcap.__version__,
    }
