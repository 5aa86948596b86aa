"""What a log begins with, written before the robot moves."""

import platform

import mcap
import mujoco
import numpy as np

import selfmodel
from selfmodel.controller import Controller
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.logfile import LogFile
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    FORMAT,
    HIDDEN,
    IMPORT,
    MAPPING_FILE,
    MODEL_FILE,
    SETTINGS_FILE,
    SOFTWARE,
    TRIAL,
    TRUTH,
    Imported,
    TrialRecord,
    settings_json,
    sha256,
)
from selfmodel.logs.topics import DESCRIPTION, DESCRIPTION_TYPE, description
from selfmodel.logs.urdf import urdf
from selfmodel.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trial import Plan


def write_preamble(
    log: LogFile,
    robot: Robot,
    plan: Plan,
    settings: Settings,
    hidden: str | None,
    imported: Imported | None,
) -> None:
    """Writes the records, attachments and description that precede the first step.

    When this returns, the disk has them.

    Raises:
        LogWriteError: The disk is full, or failed.
    """
    driver = plan.controller
    controller = controller_bytes(driver) if isinstance(driver, Controller) else b""
    model = robot.mjcf.encode()
    record = TrialRecord(
        format=FORMAT,
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
    if hidden is not None:
        log.metadata(HIDDEN, {TRUTH: hidden})
    log.attach(MODEL_FILE, "application/xml", model)
    if controller:
        log.attach(CONTROLLER_FILE, "application/octet-stream", controller)
    if imported is not None:
        log.metadata(IMPORT, imported.facts)
        log.attach(MAPPING_FILE, "application/toml", imported.mapping.encode())
    log.attach(SETTINGS_FILE, "application/json", settings_json(settings))
    log.message(log.channel(DESCRIPTION, DESCRIPTION_TYPE), 0, description(urdf(robot)), 0)
    log.sync()


def _software() -> dict[str, str]:
    return {
        "selfmodel": selfmodel.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "mcap": mcap.__version__,
    }
