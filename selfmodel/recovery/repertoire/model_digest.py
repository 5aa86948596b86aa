"""Digests of a robot's model. A repertoire file is read without MuJoCo, and so is its digest."""

import hashlib
from collections.abc import Mapping
from typing import Protocol
from xml.etree import ElementTree as ET  # the model of a robot: MuJoCo has compiled it


class Modelled(Protocol):
    """A robot with all that defines it; a ``Robot``."""

    @property
    def name(self) -> str:
        """Name of the robot."""
        ...

    @property
    def mjcf(self) -> str:
        """The model, as XML."""
        ...

    @property
    def control_timestep(self) -> float:
        """Control time step, s."""
        ...

    @property
    def assets(self) -> Mapping[str, bytes]:
        """Files that the model names."""
        ...


def model_digest(robot: Modelled) -> str:
    """Returns the SHA-256 of all that defines a robot: MJCF, control time step, assets."""
    return _digest(robot.mjcf, robot)


def self_model_digest(robot: Modelled) -> str:
    """Returns the SHA-256 of a robot that is the same for the model in its logs.

    The MJCF of a log is serialised anew when it is read: this is the digest of its canonical form,
    in which order of attributes, comments and space between elements do not matter.
    """
    return _digest(ET.canonicalize(robot.mjcf, strip_text=True), robot)


def _digest(mjcf: str, robot: Modelled) -> str:
    digest = hashlib.sha256()
    parts = [mjcf.encode(), repr(robot.control_timestep).encode()]
    for name, content in sorted(robot.assets.items()):
        parts += [name.encode(), content]
    for part in parts:
        # Digests have a fixed length, so that names and contents cannot be confused.
        digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()
