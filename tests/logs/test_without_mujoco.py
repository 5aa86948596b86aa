"""Logs and repertoires are read, checked and salvaged where there is no simulator."""

import subprocess
import sys
from pathlib import Path

from selfmodel.logs.repertoires import save_repertoire
from selfmodel.robot.robot import Robot
from tests.helpers.drivers import random_repertoire

SCRIPT = """
import sys
from pathlib import Path
sys.modules |= dict.fromkeys(("mujoco", "dm_control", "rosbags", "ribs"))
from selfmodel.cli import main
from selfmodel.logs import read_log, read_truth
from selfmodel.logs.repertoires import load_repertoire
log = read_log("trial.mcap")
print(log.trial.trajectory.steps, read_truth("trial.mcap"), len(load_repertoire(Path("gaits.npz"))))
for words in ("info trial.mcap", "salvage cut.part -o new.mcap", "verify trial.mcap new.mcap"):
    sys.argv[1:] = ["logs", *words.split()]
    try:
        main()
    except SystemExit as end:
        assert not end.code, words
"""


def test_logs_and_repertoires_are_read_where_there_is_no_mujoco(log: Path, quadruped: Robot):
    save_repertoire(log.with_name("gaits.npz"), random_repertoire(quadruped))
    log.with_name("cut.part").write_bytes(log.read_bytes()[:-2000])
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, cwd=log.parent, capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("120 intact 7\n")
    assert done.stdout.count("its model was not loaded") == 2
