from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.robots import physics_timestep


def model(folder: Path, more: str) -> Path:
    path = folder / "robot.xml"
    path.write_text(f"<mujoco>{more}<worldbody/></mujoco>")
    return path


def test_the_physics_time_step_is_that_of_the_compiled_model(tmp_path: Path):
    assert physics_timestep(model(tmp_path, '<option timestep="0.004"/>')) == 0.004


def test_a_model_whose_time_step_takes_too_much_memory_is_refused(tmp_path: Path):
    greedy = model(
        tmp_path, '<asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset>'
    )

    with pytest.raises(InputError, match=r"robot\.xml.*--budget memory="):
        physics_timestep(greedy)
