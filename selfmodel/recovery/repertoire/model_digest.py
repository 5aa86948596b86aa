"""Digest of a robot's model. A repertoire file is read without MuJoCo, and so is its digest."""

import hashlib
from collections.abc import Mapping
from typing import Protocol


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
    digest = hashlib.sha256()
    parts = [robot.mjcf.encode(), repr(robot.control_timestep).encode()]
    for name, content in sorted(robot.assets.items()):
        parts += [name.encode(), content]
    for part in parts:
        # Digests have a fixed length, so that names and contents cannot be confused.
        digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()
