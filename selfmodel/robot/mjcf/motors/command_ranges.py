"""Adds command ranges to the motors of an MJCF that have none."""

import mujoco

from selfmodel.errors import InputError
from selfmodel.robot.actuators import command_ranges, has_command_range
from selfmodel.robot.mjcf.document.document import Document
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.mujoco_errors import compile_model


def add_command_ranges(document: Document, model: mujoco.MjModel, settings: MjcfSettings) -> None:
    """Adds the ``ctrlrange`` of the settings to each motor without a command range.

    Args:
        document: The MJCF, edited in place.
        model: The compiled document.
        settings: Settings with the command range.

    Raises:
        InputError: A motor has no command range, and the settings contain no command range.
    """
    if settings.ctrlrange is not None:
        ends = f"{settings.ctrlrange[0]!r} {settings.ctrlrange[1]!r}"
        for motor, element in enumerate(document.children("actuator")):
            if not has_command_range(model, motor):
                element.set("ctrlrange", ends)
                element.set("ctrllimited", "true")
    try:
        command_ranges(compile_model(document.text, document.assets))
    except InputError as error:
        raise InputError(
            f"{error}; or set ctrlrange=[-1, 1] for all motors without a command range"
        ) from error
