"""Distributions of the parameters of a robot's model around those of its self-model."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.parameters import from_factors, model_with_parameters
from selfmodel.robot.robot import Robot
from selfmodel.robot.scaling import scale_contacts


@dataclass(frozen=True, eq=False)
class ModelDraw:
    """Parameters of a robot's model, relative to those of its self-model.

    Attributes:
        factors: Logarithms of the factors of ``Parameters.factors``, ``(4 + motors,)``.
        masses: Logarithms of a further factor of the mass of each body, ``(bodies,)``.
        inertias: Logarithms of a further factor of the inertia of each body, ``(bodies,)``.
        contacts: Logarithms of the factors of the stiffness and of the damping of contacts,
            ``(2,)``.
    """

    factors: FloatArray
    masses: FloatArray
    inertias: FloatArray
    contacts: FloatArray = field(default_factory=lambda: np.zeros(2))

    @property
    def differs(self) -> bool:
        """Whether a parameter differs from the self-model's."""
        logs = (self.factors, self.masses, self.inertias, self.contacts)
        return any(own.any() for own in logs)

    def applied_to(self, robot: Robot, model: mujoco.MjModel) -> mujoco.MjModel:
        """Returns a copy of a model with these parameters.

        Args:
            robot: The self-model.
            model: The self-model's compiled model, or one with edits of its specification.
        """
        parameters = from_factors(np.exp(self.factors), robot.control_delay)
        scaled = model_with_parameters(robot, parameters, model)
        scaled.body_mass *= np.exp(self.masses)
        scaled.body_inertia *= np.exp(self.inertias)[:, np.newaxis]
        scale_contacts(scaled, *np.exp(self.contacts).tolist())
        mujoco.mj_setConst(scaled, mujoco.MjData(scaled))
        return scaled


class ModelDistribution(Protocol):
    """Distribution of a model's parameters."""

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        ...

    def draw(self, rng: np.random.Generator) -> ModelDraw:
        """Returns random parameters."""
        ...


@dataclass(frozen=True, eq=False)
class LogNormal:
    """Independent log-normal factors with a median of 1.

    Attributes:
        factors: Standard deviation of the logarithm of each factor of ``Parameters.factors``,
            ``(4 + motors,)``.
        bodies: Standard deviation of the logarithm of the further factor of the mass, and of that
            of the inertia, of each body, ``(bodies,)``.
        contacts: Standard deviation of the logarithm of the factors of the stiffness and of the
            damping of contacts.
    """

    factors: FloatArray
    bodies: FloatArray
    contacts: float = 0.0

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        return not (self.factors.any() or self.bodies.any() or self.contacts)

    def draw(self, rng: np.random.Generator) -> ModelDraw:
        """Returns random parameters."""
        return ModelDraw(
            self.factors * rng.standard_normal(len(self.factors)),
            self.bodies * rng.standard_normal(len(self.bodies)),
            self.bodies * rng.standard_normal(len(self.bodies)),
            # Contacts that are known take no random numbers.
            self.contacts * (rng.standard_normal(2) if self.contacts else np.zeros(2)),
        )


@dataclass(frozen=True, eq=False)
class Weighted:
    """A weighted sample of models.

    Attributes:
        models: The models.
        weights: Their probabilities, ``(models,)``, with a sum of 1.
    """

    models: Sequence[ModelDraw]
    weights: FloatArray

    @property
    def is_exact(self) -> bool:
        """Whether all draws are the self-model."""
        return not any(model.differs for model in self.models)

    def draw(self, rng: np.random.Generator) -> ModelDraw:
        """Returns one of the models."""
        return self.models[int(rng.choice(len(self.models), p=self.weights))]


def exact(robot: Robot) -> LogNormal:
    """Returns the distribution of a robot whose parameters are those of its self-model."""
    return LogNormal(np.zeros(4 + robot.model.nu), np.zeros(robot.model.nbody))
