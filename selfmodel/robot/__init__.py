"""A robot's MuJoCo model: its parts by name, its state by signal, its editable copy."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.robot.anatomy import Anatomy as Anatomy, Joint as Joint, Sensor as Sensor
    from selfmodel.robot.designs import (
        DESIGNS as DESIGNS,
        cpg_for as cpg_for,
        network_for as network_for,
    )
    from selfmodel.robot.mjcf.load import load_mjcf as load_mjcf
    from selfmodel.robot.mjcf.settings import MjcfSettings as MjcfSettings
    from selfmodel.robot.robot import Robot as Robot
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "anatomy": ["Anatomy", "Joint", "Sensor"],
            "designs": ["DESIGNS", "cpg_for", "network_for"],
            "mjcf.load": ["load_mjcf"],
            "mjcf.settings": ["MjcfSettings"],
            "robot": ["Robot"],
        },
    )
