"""Preamble of a log, written before the robot moves."""

import platform
import secrets

import mcap
import mujoco
import numpy as np

from selfmodel.controllers.playback import Playback
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.messages.topics import DESCRIPTION, DESCRIPTION_TYPE, description
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
    TrialHeader,
    TrialRecord,
    settings_json,
    sha256,
)
from selfmodel.logs.viewers import urdf
from selfmodel.logs.writing.logfile import LogFile
from selfmodel.robot.robot import Robot
from selfmodel.trials.trial import TrialPlan
from selfmodel.version import __version__


def write_preamble(log: LogFile, robot: Robot, plan: TrialPlan, header: TrialHeader) -> None:
    """Writes the records, attachments and robot description that precede the first step.

    Args:
        log: File to write to.
        robot: Robot as its model describes it.
        plan: Plan of the trial.
        header: Other content of the preamble.

    Raises:
        LogWriteError: The disk is full, or failed.
    """
    driver = plan.controller
    controller = b"" if isinstance(driver, Playback) else controller_bytes(driver)
    model = robot.mjcf.encode()
    record = TrialRecord(
        format=TIMED_FORMAT if header.timed else FORMAT,
        name=plan.name,
        stage=plan.stage,
        robot=robot.name,
        root=robot.root,
        control_timestep=robot.control_timestep,
        steps=plan.steps,
        seed=plan.seed,
        controller_sha256=sha256(controller) if controller else "",
        model_sha256=sha256(model),
        nonce="" if _is_repeatable(header) else secrets.token_hex(16),
    )
    log.metadata(TRIAL, record.texts())
    log.metadata(SOFTWARE, _software())
    truths = {TRUTH: header.hidden, GAP: header.gap}
    if known := {name: text for name, text in truths.items() if text is not None}:
        log.metadata(HIDDEN, known)
    log.attach(MODEL_FILE, model)
    for name, data in robot.assets.items():
        log.attach(name, data)
    if controller:
        log.attach(CONTROLLER_FILE, controller)
    log.attach(SETTINGS_FILE, settings_json(header.settings))
    if header.imported is not None:
        log.metadata(IMPORT, header.imported.facts)
        log.attach(MAPPING_FILE, header.imported.mapping.encode())
    log.begin(plan.name)
    channel = log.channel(DESCRIPTION, DESCRIPTION_TYPE)
    log.messages([channel], [(0, 0, 0, description(urdf(robot)))])


def _is_repeatable(header: TrialHeader) -> bool:
    """Returns whether a second trial with the same preamble has the same messages."""
    return not header.timed and (header.hidden is not None or header.imported is not None)


def _software() -> dict[str, str]:
    return {
        "selfmodel": __version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "mcap": mcap.__version__,
    }
