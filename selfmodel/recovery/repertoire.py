"""Repertoire: many diverse gaits of one robot; ``selfmodel.recovery.map_elites`` makes one.

Files of repertoires are read without MuJoCo, which this module does not load.
"""

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET  # the model of a robot: MuJoCo has compiled it

import numpy as np

from selfmodel.arrays import FloatArray, frozen
from selfmodel.controllers.controller import Controller, Design

if TYPE_CHECKING:
    import selfmodel.robot.robot


@dataclass(frozen=True)
class Origin:
    """What determines a repertoire: the arguments of ``make_repertoire``, and selfmodel's version.

    Robot and model are its name and the digest of its model; see ``model_digest``.
    """

    robot: str
    model: str
    steps: int
    evaluations: int
    levels: int
    seed: int
    version: str


@dataclass(frozen=True, eq=False)
class Repertoire:
    """Gaits of one robot with diverse duty factors, sorted by score, best first.

    Attributes:
        design: Design of all controllers.
        genomes: ``(gaits, weights)``.
        scores: Score of each gait of the healthy robot in simulation, ``(gaits,)``.
        descriptors: Duty factor of each foot, 0 to 1, ``(gaits, feet)``.
        origin: What determines the repertoire.

    Raises:
        ValueError: There are no gaits, or the arrays have inconsistent shapes.
    """

    design: Design
    genomes: FloatArray
    scores: FloatArray
    descriptors: FloatArray
    origin: Origin

    def __post_init__(self) -> None:
        gaits = self.scores.size
        if (
            not gaits
            or self.scores.shape != (gaits,)
            or self.genomes.shape != (gaits, self.design.weights)
            or self.descriptors.shape[:-1] != (gaits,)
        ):
            raise ValueError(
                f"expected genomes (gaits, {self.design.weights}), scores (gaits,) and "
                f"descriptors (gaits, feet) of at least one gait, got shapes "
                f"{self.genomes.shape}, {self.scores.shape} and {self.descriptors.shape}"
            )
        order = np.argsort(-self.scores, kind="stable")
        for name in ("genomes", "scores", "descriptors"):
            object.__setattr__(self, name, frozen(getattr(self, name)[order]))

    def __len__(self) -> int:
        return len(self.scores)

    def controller(self, gait: int) -> Controller:
        """Returns the controller of a gait."""
        return Controller(self.design, self.genomes[gait])


def model_digest(robot: "selfmodel.robot.robot.Robot") -> str:
    """Returns the SHA-256 of all that defines a robot: MJCF, control time step, assets."""
    return _digest(robot.mjcf, robot)


def self_model_digest(robot: "selfmodel.robot.robot.Robot") -> str:
    """Returns the SHA-256 of a robot that is the same for the model in its logs.

    The MJCF of a log is serialised anew when it is read: this is the digest of its canonical form,
    in which order of attributes, comments and space between elements do not matter.
    """
    return _digest(ET.canonicalize(robot.mjcf, strip_text=True), robot)


def _digest(mjcf: str, robot: "selfmodel.robot.robot.Robot") -> str:
    digest = hashlib.sha256()
    parts = [mjcf.encode(), repr(robot.control_timestep).encode()]
    for name, content in sorted(robot.assets.items()):
        parts += [name.encode(), content]
    for part in parts:
        # Digests have a fixed length, so that names and contents cannot be confused.
        digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()
