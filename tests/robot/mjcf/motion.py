"""The motion of a user's file, for comparison with that of its robot."""

import warnings
from pathlib import Path

import mujoco
import numpy as np


def theirs(path: Path) -> mujoco.MjModel:
    """Returns the compiled model of the user's file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mujoco.MjModel.from_xml_path(str(path))


def written(folder: Path, text: str) -> Path:
    path = folder / "robot.xml"
    path.write_text(text, encoding="utf-8")
    return path


def moved(model: mujoco.MjModel, qpos: np.ndarray, steps: int = 60) -> mujoco.MjData:
    """Returns the state after a run from a pose with sinusoidal commands."""
    data = mujoco.MjData(model)
    data.qpos = qpos
    for step in range(steps):
        data.ctrl = 0.5 * np.sin(0.2 * step + np.arange(model.nu))
        mujoco.mj_step(model, data)
    return data
