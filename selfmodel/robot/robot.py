"""Robot: an MJCF model, its parts by name, and its control time step."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np

from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.anatomy_reader import driven_joints, find_root_body, read_anatomy
from selfmodel.robot.base import reference_pose
from selfmodel.robot.control_delay import (
    CONTROL_DELAY,
    FITTED_CONTACTS,
    control_delay,
    custom_numeric,
)
from selfmodel.robot.model_checks import check_model
from selfmodel.robot.mujoco_errors import configure

configure()


@dataclass(frozen=True, eq=False)
class Robot:
    """A healthy robot: its MJCF model and its control time step.

    The MJCF contains all properties but the control time step, so that a log with both contains
    the robot. The forward direction is the world's x axis at the initial pose.

    Attributes:
        name: Name of the robot.
        mjcf: The MJCF as one XML text without includes; ``assets`` contains its files.
        control_timestep: Time between two commands, s.
        assets: Contents of the files that the MJCF names, such as meshes, by file name.
        model: The compiled model.
        anatomy: Joints, sensors and motors.
        root: Name of the root body, whose displacement is the displacement of the robot; a robot
            with a fixed base has none.
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
        root = find_root_body(model, driven_joints(model))
        check_model(model, root)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "anatomy", read_anatomy(model, root))
        object.__setattr__(self, "root", str(model.body(root).name))
        if not np.isclose(self.substeps * model.opt.timestep, self.control_timestep, rtol=1e-9):
            raise ValueError(
                f"the control time step {self.control_timestep} s must be a multiple of the "
                f"physics time step {model.opt.timestep} s"
            )
        control_delay(model, self.substeps)  # raises ValueError

    def __repr__(self) -> str:
        names = self.anatomy
        return (
            f"<Robot {self.name}: {len(names.joints)} joints, {len(names.motors)} motors, "
            f"{len(names.sensors)} sensors, control time step {self.control_timestep:g} s>"
        )

    @property
    def substeps(self) -> int:
        """Number of physics steps per control step."""
        return max(1, round(self.control_timestep / float(self.model.opt.timestep)))

    @property
    def control_delay(self) -> float:
        """Control delay of the model, in control steps; see ``CONTROL_DELAY``."""
        return control_delay(self.model, self.substeps)

    @property
    def is_calibrated(self) -> bool:
        """Whether the model is the result of a calibration, which adds a control delay."""
        return custom_numeric(self.model, CONTROL_DELAY) is not None

    @property
    def has_fitted_contacts(self) -> bool:
        """Whether a calibration changed the contacts of the model."""
        return custom_numeric(self.model, FITTED_CONTACTS) is not None

    @property
    def standing_height(self) -> float:
        """Height of the root body above the ground in the initial pose, m."""
        position, _ = reference_pose(self.model, int(self.model.body(self.root).id))
        return float(position[2])

    @property
    def has_fixed_base(self) -> bool:
        """Whether the root body is welded to the world: an arm, or a robot on a stand."""
        return not self.model.body(self.root).jntnum[0]

    def specification(self) -> mujoco.MjSpec:
        """Returns the MJCF as an editable MjSpec."""
        return mujoco.MjSpec.from_string(self.mjcf, assets=dict(self.assets))
