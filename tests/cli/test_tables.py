"""The commands of tables: logs export, and logs import of a CSV, NPZ or Parquet file."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest

from selfmodel.logs import read_log
from tests.helpers.command import printed, selfmodel, succeeds
from tests.helpers.go2 import STAND, recorded

pytestmark = pytest.mark.process

ANT = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "ant.xml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the model of an ant, and a log of it with a broken ankle."""
    folder = tmp_path_factory.mktemp("ant")
    (folder / "ant.xml").write_bytes(ANT.read_bytes())
    succeeds(
        *("trial", "ant.xml", "--damage", "break:ankle_1", "--steps", "200", "--seed", "3"),
        *("--stage", "after", "--out", "after.mcap"),
        cwd=folder,
    )
    return folder


def test_an_exported_trial_is_imported_as_the_same_trial(folder: Path):
    table = "after.csv"
    given = ("logs", "export", "after.mcap", "-o", table, "--json")
    assert printed(*given, cwd=folder)["rows"] == 200
    done = succeeds("logs", "import", table, "--suggest", "--robot", "ant.xml", cwd=folder)
    (folder / "map.toml").write_text(done.stdout)
    imported = ("logs", "import", table, "--mapping", "map.toml", "--out", "again.mcap")
    succeeds(*imported, cwd=folder)

    original, again = (
        read_log(folder / name).trial.trajectory for name in ("after.mcap", "again.mcap")
    )
    for signal, values in original.signals.items():
        assert values.tobytes() == again[signal].tobytes(), signal


@recorded
def test_a_recording_of_a_real_robot_is_imported_without_an_edit(tmp_path: Path):
    (tmp_path / "go2.xml").write_bytes((STAND / "go2.xml").read_bytes())
    table = STAND / "go2-stand.npz"
    done = selfmodel("logs", "import", table, "--suggest", "--robot", "go2.xml", cwd=tmp_path)
    (tmp_path / "map.toml").write_text(
        done.stdout.replace("control_timestep = 0.01 ", "control_timestep = 0.02 ")
    )
    succeeds("logs", "import", table, "--mapping", "map.toml", "-o", "g.mcap", cwd=tmp_path)

    trajectory = read_log(tmp_path / "g.mcap").trial.trajectory
    with np.load(table) as recorded:
        position = recorded["position"][::4]
    assert trajectory.steps == 750
    assert np.abs(trajectory["joint_positions"] - position).max() < 0.01
    assert np.isnan(trajectory["base_position"]).all()
