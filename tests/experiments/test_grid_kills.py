"""Promises of studies that are killed: the resumed study has the same files and the same table."""

import signal
from pathlib import Path

import pytest

from tests.experiments.kill_study import Kill, kill_and_resume, unbroken

KILLS = (
    Kill("ablate", "worker", signal.SIGKILL, 0.5),
    Kill("ablate --next-trial repair", "command", signal.SIGTERM, 0.6),
    Kill("suite run", "group", signal.SIGKILL, 0.4),
)
"""Each study and each victim once; ``tests.experiments.kill_study`` draws more."""


@pytest.mark.process
@pytest.mark.parametrize("kill", KILLS, ids=lambda kill: kill.study)
def test_a_killed_study_is_resumed_to_the_same_table(kill: Kill, tmp_path: Path):
    reference = unbroken(kill.study, tmp_path / "unbroken")

    kill_and_resume(kill, reference, tmp_path / "killed")
