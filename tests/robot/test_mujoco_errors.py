"""MuJoCo's warnings: counted, and never in a file of the user's folder or raw on the terminal."""

import importlib
import threading
from pathlib import Path

import mujoco
import pytest

from selfmodel.robot.mujoco_errors import (
    configure,
    mujoco_errors_as_input_errors,
    mujoco_warnings,
    uncounted_warnings,
)

STORM = """
<mujoco>
  <option gravity="0 0 -1e12"/>
  <worldbody><body name="stone"><freejoint/><geom size="0.1"/></body></worldbody>
</mujoco>
"""


def warn() -> None:
    """Simulates until MuJoCo warns."""
    model = mujoco.MjModel.from_xml_string(STORM)
    mujoco.mj_step(model, mujoco.MjData(model))


def total() -> int:
    return sum(mujoco_warnings().values())


def test_a_warning_is_counted_and_goes_to_no_file_and_no_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    configure()
    before = total()
    warn()
    threads = [threading.Thread(target=warn) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert total() == before + 4
    assert any("Inf or huge value in QACC at DOF N" in text for text in mujoco_warnings())
    assert not any("Time" in text for text in mujoco_warnings())
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_a_block_that_reports_its_warnings_by_itself_is_not_counted():
    before = dict(mujoco_warnings())
    with uncounted_warnings():
        warn()
    assert mujoco_warnings() == before


def test_the_handler_of_dm_control_is_replaced_whenever_it_was_imported(
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
):
    own = mujoco.get_mju_user_warning()
    core = importlib.import_module("dm_control.mujoco.wrapper.core")
    before = total()
    mujoco.set_mju_user_warning(core._warning_callback)  # as its import does
    try:
        with mujoco_errors_as_input_errors("simulate a stone"):
            warn()
    finally:
        mujoco.set_mju_user_warning(own)

    assert total() == before + 1
    assert capfd.readouterr() == ("", "")
    assert not caplog.records
