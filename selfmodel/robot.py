"""A robot: an MJCF model, its parts by name, and its rhythm."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from selfmodel.anatomy import Anatomy
from selfmodel.carried import check_carried
from selfmodel.commands import command_ranges
from selfmodel.controller import Network
from selfmodel.dissection import driven_joints, read_anatomy
from selfmodel.embodiment import Embodiment, embody
from selfmodel.errors import InputError
from selfmodel.hypothesis import INTACT, Hypothesis
from selfmodel.mjcf import Adapted, MjcfSettings, adapt, read_settings
from selfmodel.neurons import hidden_neurons
from selfmodel.oscillators import Cpg
from selfmodel.roots import find_root

CONTROL_DELAY = "selfmodel_control_delay"
"""The custom numeric of an MJCF that says how many control steps a command takes to its effect."""

LONGEST_DELAY = 5
"""Control steps that it may say: as many as segments have commands from before their start."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A body plan with nothing wrong, and how often it is controlled.

    Everything but the control time step is read from the MJCF, so a log that carries both carries
    the robot. Forward is the world's x axis at the start.

    Attributes:
        name: What it is called.
        mjcf: The model, as one XML text that needs no files but the assets.
        control_timestep: Seconds between two commands.
        assets: The files that the model names, such as meshes.
        model: The compiled model.
        anatomy: Its joints, sensors and motors.
        root: Its root body, whose travel counts.
    """

    name: str
    mjcf: str
    control_timestep: float
    assets: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    model: mujoco.MjModel = field(init=False, repr=False)
    anatomy: Anatomy = field(init=False, repr=False)
    root: str = field(init=False)

    def __post_init__(self) -> None:
        model = mujoco.MjModel.from_xml_string(self.mjcf, dict(self.assets))
        if not model.opt.timestep > 0:
            raise ValueError(f"the physics time step must be above 0 s, got {model.opt.timestep}")
        root = find_root(model, driven_joints(model))
        check_carried(model, root)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "anatomy", read_anatomy(model, root, hidden_neurons(model)))
        object.__setattr__(self, "root", str(model.body(root).name))
        delay = _said_delay(model)
        if not (delay.is_integer() and 0 <= delay <= LONGEST_DELAY):
            raise ValueError(
                f"{CONTROL_DELAY} must be a whole number from 0 to {LONGEST_DELAY}, got {delay:g}"
            )
        if not np.isclose(self.substeps * model.opt.timestep, self.control_timestep, rtol=1e-9):
            raise ValueError(
                f"the control time step {self.control_timestep} s must be a multiple of the "
                f"physics time step {model.opt.timestep} s"
            )

    @classmethod
    def from_mjcf(cls, path: Path | str, settings: MjcfSettings | None = None) -> "Robot":
        """Returns the robot that an MJCF file describes, whoever wrote it; see docs/robots.md.

        Args:
            path: The file, which is not changed. It may name others in its folder and below.
            settings: What the file itself does not tell; None for those of the TOML beside it.

        Raises:
            InputError: No robot can be made of it; the sentence says why, and what to do.
        """
        file = Path(path)
        return cls.from_adapted(
            adapt(file, read_settings(file) if settings is None else settings), str(file)
        )

    @classmethod
    def from_adapted(cls, adapted: Adapted, where: str) -> "Robot":
        """Returns the robot of an MJCF that was made ready.

        Args:
            adapted: As ``mjcf.adapt`` or ``mjcf.adapt_text`` returns it.
            where: What a refusal calls it.

        Raises:
            InputError: No robot can be made of it after all.
        """
        try:
            return cls(adapted.name, adapted.mjcf, adapted.control_timestep, adapted.assets)
        except ValueError as error:
            raise InputError(f"{where}: {' '.join(str(error).split())}") from error

    @property
    def substeps(self) -> int:
        """Physics steps in a control step."""
        return max(1, round(self.control_timestep / float(self.model.opt.timestep)))

    @property
    def control_delay(self) -> int:
        """Control steps from a command to its effect, as the model's ``CONTROL_DELAY`` says."""
        return int(_said_delay(self.model))

    @property
    def is_calibrated(self) -> bool:
        """Whether a calibration wrote the model, and with it a ``CONTROL_DELAY``."""
        found: int = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_NUMERIC, CONTROL_DELAY)
        return found >= 0

    @property
    def network(self) -> Network:
        """The network that controls it.

        Raises:
            InputError: A motor does not say what it may be commanded.
        """
        names, ranges = self.anatomy.names, command_ranges(self.model)
        return Network(names.sensors, names.motors, self.anatomy.neurons, ranges)

    @property
    def cpg(self) -> Cpg:
        """The oscillators that can control it in the network's place.

        Raises:
            InputError: A motor does not say what it may be commanded.
        """
        names, ranges = self.anatomy.names, command_ranges(self.model)
        return Cpg(names.sensors, names.motors, self.control_timestep, ranges)

    @property
    def standing_height(self) -> float:
        """Height of the root body above the ground at the start, m."""
        return float(self.model.body(self.root).pos[2])

    def build(self, hypothesis: Hypothesis, seed: int = 0) -> Embodiment:
        """Returns this robot with what the hypothesis says wrong with it.

        Args:
            hypothesis: In canonical form.
            seed: Of what is random in it, such as the shape of rough terrain. The self-model's is
                0; a physical robot's is another, which no hypothesis knows.

        Raises:
            InputError: The model has no place for what the hypothesis says.
        """
        return embody(self.reshaped(hypothesis, seed), self.anatomy, hypothesis, seed)

    def reshaped(self, hypothesis: Hypothesis, seed: int = 0) -> mujoco.MjModel:
        """Returns the model with what of the hypothesis reshapes it: its own where nothing does.

        Args:
            hypothesis: In canonical form.
            seed: Of what is random in that; see ``build``.
        """
        shape = hypothesis.shape
        return self.specification(shape, seed).compile() if shape else self.model

    def specification(self, hypothesis: Hypothesis = INTACT, seed: int = 0) -> mujoco.MjSpec:
        """Returns the MJCF as a specification that can be edited before it is compiled.

        Args:
            hypothesis: Of which only what reshapes the model is in it.
            seed: Of what is random in that.
        """
        spec = mujoco.MjSpec.from_string(self.mjcf, assets=dict(self.assets))
        for fault in hypothesis.faults:
            if fault.kind.reshape:
                fault.kind.reshape(spec, fault, seed)
        return spec


def _said_delay(model: mujoco.MjModel) -> float:
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, CONTROL_DELAY)
    return float(model.numeric(found).data[0]) if found >= 0 else 0.0
